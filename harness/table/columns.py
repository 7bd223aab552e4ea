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

RANKING_COLUMNS = (
    Column("recall", "recall"),
    Column("f1", "F1"),
    Column("mcc", "MCC"),
    Column("auroc", "AUROC"),
    Column("average_precision", "AP"),
    Column("base_rate", "base rate"),
)
"""What else a classifier is judged by."""

CALIBRATION_COLUMNS = (
    Column("ece", "ECE"),
    Column("ece_recalibrated", "recal. ECE"),
    Column("brier", "Brier"),
    Column("brier_recalibrated", "recal. Brier"),
    Column("log_loss", "log loss"),
)
"""How far probabilities can be taken at their word, raw and recalibrated."""

CONFIDENCE_COLUMNS = (
    Column("aurc", "AURC"),
    Column("random_aurc", "random"),
    Column("nearest_aurc", "nearest"),
    Column("risk_at_50", "risk@50"),
    Column("risk_at_80", "risk@80"),
)
"""How well a confidence ranks the decisions, and the baselines it must beat."""

STATE_COLUMNS = (
    Column("clamped_share", "clamped"),
    Column("gate", "gate"),
    Column("ood", "OOD"),
)
"""What a model says of itself."""

PARTS = (SEED_COLUMNS, RANKING_COLUMNS, CALIBRATION_COLUMNS, CONFIDENCE_COLUMNS, STATE_COLUMNS)
"""The tables that a page too narrow for one shows."""

COLUMNS = tuple(column for part in PARTS for column in part)


def columns_of(*keys: str) -> tuple[Column, ...]:
    """Choose columns, in the order of the keys."""
    by_key = {column.key: column for column in COLUMNS}
    return tuple(by_key[key] for key in keys)


SWEEP_COLUMNS = columns_of("precision", "accuracy", "recall", "f1", "auroc", "ece", "aurc")
"""What the sweep over tolerances shows."""

BRIEF_COLUMNS = (
    *columns_of("tp", "tn", "fp", "fn", "precision", "accuracy", "auroc", "aurc", "ece"),
    Column("ece_recalibrated", "recal."),
)
"""What a look at a run needs; the clamped share comes on top where there is any."""

DIFFERENCE_COLUMNS = columns_of("precision", "accuracy", "auroc", "aurc", "ece", "log_loss")
"""What models and runs are compared by."""

HIGHER_IS_BETTER = frozenset({"precision", "accuracy", "auroc"})
"""Of `DIFFERENCE_COLUMNS`; of the others lower is better."""
