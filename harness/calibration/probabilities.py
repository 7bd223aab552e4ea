"""What numbers are worth that are read as probabilities.

The conventions are those of `harness.native.binary_metrics`: 15 bins, closed below, and a
likelihood clipped at float64's epsilon.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

BINS = 15


@dataclass(frozen=True, eq=False, kw_only=True)
class Reliability:
    """A reliability diagram.

    Attributes
    ----------
    edges : (bins + 1,) float64
        From 0 to 1. Of bins of equal mass: halfway between a bin's greatest probability and the
        next one's least; a bin that ties have left empty has no width.
    mean_predicted : (bins,) float64
        Mean probability; NaN of an empty bin.
    observed : (bins,) float64
        Share of the bin for which it came true; NaN of an empty bin.
    counts : (bins,) int64
    """

    edges: Floats
    mean_predicted: Floats
    observed: Floats
    counts: npt.NDArray[np.int64]

    @property
    def calibration_error(self) -> float | None:
        """ECE: mean over points of how far their bin is off the diagonal; None without points."""
        total = int(self.counts.sum())
        gaps = np.abs(self.observed - self.mean_predicted)
        return float(np.nansum(self.counts * gaps)) / total if total else None


@dataclass(frozen=True, kw_only=True)
class BrierParts:
    """The Brier score and what it is made of.

    With bins k of n_k points, mean probability p_k and share that came true y_k, and y the share
    of all::

        brier = reliability - resolution + uncertainty + within_variance - within_covariance
        reliability       = sum n_k (p_k - y_k)^2 / n               (Murphy 1973)
        resolution        = sum n_k (y_k - y)^2 / n
        uncertainty       = y (1 - y)
        within_variance   = sum (p_i - p_k)^2 / n                   (Stephenson et al. 2008)
        within_covariance = 2 sum (p_i - p_k) (y_i - y_k) / n

    Murphy's three add up alone where every bin holds a single probability; with the other two the
    sum is exact.
    """

    brier: float
    reliability: float
    resolution: float
    uncertainty: float
    within_variance: float
    within_covariance: float


def reliability(
    probability: Floats, truth: Bools, *, bins: int = BINS, equal_mass: bool = False
) -> Reliability:
    """Make a reliability diagram.

    Parameters
    ----------
    probability : (n,) float64
        In [0, 1].
    truth : (n,) bool
        Whether it came true.
    bins
        Number of bins.
    equal_mass
        Whether bins hold equally many points, up to one, in place of having equal widths. Tied
        points share the bin of their tie's middle, so that no order of points counts.

    Raises
    ------
    ValueError
        Arrays of unlike shapes, a value outside [0, 1], no bins.
    """
    _check(probability, truth)
    if bins < 1:
        raise ValueError(f"bins is {bins}; a diagram has at least one")
    at, edges = _assign(probability, bins=bins, equal_mass=equal_mass)
    counts = np.bincount(at, minlength=bins)
    with np.errstate(invalid="ignore"):
        return Reliability(
            edges=edges,
            mean_predicted=np.bincount(at, weights=probability, minlength=bins) / counts,
            observed=np.bincount(at, weights=truth, minlength=bins) / counts,
            counts=counts.astype(np.int64),
        )


def brier_parts(
    probability: Floats, truth: Bools, *, bins: int = BINS, equal_mass: bool = False
) -> BrierParts | None:
    """Take the Brier score apart, by the bins of `reliability`; None without points."""
    diagram = reliability(probability, truth, bins=bins, equal_mass=equal_mass)
    total = len(truth)
    if total == 0:
        return None
    at, _ = _assign(probability, bins=bins, equal_mass=equal_mass)
    outcome = truth.astype(np.float64)
    base = float(outcome.mean())
    filled = diagram.counts > 0
    counts = diagram.counts[filled]
    predicted, observed = diagram.mean_predicted[filled], diagram.observed[filled]
    off = probability - diagram.mean_predicted[at]
    return BrierParts(
        brier=float(np.mean((probability - outcome) ** 2)),
        reliability=float(counts @ (predicted - observed) ** 2) / total,
        resolution=float(counts @ (observed - base) ** 2) / total,
        uncertainty=base * (1.0 - base),
        within_variance=float(np.mean(off**2)),
        within_covariance=2.0 * float(np.mean(off * (outcome - diagram.observed[at]))),
    )


def negative_log_likelihood(probability: Floats, truth: Bools) -> float | None:
    """Mean of -ln of what was said of what came true, nats; None without points.

    Probabilities are clipped to within float64's epsilon of 0 and 1, as in scikit-learn's
    ``log_loss``: a certain error costs 36 nats.
    """
    _check(probability, truth)
    if len(truth) == 0:
        return None
    epsilon = np.finfo(np.float64).eps
    clipped = np.clip(probability, epsilon, 1.0 - epsilon)
    return float(-np.mean(np.where(truth, np.log(clipped), np.log1p(-clipped))))


def _assign(
    probability: Floats, *, bins: int, equal_mass: bool
) -> tuple[npt.NDArray[np.intp], Floats]:
    """Bin (n,) of each probability, and the edges (bins + 1,)."""
    if not equal_mass:
        at = np.minimum((probability * bins).astype(np.intp), bins - 1)
        return at, np.linspace(0.0, 1.0, bins + 1)
    values, member, sizes = np.unique(probability, return_inverse=True, return_counts=True)
    below = np.cumsum(sizes) - sizes
    of_value = (2 * below + sizes) * bins // (2 * max(len(probability), 1))
    edges = np.ones(bins + 1)
    edges[0] = 0.0
    for index in range(1, bins):
        split = int(np.searchsorted(of_value, index))
        if split == 0:
            edges[index] = 0.0
        elif split < len(values):
            edges[index] = (values[split - 1] + values[split]) / 2.0
    return of_value[member], edges


def _check(probability: Floats, truth: Bools) -> None:
    if probability.shape != truth.shape or probability.ndim != 1:
        raise ValueError(
            f"probability has shape {probability.shape} and truth {truth.shape}; both must be (n,)"
        )
    inside = (probability >= 0.0) & (probability <= 1.0)
    if not inside.all():
        index = int(np.argmin(inside))
        raise ValueError(f"probability[{index}] is {probability[index]}; it must lie in [0, 1]")
