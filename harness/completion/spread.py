"""Whether a completer's own doubt, the spread of each point, tells where it is wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import rankdata

from harness.completion.metrics import CLOSE_M, MM

if TYPE_CHECKING:
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]
    Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class SpreadScore:
    """The spreads of a cloud beside its points' distances to the mesh.

    Attributes
    ----------
    spread_mm, distance_mm
        Means: equal for a spread that is calibrated on the whole.
    right_mm, wrong_mm
        Mean spread of the points within 5 mm of the mesh, and of the others; None without any.
    auroc
        Chance that a wrong point has a larger spread than a right one; None without one of the two.
    within_5mm_claimed
        Mean probability that the completer gives its points to lie within 5 mm.
    """

    spread_mm: float
    distance_mm: float
    right_mm: float | None
    wrong_mm: float | None
    auroc: float | None
    within_5mm_claimed: float


def score_spread(spread_m: Floats, confidence: Floats, distances_m: Floats) -> SpreadScore:
    """Score the spreads (n,), n > 0, against the distances (n,) to the mesh."""
    wrong = distances_m > CLOSE_M
    return SpreadScore(
        spread_mm=float(spread_m.mean()) * MM,
        distance_mm=float(distances_m.mean()) * MM,
        right_mm=mean_mm(spread_m, ~wrong),
        wrong_mm=mean_mm(spread_m, wrong),
        auroc=auroc(spread_m, wrong),
        within_5mm_claimed=float(confidence.mean()),
    )


def mean_mm(values_m: Floats, chosen: Flags) -> float | None:
    """Mean of the chosen values, millimetres; None without any."""
    return float(values_m[chosen].mean()) * MM if chosen.any() else None


def auroc(values: Floats, positive: Flags) -> float | None:
    """Area under the ROC curve: the Mann-Whitney U of the positives, ties counted half."""
    count = int(np.count_nonzero(positive))
    others = len(positive) - count
    if count == 0 or others == 0:
        return None
    ranks = rankdata(values)[positive].sum()
    return float((ranks - count * (count + 1) / 2) / (count * others))
