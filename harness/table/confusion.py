"""Which categories a model takes for which, as shares of the points truly of one."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from harness.native import CLASS_NAMES
from harness.table.summary import MODEL_ORDER, completion_label

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.runs.confusion import Confusion

_GAP = 2


def confusion_shares(rows: Sequence[Confusion]) -> dict[str, tuple[int, list[float]]]:
    """Points and shares by true category, in the order of `CLASS_NAMES`.

    Parameters
    ----------
    rows
        Of one model, completion and tolerance; scenes are summed.

    Returns
    -------
    shares
        Number of points truly of each category, and the share of them that is predicted to be of
        each. A category without a point is absent.
    """
    counts: Counter[tuple[str, str]] = Counter()
    for row in rows:
        counts[row.true, row.predicted] += row.points
    shares = {}
    for true in CLASS_NAMES:
        points = [counts[true, predicted] for predicted in CLASS_NAMES]
        if total := sum(points):
            shares[true] = (total, [count / total for count in points])
    return shares


def render_confusion(rows: Sequence[Confusion]) -> RenderableType:
    """Lay out a table for each test set and model of rows at one tolerance."""
    groups: dict[tuple[str, str], list[Confusion]] = {}
    for row in rows:
        groups.setdefault((row.completion, row.model), []).append(row)
    parts: list[RenderableType] = []
    for completion, model in sorted(groups, key=_order):
        label = f"{model.replace('_', ' ')} {completion_label(completion)}".rstrip()
        parts += [Text(f"Confusion, {label}", style="bold"), _grid(groups[completion, model])]
        parts.append(Text())
    parts.append(
        Text(
            "A row is the category of the object that points lie on, a neighbour's too, or free "
            "space; its shares are by predicted class, over all scenes.",
            style="dim",
        )
    )
    return Group(*parts)


def _order(group: tuple[str, str]) -> tuple[object, ...]:
    completion, model = group
    place = MODEL_ORDER.index(model) if model in MODEL_ORDER else len(MODEL_ORDER)
    return (completion == "none", completion, place, model)


def _grid(rows: Sequence[Confusion]) -> Grid:
    grid = Grid(box=None, pad_edge=False, padding=(0, 0, 0, _GAP), header_style="")
    grid.add_column("true", no_wrap=True)
    for name in CLASS_NAMES:
        grid.add_column(name, justify="right", no_wrap=True)
    grid.add_column("points", justify="right", no_wrap=True)
    for true, (points, shares) in confusion_shares(rows).items():
        cells = [
            Text(f"{share:.3f}" if share else "", style="bold" if name == true else "")
            for name, share in zip(CLASS_NAMES, shares, strict=True)
        ]
        grid.add_row(true, *cells, str(points))
    return grid
