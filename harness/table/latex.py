"""The table as LaTeX, for a document that loads booktabs."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from harness.table.cells import (
    UNDEFINED,
    cell_label,
    difference,
    effect,
    explanation,
    has_seed,
    interval,
    millimetres,
    number,
    object_count,
    pair_label,
    partial_count,
    probability,
    scene_count,
    signed,
    verdict,
)
from harness.table.columns import DIFFERENCE_COLUMNS, PARTS, SWEEP_COLUMNS, Column

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.table.differences import Difference
    from harness.table.summary import Row, Table

_ESCAPES = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "{": r"\{",
        "}": r"\}",
        "_": r"\_",
        "%": r"\%",
        "&": r"\&",
        "#": r"\#",
        "$": r"\$",
        "^": r"\textasciicircum{}",
        "~": r"\textasciitilde{}",
        "<": r"\textless{}",
        UNDEFINED: "--",
    }
)


def escape(text: str) -> str:
    """Text that LaTeX sets as it is."""
    return text.translate(_ESCAPES)


def render_latex(table: Table) -> str:
    """Set a tabular for each part of the table, to be put into floats."""
    lines = [f"% {explanation(table)}", r"% \usepackage{booktabs}"]
    for columns in PARTS:
        headings = ["", *(column.heading for column in columns)]
        lines += _tabular(headings, _main(table.rows, columns))
    for title, group in itertools.groupby(table.reported_differences(), key=cell_label):
        items = list(group)
        counts = f"{scene_count(items[0])}, {object_count(items[0])}"
        headings = [f"{title}, {counts}", "mean [95 % interval]", "p", "q", "effect", "verdict"]
        lines += _tabular(headings, _differences(items))
    if len({row.tolerance_m for row in table.sweep}) > 1:
        headings = ["", "tolerance", *(column.heading for column in SWEEP_COLUMNS)]
        lines += _tabular(headings, _sweep(table.sweep))
    return "\n".join(lines) + "\n"


def _tabular(headings: Sequence[str], body: Iterator[str]) -> list[str]:
    return [
        rf"\begin{{tabular}}{{l{'r' * (len(headings) - 1)}}}",
        r"\toprule",
        _line([escape(heading) for heading in headings]),
        r"\midrule",
        *body,
        r"\bottomrule",
        r"\end{tabular}",
    ]


def _main(rows: Sequence[Row], columns: Sequence[Column]) -> Iterator[str]:
    for index, row in enumerate(rows):
        if index:
            yield r"\addlinespace"
        estimates = [row.values[column.key] for column in columns]
        yield _line([escape(row.label), *(escape(number(item.mean)) for item in estimates)])
        bounds = (
            f"{interval(item)} {partial_count(item, scenes=row.scenes)}".strip()
            for item in estimates
        )
        yield _small([f"{scene_count(row)}; {object_count(row)}", *bounds])
        if has_seed(row, columns):
            seed = (number(row.seed[c.key]) if c.key in row.seed else "" for c in columns)
            yield _small(["seed", *seed])
            ours = (signed(row.difference(c.key)) if c.key in row.seed else "" for c in columns)
            yield _small(["ours less seed", *ours])


def _differences(differences: Sequence[Difference]) -> Iterator[str]:
    for index, item in enumerate(differences):
        if index:
            yield r"\addlinespace"
        yield _line([escape(pair_label(item)), *[""] * 5])
        for column in DIFFERENCE_COLUMNS:
            contrast = item.values[column.key]
            if not contrast.scenes:
                continue
            cells = (
                f"{column.heading} {partial_count(contrast, scenes=item.scenes)}".rstrip(),
                difference(contrast),
                probability(contrast.p_value),
                probability(contrast.q_value),
                effect(contrast.effect_size),
                " ".join(verdict(contrast)),
            )
            yield _line([escape(cell) for cell in cells])


def _sweep(rows: Sequence[Row]) -> Iterator[str]:
    for row in rows:
        cells = (number(row.values[column.key].mean) for column in SWEEP_COLUMNS)
        yield _line([escape(cell) for cell in (row.label, millimetres(row.tolerance_m), *cells)])


def _small(cells: Sequence[str]) -> str:
    return _line([rf"{{\scriptsize {escape(cell)}}}" if cell else "" for cell in cells])


def _line(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"
