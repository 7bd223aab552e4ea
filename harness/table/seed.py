"""The seed paper's Table III, to hold ours against."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.runs.records import Variant

# TP, TN, FP, FN, precision (its "Acc." column, which equals TP / (TP + FP) on all eight rows) and
# accuracy (TP + TN).
_TABLE_III = {
    ("mug", "classic", True): (0.066, 0.793, 0.125, 0.016, 0.345, 0.859),
    ("mug", "metric", True): (0.161, 0.711, 0.083, 0.045, 0.659, 0.872),
    ("mug", "classic", False): (0.356, 0.139, 0.414, 0.091, 0.462, 0.495),
    ("mug", "metric", False): (0.404, 0.161, 0.345, 0.090, 0.539, 0.565),
    ("bowl", "classic", True): (0.265, 0.024, 0.598, 0.113, 0.307, 0.289),
    ("bowl", "metric", True): (0.406, 0.012, 0.502, 0.080, 0.447, 0.418),
    ("bowl", "classic", False): (0.246, 0.206, 0.477, 0.071, 0.340, 0.452),
    ("bowl", "metric", False): (0.249, 0.244, 0.445, 0.062, 0.358, 0.493),
}
_KEYS = ("tp", "tn", "fp", "fn", "precision", "accuracy")
_SEED_MODEL = {"classic": "classic", "metric_literal": "metric", "metric": "metric"}


def seed_model(variant: Variant) -> str:
    """Which of the seed's two models stands beside ours."""
    return _SEED_MODEL.get(variant.model, "")


def seed_numbers(*, category: str, variant: Variant) -> Mapping[str, float]:
    """Look up the seed's row for ours, by column key; empty where it has none.

    Both of our metric models stand beside the seed's one: ``metric_literal`` is its Eq. 1 as
    written, ``metric`` the sound model that takes its place.
    """
    row = _TABLE_III.get((category, seed_model(variant), variant.completion != "none"))
    return {} if row is None else dict(zip(_KEYS, row, strict=True))
