"""The table as CSV, one line per row, tolerance and metric."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from harness.table.columns import COLUMNS

if TYPE_CHECKING:
    from harness.table.summary import Table

HEADINGS = (
    "category",
    "model",
    "completion",
    "segmenter",
    "tolerance_m",
    "metric",
    "mean",
    "low",
    "high",
    "scenes_defined",
    "scenes",
    "objects",
    "failed",
    "seed",
    "ours_less_seed",
)


def render_csv(table: Table) -> str:
    """All tolerances, at full precision; an undefined value is an empty field."""
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
                    row.variant.completion,
                    row.variant.segmenter,
                    row.tolerance_m,
                    column.key,
                    estimate.mean,
                    estimate.low,
                    estimate.high,
                    estimate.count,
                    row.scenes,
                    row.objects,
                    row.failed,
                    row.seed.get(column.key) if reported else None,
                    row.difference(column.key) if reported else None,
                )
            )
    return text.getvalue()
