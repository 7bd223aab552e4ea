"""What a person looks at first: each class and test set with its models, then what sets them apart.

Intervals of the means, the other metrics and the sweep stand in the run's files.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from harness.table.cells import (
    cell_label,
    chunks,
    compact,
    explanation,
    object_count,
    scene_count,
)
from harness.table.columns import (
    BRIEF_COLUMNS,
    SEED_COLUMNS,
    STATE_COLUMNS,
    Column,
)
from harness.table.contrasts import difference_blocks
from harness.table.summary import model_label

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.table.summary import Row, Table

_GAP = 2
_NUMBER_WIDTH = len(".000")


def render_brief(table: Table, *, width: int) -> RenderableType:
    """Lay the table out for a terminal of `width` columns."""
    if not table.rows:
        return Text("no scene was scored", style="bold red")
    parts: list[RenderableType] = []
    for rows in table.groups():
        parts += [*_group(rows, width=width), Text()]
    parts += difference_blocks(table.reported_differences(), width=width)
    parts.append(Text(explanation(table), style="dim"))
    return Group(*parts)


def _group(rows: Sequence[Row], *, width: int) -> Iterator[RenderableType]:
    """Lay out one class and test set: a line for each model, the seed's below."""
    first = max(rows, key=lambda row: row.scenes)
    rate = first.values["base_rate"].mean
    base_rate = "" if rate is None else f", {rate:.0%} of the points lie on the mesh"
    about = f"{scene_count(first)}, {object_count(first)}{base_rate}"
    yield Text.assemble((cell_label(first), "bold"), f": {about}")
    clamped, *_ = STATE_COLUMNS
    columns = BRIEF_COLUMNS
    if any(row.values[clamped.key].mean for row in rows):
        columns = (*columns, clamped)
    label_width = max(len(label) for label, _, _ in _lines(rows, columns))
    needed = [_GAP + max(len(column.heading), _NUMBER_WIDTH) for column in columns]
    for chunk in chunks(columns, needed, room=width - label_width):
        grid = _grid([column.heading for column in chunk])
        for label, cells, style in _lines(rows, chunk):
            grid.add_row(label, *cells, style=style)
        yield grid


def _lines(
    rows: Sequence[Row], columns: Sequence[Column]
) -> Iterator[tuple[str, list[str], str | None]]:
    """Yield label, cells and style of each line."""
    for row in rows:
        estimates = [row.values[column.key] for column in columns]
        yield model_label(row.variant), [compact(item.mean) for item in estimates], None
        # A dash says that no scene defines a value.
        if any(0 < estimate.count < row.scenes for estimate in estimates):
            yield "  defined in", [str(estimate.count) for estimate in estimates], "dim"
    seen = []
    for row in rows:
        if row.seed and row.seed not in seen and any(c in SEED_COLUMNS for c in columns):
            seen.append(row.seed)
            cells = [compact(row.seed[c.key]) if c.key in row.seed else "" for c in columns]
            yield f"seed: {row.seed_model}", cells, "dim"


def _grid(headings: Sequence[str]) -> Grid:
    grid = Grid(box=None, pad_edge=False, padding=(0, 0, 0, _GAP), header_style="")
    grid.add_column("", no_wrap=True)
    for heading in headings:
        grid.add_column(heading, justify="right", no_wrap=True)
    return grid
