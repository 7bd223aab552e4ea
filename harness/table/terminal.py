"""All of a table on a terminal, stacked where the terminal is too narrow for one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from harness.table.cells import (
    chunks,
    explanation,
    has_seed,
    interval,
    millimetres,
    number,
    object_count,
    scene_count,
    signed,
)
from harness.table.columns import COLUMNS, PARTS, SWEEP_COLUMNS, Column
from harness.table.contrasts import difference_blocks

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.table.summary import Row, Table

_CELL_WIDTH = len("+0.000")
_GAP = 3


def render_full(table: Table, *, width: int) -> RenderableType:
    """Lay everything out for a terminal of `width` columns: intervals and the sweep too."""
    if not table.rows:
        return Text("no scene was scored", style="bold red")
    parts: list[RenderableType] = []
    for columns in _stacks(table.rows, width=width):
        grid = _grid(columns)
        for row in table.rows:
            for label, cells in _lines(row, columns):
                grid.add_row(label, *cells, style=None if label == row.label else "dim")
            grid.add_section()
        parts += [grid, Text()]
    parts += difference_blocks(table.reported_differences(), width=width)
    parts.append(Text(explanation(table), style="dim"))
    if len({row.tolerance_m for row in table.sweep}) > 1:
        parts.append(_sweep(table, width=width))
    return Group(*parts)


def _lines(row: Row, columns: Sequence[Column]) -> Iterator[tuple[str, list[str]]]:
    """Yield the lines of a row, each a label and its cells."""
    estimates = [row.values[column.key] for column in columns]
    yield row.label, [number(estimate.mean) for estimate in estimates]
    if any(interval(estimate) for estimate in estimates):
        yield "  95 % from", [number(estimate.low) for estimate in estimates]
        yield "  95 % to", [number(estimate.high) for estimate in estimates]
    if any(estimate.count < row.scenes for estimate in estimates):
        yield "  defined in", [str(estimate.count) for estimate in estimates]
    if has_seed(row, columns):
        stated = [number(row.seed[c.key]) if c.key in row.seed else "" for c in columns]
        yield "  seed", stated
        ours = [signed(row.difference(c.key)) if c.key in row.seed else "" for c in columns]
        yield "  ours less seed", ours
    yield f"  {scene_count(row)}", ["" for _ in columns]
    yield f"  {object_count(row)}", ["" for _ in columns]


def _sweep(table: Table, *, width: int) -> RenderableType:
    parts: list[RenderableType] = [Text("\nBy tolerance", style="bold")]
    label_width = max(len(_sweep_label(row)) for row in table.sweep)
    for columns in _fitting(SWEEP_COLUMNS, label_width=label_width, width=width):
        grid = _grid(columns)
        for row in table.sweep:
            cells = [number(row.values[column.key].mean) for column in columns]
            grid.add_row(_sweep_label(row), *cells)
        parts += [grid, Text()]
    return Group(*parts)


def _sweep_label(row: Row) -> str:
    return f"{row.label}, {millimetres(row.tolerance_m)}"


def _grid(columns: Sequence[Column]) -> Grid:
    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    grid.add_column("", overflow="fold")
    for column in columns:
        grid.add_column(
            column.heading, justify="right", no_wrap=True, min_width=_column_width(column)
        )
    return grid


def _column_width(column: Column) -> int:
    return max(len(column.heading), _CELL_WIDTH)


def _stacks(rows: Sequence[Row], *, width: int) -> list[Sequence[Column]]:
    """All columns if they fit; else the seed's first and the other parts below."""
    labels = [label for row in rows for label, _ in _lines(row, COLUMNS)]
    label_width = max(len(label) for label in labels)
    whole = _fitting(COLUMNS, label_width=label_width, width=width)
    if len(whole) == 1:
        return whole
    return [
        chunk for part in PARTS for chunk in _fitting(part, label_width=label_width, width=width)
    ]


def _fitting(columns: Sequence[Column], *, label_width: int, width: int) -> list[Sequence[Column]]:
    needed = [_column_width(column) + _GAP for column in columns]
    return chunks(columns, needed, room=width - label_width)
