"""The table as Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.table.cells import (
    cell_label,
    difference,
    explanation,
    has_seed,
    interval,
    millimetres,
    number,
    pair_label,
    partial_count,
    signed,
)
from harness.table.columns import DIFFERENCE_COLUMNS, PARTS, SWEEP_COLUMNS, Column

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.statistics import MeanEstimate
    from harness.table.differences import Difference
    from harness.table.summary import Row, Table


def render_markdown(table: Table) -> str:
    """Write the table as a Markdown page, the seed's columns first."""
    lines = ["# Results", "", explanation(table), ""]
    for columns in PARTS:
        lines += [*_main(table.rows, columns), ""]
    lines += markdown_differences(table.reported_differences())
    if len({row.tolerance_m for row in table.sweep}) > 1:
        lines += ["## By tolerance", "", *_sweep(table.sweep), ""]
    return "\n".join(lines)


def markdown_differences(differences: Sequence[Difference]) -> list[str]:
    """Lines of the section of paired differences; none without any."""
    if not differences:
        return []
    headings = ["", "difference", "scenes", "objects"]
    return [
        "## Paired differences",
        "",
        _line([*headings, *(column.heading for column in DIFFERENCE_COLUMNS)]),
        _line(["---", "---", "--:", "--:", *("--:" for _ in DIFFERENCE_COLUMNS)]),
        *(
            _line(
                [
                    cell_label(item),
                    pair_label(item),
                    str(item.scenes),
                    str(item.objects),
                    *(difference(item.values[column.key]) for column in DIFFERENCE_COLUMNS),
                ]
            )
            for item in differences
        ),
        "",
    ]


def _main(rows: Sequence[Row], columns: Sequence[Column]) -> Iterator[str]:
    yield _line(["", "scenes", "objects", "failed", *(column.heading for column in columns)])
    yield _line(["---", "--:", "--:", "--:", *("--:" for _ in columns)])
    for row in rows:
        cells = [_cell(row.values[column.key], scenes=row.scenes) for column in columns]
        missed = f" ({row.missed} missed)" if row.missed else ""
        counts = [f"{row.scenes}{missed}", str(row.objects), str(row.failed)]
        yield _line([f"**{row.label}**", *counts, *cells])
        if has_seed(row, columns):
            seed = [number(row.seed[c.key]) if c.key in row.seed else "" for c in columns]
            yield _line(["seed", "", "", "", *seed])
            ours = [signed(row.difference(c.key)) if c.key in row.seed else "" for c in columns]
            yield _line(["ours less seed", "", "", "", *ours])


def _sweep(rows: Sequence[Row]) -> Iterator[str]:
    yield _line(["", "tolerance", *(column.heading for column in SWEEP_COLUMNS)])
    yield _line(["---", "--:", *("--:" for _ in SWEEP_COLUMNS)])
    for row in rows:
        cells = [_cell(row.values[column.key], scenes=row.scenes) for column in SWEEP_COLUMNS]
        yield _line([row.label, millimetres(row.tolerance_m), *cells])


def _cell(estimate: MeanEstimate, *, scenes: int) -> str:
    parts = [number(estimate.mean), interval(estimate), partial_count(estimate, scenes=scenes)]
    return " ".join(part for part in parts if part)


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
