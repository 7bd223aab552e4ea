"""Paired differences on a terminal: a line for each measure, with all that is known of it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.text import Text

from harness.table.cells import (
    cell_label,
    chunks,
    compact_difference,
    effect,
    object_count,
    pair_label,
    probability,
    scene_count,
    verdict,
)
from harness.table.columns import DIFFERENCE_COLUMNS, HIGHER_IS_BETTER, Column

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from harness.table.differences import Contrast, Difference

_GAP = 2
_INDENT = 2


@dataclass(frozen=True)
class _Field:
    """A column: its heading, what it shows of a contrast, and whether it is a text.

    Attributes
    ----------
    gap
        Characters before it.
    """

    heading: str
    show: Callable[[Contrast], str]
    is_text: bool = False
    gap: int = _GAP


_MEAN = _Field("mean [95 % interval]", compact_difference)
_FIELDS = (
    _MEAN,
    _Field("p", lambda contrast: probability(contrast.p_value)),
    _Field("q", lambda contrast: probability(contrast.q_value)),
    _Field("effect", lambda contrast: effect(contrast.effect_size)),
    _Field("", lambda contrast: verdict(contrast)[0], is_text=True),
    # Reads on from the verdict where both stand in one line.
    _Field("", lambda contrast: verdict(contrast)[1], is_text=True, gap=1),
)
_DEFINED = _Field("n", lambda contrast: str(contrast.scenes))


def difference_blocks(differences: Sequence[Difference], *, width: int) -> list[Text]:
    """Lay out the differences of a run: a block for each class and test set."""
    blocks: list[Text] = []
    for title, group in itertools.groupby(differences, key=cell_label):
        items = list(group)
        about = f", paired differences: {scene_count(items[0])}, {object_count(items[0])}"
        blocks += [
            Text.assemble((title, "bold"), about),
            *difference_lines([(pair_label(item), item) for item in items], width=width),
            Text(),
        ]
    return blocks


def difference_lines(items: Sequence[tuple[str, Difference]], *, width: int) -> list[Text]:
    """Lay out differences under their titles, with one heading; stacked where it is narrow.

    A measure that no scene defines has no line.
    """
    rows = [
        (column, item.values[column.key])
        for _, item in items
        for column in DIFFERENCE_COLUMNS
        if item.values[column.key].scenes
    ]
    if not rows:
        return [Text("no scene defines a difference", style="dim")]
    fields = list(_FIELDS)
    if any(
        0 < contrast.scenes < item.scenes for _, item in items for contrast in item.values.values()
    ):
        fields.insert(1, _DEFINED)
    label_width = _INDENT + max(len(column.heading) for column, _ in rows)
    widths = {
        field: max(len(field.heading), *(len(field.show(contrast)) for _, contrast in rows))
        for field in fields
    }
    needed = [field.gap + widths[field] for field in fields]
    lines: list[Text] = []
    for chunk in chunks(fields, needed, room=width - label_width):
        shown = [(field, widths[field]) for field in chunk]
        lines.append(_line("", [(field.heading, "") for field in chunk], shown, label_width))
        for title, item in items:
            lines.append(Text(title, style="bold"))
            for column in DIFFERENCE_COLUMNS:
                contrast = item.values[column.key]
                if contrast.scenes:
                    cells = [
                        (field.show(contrast), _style(field, contrast, column)) for field in chunk
                    ]
                    lines.append(_line(column.heading, cells, shown, label_width))
    return lines


def _line(
    label: str,
    cells: Sequence[tuple[str, str]],
    fields: Sequence[tuple[_Field, int]],
    label_width: int,
) -> Text:
    line = Text(f"{' ' * _INDENT}{label}".ljust(label_width) if label else " " * label_width)
    for (text, style), (field, size) in zip(cells, fields, strict=True):
        line.append(" " * field.gap)
        line.append(text.ljust(size) if field.is_text else text.rjust(size), style=style)
    line.rstrip()
    return line


def _style(field: _Field, contrast: Contrast, column: Column) -> str:
    """Colour what was detected by whether it is for the better; keep back what was not."""
    if not contrast.detected or contrast.mean is None:
        return "dim" if field.is_text else ""
    if field is not _MEAN:
        return ""
    better = (contrast.mean > 0) == (column.key in HIGHER_IS_BETTER)
    return "bold green" if better else "bold red"
