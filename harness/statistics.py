"""Intervals of means over scenes.

Scenes are the unit that is resampled: the test points of one scene share its object, views and
noise, so that resampling points would promise a precision that is not there.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

RESAMPLES = 10_000
CONFIDENCE = 0.95


@dataclass(frozen=True)
class MeanEstimate:
    """A mean over scenes.

    Attributes
    ----------
    mean
        Over the scenes where the value is defined; None where there is none.
    low, high
        Bounds of the bootstrap interval; None with fewer than two defined values.
    count
        Number of defined values.
    """

    mean: float | None
    low: float | None
    high: float | None
    count: int


def mean_estimate(values: np.ndarray, *, seed: int) -> MeanEstimate:
    """Mean of the defined values, with its 95 % bootstrap interval.

    Parameters
    ----------
    values : (n,) float64
        One value per scene; NaN where undefined.
    seed
        Of the resampling.
    """
    defined = values[~np.isnan(values)]
    if defined.size == 0:
        return MeanEstimate(mean=None, low=None, high=None, count=0)
    low, high = bootstrap_interval(defined, seed=seed) or (None, None)
    return MeanEstimate(mean=float(defined.mean()), low=low, high=high, count=int(defined.size))


def bootstrap_interval(
    values: np.ndarray,
    *,
    seed: int,
    confidence: float = CONFIDENCE,
    resamples: int = RESAMPLES,
) -> tuple[float, float] | None:
    """Bias-corrected and accelerated (BCa) bootstrap interval of a mean.

    Efron (1987): the bounds are the quantiles of the resampled means at
    ``Phi(z0 + (z0 + z) / (1 - a (z0 + z)))`` for ``z = Phi^-1((1 -+ confidence) / 2)``, where
    ``z0`` corrects the median's bias and ``a``, the skewness of the leave-one-out means over 6,
    the change of spread with the mean. Few values give too
    narrow an interval, as in every bootstrap: of normal values, nominal 0.95 covers 0.89 with 8,
    0.92 with 16 and 0.94 with 32.

    Parameters
    ----------
    values : (n,) float64
        Independent values, all finite.
    seed
        Of the resampling.
    confidence
        Nominal coverage, in (0, 1).
    resamples
        Number of bootstrap samples.

    Returns
    -------
    bounds
        Low and high; None for fewer than two values, which say nothing of their spread.
    """
    count = values.size
    if count < 2:
        return None
    mean = values.mean()
    # Rounding alone must not pass for spread.
    if np.ptp(values) <= 1e-12 * np.abs(values).max():
        return float(mean), float(mean)
    rng = np.random.Generator(np.random.Philox(seed))
    means = values[rng.integers(count, size=(resamples, count))].mean(axis=1)
    # Ties count half, as many scenes share a value such as a recall of 1.
    below = (np.count_nonzero(means < mean) + np.count_nonzero(means <= mean)) / (2 * resamples)
    normal = NormalDist()
    z0 = normal.inv_cdf(below)
    left_out = mean - (values.sum() - values) / (count - 1)
    acceleration = np.sum(left_out**3) / (6.0 * np.sum(left_out**2) ** 1.5)
    shares = []
    for tail in ((1.0 - confidence) / 2.0, (1.0 + confidence) / 2.0):
        z = z0 + normal.inv_cdf(tail)
        shares.append(normal.cdf(z0 + z / (1.0 - acceleration * z)))
    low, high = np.quantile(means, shares)
    return float(low), float(high)
