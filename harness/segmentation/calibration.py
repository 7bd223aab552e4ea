"""Whether a detection's score is the probability that the detection is right.

- ECE: mean over the detections of ``|share right - mean score|`` of the bin they are in (Naeini et
  al. 2015), bins of equal width or of equally many detections.
- Brier: mean squared difference of the score from 1 where right and 0 where wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]
    Flags = npt.NDArray[np.bool_]
    Ints = npt.NDArray[np.int64]

BINS = 15


@dataclass(frozen=True)
class ReliabilityBin:
    """Detections of like score: their number, mean score, and the share that is right."""

    count: int
    mean_score: float
    share_right: float


def equal_width(scores: Floats) -> Ints:
    """Sort scores (n,) into bins: bin b of B holds [b/B, (b+1)/B), the last one 1 as well."""
    return np.minimum((scores * BINS).astype(np.int64), BINS - 1)


def equal_mass(scores: Floats) -> Ints:
    """Sort scores (n,) into bins of equally many, up to one.

    Tied scores share the bin that the middle of the tie falls into, so that their order is of no
    matter.
    """
    _, tie, sizes = np.unique(scores, return_inverse=True, return_counts=True)
    doubled_middle = 2 * (np.cumsum(sizes) - sizes) + sizes
    return np.asarray(doubled_middle * BINS // max(2 * len(scores), 1))[tie]


def calibration_error(scores: Floats, right: Flags, bins: Ints, weights: Floats) -> Floats:
    """ECE of several draws of the same detections.

    Parameters
    ----------
    scores : (n,) float64
    right : (n,) bool
    bins : (n,) int64
        The bin of each detection, below `BINS`.
    weights : (draws, n) float64
        How often each draw has each detection.

    Returns
    -------
    ece : (draws,) float64
        NaN of a draw without a detection.
    """
    members = np.zeros((len(scores), BINS))
    members[np.arange(len(scores)), bins] = right - scores
    gaps = np.abs(weights @ members).sum(axis=1)
    return _over(gaps, weights.sum(axis=1))


def brier(scores: Floats, right: Flags, weights: Floats) -> Floats:
    """Brier score (draws,) of several draws; arguments as for `calibration_error`."""
    squares: Floats = (scores - right) ** 2
    return _over(weights @ squares, weights.sum(axis=1))


def reliability(scores: Floats, right: Flags) -> tuple[ReliabilityBin, ...]:
    """List the bins of equal width that hold detections, by rising score."""
    bins = equal_width(scores)
    return tuple(
        ReliabilityBin(
            count=int(np.count_nonzero(inside)),
            mean_score=float(scores[inside].mean()),
            share_right=float(right[inside].mean()),
        )
        for inside in (bins == number for number in range(BINS))
        if inside.any()
    )


def _over(sums: Floats, counts: Floats) -> Floats:
    means = np.full(len(sums), np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means
