"""What a person looks at first: each class and test set with its models, then what sets them apart.

Intervals of the means, the other metrics and the sweep stand in the run's files.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, TypeVar

from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from harness.table.cells import (
    cell_label,
    compact,
    compact_difference,
    explanation,
    is_significant,
    object_count,
    pair_label,
    scene_count,
)
from harness.table.columns import (
    BRIEF_COLUMNS,
    DIFFERENCE_COLUMNS,
    HIGHER_IS_BETTER,
    SEED_COLUMNS,
    STATE_COLUMNS,
    Column,
)
from harness.table.summary import model_label

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.statistics import MeanEstimate
    from harness.table.differences import Difference
    from harness.table.summary import Row, Table

    Item = TypeVar("Item")

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


def difference_blocks(differences: Sequence[Difference], *, width: int) -> list[RenderableType]:
    """Lay differences out with a block for each class and test set, a column for each pair."""
    blocks: list[RenderableType] = []
    for title, group in itertools.groupby(differences, key=cell_label):
        items = list(group)
        blocks += [
            Text(f"{title}, paired differences [95 % interval]", style="bold"),
            *difference_grids([(pair_label(item), item) for item in items], width=width),
            Text(),
        ]
    return blocks


def difference_grids(
    columns: Sequence[tuple[str, Difference]], *, width: int
) -> Iterator[RenderableType]:
    """Lay differences out as columns under their headings, a line for each measure."""
    label_width = max(len(column.heading) for column in DIFFERENCE_COLUMNS)
    lines = [
        [compact_difference(item.values[column.key]) for column in DIFFERENCE_COLUMNS]
        for _, item in columns
    ]
    needed = [
        _GAP + max(len(heading), *map(len, cells))
        for (heading, _), cells in zip(columns, lines, strict=True)
    ]
    for chunk in chunks(columns, needed, room=width - label_width):
        grid = _grid([heading for heading, _ in chunk])
        for column in DIFFERENCE_COLUMNS:
            estimates = [item.values[column.key] for _, item in chunk]
            cells = [Text(compact_difference(e), style=_style(e, column)) for e in estimates]
            grid.add_row(column.heading, *cells)
        if any(estimate.count < item.scenes for _, item in chunk for estimate in _all(item)):
            grid.add_row("defined in", *(_least(item) for _, item in chunk), style="dim")
        yield grid


def chunks(items: Sequence[Item], needed: Sequence[int], *, room: int) -> list[Sequence[Item]]:
    """Split items into lines of `room` characters, one item in each at least."""
    lines: list[Sequence[Item]] = []
    start = used = 0
    for index, size in enumerate(needed):
        if index > start and used + size > room:
            lines.append(items[start:index])
            start, used = index, 0
        used += size
    return [*lines, items[start:]]


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


def _style(estimate: MeanEstimate, column: Column) -> str:
    if estimate.mean is None or not is_significant(estimate):
        return ""
    better = (estimate.mean > 0) == (column.key in HIGHER_IS_BETTER)
    return "bold green" if better else "bold red"


def _all(item: Difference) -> Iterator[MeanEstimate]:
    return (item.values[column.key] for column in DIFFERENCE_COLUMNS)


def _least(item: Difference) -> str:
    return f"{min(estimate.count for estimate in _all(item))} to {item.scenes} scenes"
