"""The run's tables, as grids that sort."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.html_report.grid import Cell, Grid, Heading, estimate_cell, number_cell
from harness.html_report.names import cell_name, clipped, plain, set_label, variant_name
from harness.html_report.scenes import MISSED, SCORED, RankedScene
from harness.table.cells import millimetres, object_count, scene_count
from harness.table.columns import BRIEF_COLUMNS, COLUMNS, STATE_COLUMNS, SWEEP_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.runs.records import Record
    from harness.table.columns import Column
    from harness.table.summary import Row, Table

MOST_LOST = 200
"""How many failures the page lists."""
MOST_LISTED = 300
"""How many scenes the table of scenes holds."""


def brief_grids(table: Table) -> list[Grid]:
    """Tabulate each class and test set: its models, and the seed's numbers for it."""
    clamped, *_ = STATE_COLUMNS
    grids = []
    for rows in table.groups():
        first = max(rows, key=lambda row: row.scenes)
        name = cell_name(first.category, first.variant.completion)
        rate = first.values["base_rate"].mean
        share = "" if rate is None else f"; {rate:.0%} of the points lie on the mesh"
        columns = BRIEF_COLUMNS
        if any(row.values[clamped.key].mean for row in rows):
            columns = (*columns, clamped)
        grids.append(
            Grid(
                f"{name}: {scene_count(first)}, {object_count(first)}{share}",
                (Heading("model", numeric=False), *_headings(columns)),
                [
                    *(
                        (Cell(variant_name(row.variant, table)), *_estimates(row, columns))
                        for row in rows
                    ),
                    *_seed_rows(rows, columns),
                ],
            )
        )
    return grids


def every_measure_grid(table: Table) -> Grid:
    """Tabulate all measures of all rows."""
    return Grid(
        "Every measure at the reported tolerance",
        (*_row_headings(), *_headings(COLUMNS)),
        [(*_row_names(row, table), *_estimates(row, COLUMNS)) for row in table.rows],
    )


def sweep_grid(table: Table) -> Grid:
    """Tabulate all tolerances."""
    return Grid(
        "Every tolerance",
        (*_row_headings(), Heading("tolerance"), *_headings(SWEEP_COLUMNS)),
        [
            (
                *_row_names(row, table),
                Cell(millimetres(row.tolerance_m), value=row.tolerance_m),
                *_estimates(row, SWEEP_COLUMNS),
            )
            for row in table.sweep
        ],
    )


def failures_grid(records: Sequence[Record]) -> Grid | None:
    """List what failed and why, once for each scene, test set and reason; None without any."""
    lost: dict[tuple[str, str, str], list[str]] = {}
    for record in records:
        if record.failure is not None:
            models = lost.setdefault((record.scene_id, record.completion, record.failure), [])
            if record.model not in models:
                models.append(record.model)
    if not lost:
        return None
    rest = "" if len(lost) <= MOST_LOST else f" (the first {MOST_LOST} of {len(lost)})"
    return Grid(
        f"Failures{rest}",
        _texts("scene", "test set", "models", "why"),
        [
            (
                Cell(scene_id),
                Cell(set_label(completion)),
                Cell(", ".join(plain(model) for model in models)),
                Cell(clipped(failure), tone="bad"),
            )
            for (scene_id, completion, failure), models in list(lost.items())[:MOST_LOST]
        ],
    )


def missed_grid(ranked: Sequence[RankedScene]) -> Grid | None:
    """List the scenes whose target the segmenter missed; None without any."""
    missed = [item for item in ranked if item.state == MISSED]
    if not missed:
        return None
    rest = "" if len(missed) <= MOST_LOST else f" (the first {MOST_LOST} of {len(missed)})"
    return Grid(
        f"Targets that the segmenter missed{rest}",
        _texts("scene", "object", "segmenter"),
        [
            (
                Cell(item.scene_id),
                Cell(item.records[0].object_name),
                Cell(item.records[0].segmenter),
            )
            for item in missed[:MOST_LOST]
        ],
    )


def scene_grid(ranked: Sequence[RankedScene], *, model: str) -> Grid:
    """Tabulate scenes, the worst first, with one model's numbers."""
    rest = "" if len(ranked) <= MOST_LISTED else f", the worst {MOST_LISTED} of {len(ranked)}"
    rows = [
        (
            Cell(item.scene_id),
            Cell(record.object_name),
            Cell(set_label(record.completion)),
            Cell(
                clipped(record.failure or item.state),
                tone="bad" if record.failure or item.state != SCORED else "",
            ),
            *(number_cell(column.value(record)) for column in BRIEF_COLUMNS),
        )
        for item in ranked[:MOST_LISTED]
        for record in item.records
        if record.model == model
    ]
    return Grid(
        f"Scenes by the {plain(model)} model{rest}",
        (*_texts("scene", "object", "test set", "state"), *_headings(BRIEF_COLUMNS)),
        rows,
    )


def _texts(*names: str) -> tuple[Heading, ...]:
    return tuple(Heading(name, numeric=False) for name in names)


def _headings(columns: Sequence[Column]) -> tuple[Heading, ...]:
    return tuple(Heading(column.heading) for column in columns)


def _row_headings() -> tuple[Heading, ...]:
    return _texts("class", "test set", "model")


def _row_names(row: Row, table: Table) -> tuple[Cell, ...]:
    return (
        Cell(row.category),
        Cell(set_label(row.variant.completion)),
        Cell(variant_name(row.variant, table)),
    )


def _estimates(row: Row, columns: Sequence[Column]) -> Iterator[Cell]:
    return (estimate_cell(row.values[column.key], scenes=row.scenes) for column in columns)


def _seed_rows(rows: Sequence[Row], columns: Sequence[Column]) -> Iterator[tuple[Cell, ...]]:
    """Yield each of the seed's rows for these models once."""
    seen = []
    for row in rows:
        if row.seed and row.seed not in seen:
            seen.append(row.seed)
            numbers = [row.seed.get(column.key) for column in columns]
            cells = (Cell("") if n is None else Cell(f"{n:.3f}", n, tone="dim") for n in numbers)
            yield (Cell(f"seed: {row.seed_model}", tone="dim"), *cells)
