"""Paired comparisons: a mean of scenes' differences, and how surely it is not zero, or a margin.

The test changes signs. Were the true mean difference the margin, and each object's differences
spread evenly about it, then an object's sum of differences less the margin could as well have had
the other sign (Fisher 1935). An object changes sign with all its scenes, for they share its shape.

As measured by `harness.benchmarks.statistics_check` with 8 to 21 objects, at 5 % the test rejects
4 to 6 % of true nulls where differences are normal. Where they are as skewed as the exponential
distribution it rejects 6 to 9 %, on one side 2 to 3 % or 8 to 12 %, by where the long tail points:
the mean of few skewed values errs to the other side more often. Two revisions that compute the
same have no such tail, for then each difference is as likely as its opposite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.special import stdtrit

from harness.statistics.intervals import LEAST_OBJECTS, bootstrap_interval

if TYPE_CHECKING:
    import numpy.typing as npt

    Alternative = Literal["two-sided", "less", "greater"]

ALPHA = 0.05
"""Share of true null hypotheses that a single test may reject."""

POWER = 0.8
"""Share of runs in which a difference of `PairedTest.minimum_detectable` is found."""

PERMUTATIONS = 10_000
"""Random changes of signs where there are too many to go through; fewer above 512 objects."""

_CHANGES = 1 << 23
_LEAST_PERMUTATIONS = 1000

EXACT_OBJECTS = 16
"""Up to so many objects all changes of signs are gone through: 65,536 with 16."""


@dataclass(frozen=True)
class PairedTest:
    """The mean of paired differences, and how surely it is not the margin.

    Attributes
    ----------
    mean
        Over the scenes where the difference is defined; None where there is none.
    low, high
        Bounds of the 95 % interval; None with fewer than `LEAST_OBJECTS` objects.
    p_value
        Of the sign-change test; None where the objects are too few for it ever to be `ALPHA` or
        less (the least that n objects reach is 2 / 2^n on two sides, 1 / 2^n on one), unless all
        differences are the margin: it is 1 then.
    effect_size
        Mean over objects of their mean differences in units of those means' standard deviation
        (Cohen's d_z), less its small-sample bias (Hedges 1981). None with fewer than
        `LEAST_OBJECTS` objects, and where the objects differ by the same amount that is not 0.
    minimum_detectable
        How far from the margin the true mean must at least be for the test to find it at `ALPHA`
        with a probability of `POWER`, on as many scenes and objects that spread as these do; None
        where the test never can. The probability holds with 8 objects and more (0.7 with 6).
    scenes, objects
        Number of scenes where the difference is defined, and of their objects.
    """

    mean: float | None
    low: float | None
    high: float | None
    p_value: float | None
    effect_size: float | None
    minimum_detectable: float | None
    scenes: int
    objects: int


def paired_test(
    differences: npt.NDArray[np.float64],
    *,
    objects: npt.NDArray[np.str_],
    seed: int,
    margin: float = 0.0,
    alternative: Alternative = "two-sided",
) -> PairedTest:
    """Test whether the mean of paired differences is the margin.

    Parameters
    ----------
    differences : (n,) float64
        One value per scene, the first less the second; NaN where undefined.
    objects : (n,) str
        The object of each scene.
    seed
        Of the resampling, and of the signs where they are too many to go through.
    margin
        The mean under the null hypothesis.
    alternative
        What is held against it: that the true mean is another, less or greater.

    Raises
    ------
    ValueError
        An infinite difference, or not one object for each.
    """
    if differences.shape != objects.shape or differences.ndim != 1:
        raise ValueError(
            f"differences has shape {differences.shape} and objects {objects.shape}; "
            "both must be (n,)"
        )
    if np.isinf(differences).any():
        raise ValueError("differences holds an infinite value; an undefined one is NaN")
    defined = ~np.isnan(differences)
    values, objects = differences[defined], objects[defined]
    if values.size == 0:
        return PairedTest(None, None, None, None, None, None, scenes=0, objects=0)
    names, member = np.unique(objects, return_inverse=True)
    sizes = np.bincount(member)
    sums = np.bincount(member, weights=values).astype(np.float64, copy=False)
    # Rounding alone must not pass for a difference.
    rounding = 1e-12 * (float(np.abs(values).max()) + abs(margin))
    p_value = None
    if np.abs(values - margin).max() <= rounding:
        p_value = 1.0
    elif attainable_level(names.size, alternative=alternative) > 0:
        p_value = sign_change_p(sums - sizes * margin, seed=seed, alternative=alternative)
    low, high = bootstrap_interval(values, objects=objects, seed=seed) or (None, None)
    return PairedTest(
        mean=float(values.mean()),
        low=low,
        high=high,
        p_value=p_value,
        effect_size=_effect_size(sums / sizes, rounding=rounding),
        minimum_detectable=_minimum_detectable(
            sums, sizes, alternative=alternative, rounding=rounding
        ),
        scenes=values.size,
        objects=names.size,
    )


def attainable_level(objects: int, *, alternative: Alternative) -> float:
    """Greatest p-value up to `ALPHA` that changes of so many objects' signs can yield; 0 without.

    There are 2^n changes of n signs, and with two sides each counts with its mirror image.
    """
    if objects > EXACT_OBJECTS:
        return ALPHA
    step = (2.0 if alternative == "two-sided" else 1.0) / 2.0**objects
    return math.floor(ALPHA / step) * step


LEAST_TESTED = next(n for n in count(1) if attainable_level(n, alternative="two-sided") > 0)
"""With fewer objects no change of signs on two sides attains `ALPHA`."""


def sign_change_p(totals: npt.NDArray[np.float64], *, seed: int, alternative: Alternative) -> float:
    """Share of changes of signs under which the sum of the totals is as far out as it is.

    Where the changes are random, the observed signs count among them: the p-value stays a valid
    one and is never 0 (Phipson and Smyth 2010).

    Parameters
    ----------
    totals : (objects,) float64
        Sum of each object's differences, less the margin.
    seed
        Of random signs.
    alternative
        Which sums are farther out.
    """
    if alternative == "less":
        totals = -totals
    observed = float(totals.sum())
    if totals.size <= EXACT_OBJECTS:
        found = np.zeros(1)
        for total in totals:
            found = np.concatenate((found + total, found - total))
        unchanged = 0
    else:
        # A power of two serves all columns of a table, which are defined in unlike many objects.
        signs = _signs(seed=seed, objects=1 << (totals.size - 1).bit_length())
        found = signs[:, : totals.size] @ totals
        unchanged = 1
    if alternative == "two-sided":
        found, observed = np.abs(found), abs(observed)
    # Sums that rounding alone sets apart are ties.
    rounding = 1e-12 * float(np.abs(totals).sum())
    as_far = int(np.count_nonzero(found >= observed - rounding))
    return (as_far + unchanged) / (found.size + unchanged)


@lru_cache(maxsize=2)
def _signs(*, seed: int, objects: int) -> npt.NDArray[np.float64]:
    """Signs (permutations, objects) of the objects; the cells of a table change the same ones."""
    rng = np.random.Generator(np.random.Philox(seed))
    permutations = min(PERMUTATIONS, max(_LEAST_PERMUTATIONS, _CHANGES // objects))
    return np.where(rng.integers(2, size=(permutations, objects), dtype=np.int8) == 1, 1.0, -1.0)


def _effect_size(means: npt.NDArray[np.float64], *, rounding: float) -> float | None:
    """Hedges' g of the objects' means (objects,).

    ``g = J mean / sd`` with ``J = Gamma(m / 2) / (sqrt(m / 2) Gamma((m - 1) / 2))`` and
    ``m = objects - 1`` degrees of freedom (Hedges 1981, eq. 6e).
    """
    if means.size < LEAST_OBJECTS:
        return None
    mean, deviation = float(means.mean()), float(means.std(ddof=1))
    if deviation <= rounding:
        return 0.0 if abs(mean) <= rounding else None
    half = (means.size - 1) / 2
    correction = math.exp(math.lgamma(half) - math.lgamma(half - 0.5)) / math.sqrt(half)
    return mean / deviation * correction


def detectable_errors(objects: int, *, alternative: Alternative) -> float | None:
    """``t(1 - level / sides) + t(power)``: the detectable difference in standard errors.

    Bloom (1995), with quantiles of Student's distribution with objects - 1 degrees of freedom and
    the level that the test can attain; None where that is 0.
    """
    level = attainable_level(objects, alternative=alternative)
    if level == 0.0:
        return None
    tail = level / 2 if alternative == "two-sided" else level
    return sum(float(stdtrit(objects - 1, share)) for share in (1 - tail, POWER))


def _minimum_detectable(
    sums: npt.NDArray[np.float64],
    sizes: npt.NDArray[np.intp],
    *,
    alternative: Alternative,
    rounding: float,
) -> float | None:
    """`detectable_errors` times the standard error of the mean.

    ``SE^2 = n / (n - 1) sum over objects of (sum - size mean)^2 / scenes^2`` is the variance of a
    mean over n objects that are drawn with all their scenes (Liang and Zeger 1986, with the usual
    factor for few objects).
    """
    objects, scenes = sizes.size, float(sizes.sum())
    errors = detectable_errors(objects, alternative=alternative)
    if errors is None:
        return None
    apart = sums - sizes * (sums.sum() / scenes)
    if np.abs(apart / sizes).max() <= rounding:
        return 0.0
    return errors * math.sqrt(objects / (objects - 1) * float(np.sum(apart**2))) / scenes
