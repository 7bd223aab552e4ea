"""What the table's columns are called and where their values come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.runs.records import Record


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes
    ----------
    key
        Name in CSV files; the record's field.
    heading
        Name in print.
    """

    key: str
    heading: str

    def value(self, record: Record) -> float | None:
        """Read the record's value; counts as fractions of the test points, as in the seed."""
        value: float | None = getattr(record, self.key)
        if value is None or self.key not in _COUNTS:
            return value
        return value / record.test_points if record.test_points else None


_COUNTS = frozenset({"tp", "tn", "fp", "fn"})

SEED_COLUMNS = (
    Column("tp", "TP"),
    Column("tn", "TN"),
    Column("fp", "FP"),
    Column("fn", "FN"),
    Column("precision", "precision"),
    Column("accuracy", "accuracy"),
)
"""What the seed's Table III states or implies."""

FURTHER_COLUMNS = (
    Column("recall", "recall"),
    Column("f1", "F1"),
    Column("mcc", "MCC"),
    Column("auroc", "AUROC"),
    Column("average_precision", "AP"),
    Column("ece", "ECE"),
    Column("brier", "Brier"),
)
"""What else a classifier is judged by."""

CONFIDENCE_COLUMNS = (
    Column("aurc", "AURC"),
    Column("random_aurc", "random"),
    Column("nearest_aurc", "nearest"),
    Column("risk_at_50", "risk@50"),
    Column("risk_at_80", "risk@80"),
)
"""How well a confidence ranks the decisions, and the baselines it must beat."""

PARTS = (SEED_COLUMNS, FURTHER_COLUMNS, CONFIDENCE_COLUMNS)
"""The tables that a page too narrow for one shows."""

COLUMNS = tuple(column for part in PARTS for column in part)

SWEEP_COLUMNS = tuple(
    column
    for column in COLUMNS
    if column.key in {"precision", "accuracy", "recall", "f1", "auroc", "ece", "aurc"}
)
"""What the sweep over tolerances shows."""
