"""The table as CSV, one line per row, tolerance and metric; differences follow the means."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from harness.table.columns import COLUMNS, DIFFERENCE_COLUMNS

if TYPE_CHECKING:
    from harness.table.summary import Table

HEADINGS = (
    "category",
    "model",
    "less_model",
    "completion",
    "segmenter",
    "tolerance_m",
    "metric",
    "mean",
    "low",
    "high",
    "p_value",
    "q_value",
    "effect_size",
    "minimum_detectable",
    "scenes_defined",
    "scenes",
    "objects",
    "failed",
    "missed",
    "seed",
    "ours_less_seed",
)


def render_csv(table: Table) -> str:
    """All tolerances, at full precision; an undefined value is an empty field.

    Where ``less_model`` names a model, the line is a difference paired by scene; the q-values of
    one tolerance's differences are of one family.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADINGS)
    for row in table.sweep:
        # The seed reports one tolerance, the one that ours reports.
        reported = row.tolerance_m == table.reported_tolerance_m
        for column in COLUMNS:
            estimate = row.values[column.key]
            writer.writerow(
                (
                    row.category,
                    row.variant.model,
                    None,
                    row.variant.completion,
                    row.variant.segmenter,
                    row.tolerance_m,
                    column.key,
                    estimate.mean,
                    estimate.low,
                    estimate.high,
                    None,
                    None,
                    None,
                    None,
                    estimate.count,
                    row.scenes,
                    row.objects,
                    row.failed,
                    row.missed,
                    row.seed.get(column.key) if reported else None,
                    row.difference(column.key) if reported else None,
                )
            )
    for item in table.differences:
        for column in DIFFERENCE_COLUMNS:
            contrast = item.values[column.key]
            writer.writerow(
                (
                    item.category,
                    item.first,
                    item.second,
                    item.completion,
                    item.segmenter,
                    item.tolerance_m,
                    column.key,
                    contrast.mean,
                    contrast.low,
                    contrast.high,
                    contrast.p_value,
                    contrast.q_value,
                    contrast.effect_size,
                    contrast.minimum_detectable,
                    contrast.scenes,
                    item.scenes,
                    item.objects,
                    None,
                    None,
                    None,
                    None,
                )
            )
    return text.getvalue()
