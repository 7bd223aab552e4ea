"""The table as Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.table.cells import (
    cell_label,
    difference,
    effect,
    explanation,
    has_seed,
    interval,
    millimetres,
    number,
    pair_label,
    partial_count,
    probability,
    signed,
    verdict,
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
    """Lines of the section of paired differences, one each that any scene defines."""
    if not differences:
        return []
    headings = ["", "difference", "metric", "scenes", "objects", "mean [95 % interval]"]
    return [
        "## Paired differences",
        "",
        _line([*headings, "p", "q", "effect size", "verdict"]),
        _line(["---", "---", "---", "--:", "--:", "--:", "--:", "--:", "--:", "---"]),
        *(
            _difference_line(item, column)
            for item in differences
            for column in DIFFERENCE_COLUMNS
            if item.values[column.key].scenes
        ),
        "",
    ]


def _difference_line(item: Difference, column: Column) -> str:
    contrast = item.values[column.key]
    return _line(
        [
            cell_label(item),
            pair_label(item),
            column.heading,
            str(contrast.scenes),
            str(contrast.objects),
            difference(contrast),
            probability(contrast.p_value),
            probability(contrast.q_value),
            effect(contrast.effect_size),
            " ".join(verdict(contrast)),
        ]
    )


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
