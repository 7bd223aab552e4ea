"""A confidence above which points can be kept, with a guarantee from finitely many objects.

What is to be controlled is the share L(t) of false points among those that a scene keeps at
threshold t. The unit is the object with all its scenes: scenes of one object share its shape, and
points of one scene its map, so that only objects can be taken for draws from one population. A
guarantee is for a scene of a new object of that population, simulated or recorded as these were.

**In expectation** (conformal risk control: Angelopoulos et al. 2024, theorem 1): over the draw of
the n objects and of a new one, ``E[L_new(chosen)] <= alpha``, with alpha = 1 - the precision
asked for. The theorem wants a loss that never rises with the threshold. L does, for a false point
weighs the more, the fewer are kept, and the guarantee would be void (their proposition 1). So it
is given for ``max of L(u) over u >= t``, as they propose, which never rises and is never below
L. With R its mean over objects, the threshold is the lowest with
``(n R(t) + 1) / (n + 1) <= alpha``. R is 0 at best: with fewer than ``1 / alpha - 1`` objects
nothing can be promised.

**With probability 1 - delta** (Learn then Test: Angelopoulos et al. 2021): over the draw of the n
objects, the chosen threshold has ``E[L] <= alpha`` with at least this probability. Thresholds are
tested from the highest downwards, each at level delta, up to the first that fails, which errs with
at most delta in all. No loss need be monotone. The hypothesis that ``E[L] >= alpha`` is tested by

    p = min(1, product over objects of (1 - alpha) / (1 - L_i))

the inverse of the capital of one who bets on every object (Waudby-Smith and Ramdas 2024, with the
greatest bet that leaves no debt): under the hypothesis each factor's inverse has a mean of at most
1, so that p is at most delta with at most this probability (Markov). Losses are a few per cent of
each object, not all or nothing, and there it needs far fewer objects than the bound of Hoeffding
and Bentkus: see `choose_threshold`. An object of which only false points are kept makes p 1, so
that one is enough to end the tests. At best p is (1 - alpha)^n: with fewer than
``ln(delta) / ln(1 - alpha)`` objects nothing can be promised.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.calibration.losses import THRESHOLDS
from harness.errors import InputError

if TYPE_CHECKING:
    from harness.calibration.losses import Losses

Floats = npt.NDArray[np.float64]

_DIGITS = 12
"""Of alpha: 1 - 0.9 is 0.09999999999999998 in float64, and 9 objects are enough for 0.1."""


@dataclass(frozen=True, kw_only=True)
class Goal:
    """What is asked of a threshold.

    Attributes
    ----------
    keep_precision
        Share of the kept points that shall lie on the mesh, in (0, 1).
    delta
        Probability with which the guarantee may fail over the draw of the objects, in (0, 1); None
        for a guarantee in expectation.

    Raises
    ------
    InputError
        A value out of range.
    """

    keep_precision: float
    delta: float | None = None

    def __post_init__(self) -> None:
        for option, value in (("--keep-precision", self.keep_precision), ("--delta", self.delta)):
            if value is not None and not 0.0 < value < 1.0:
                raise InputError(f"{option} {value} is not between 0 and 1; pass one such as 0.95")

    @property
    def alpha(self) -> float:
        """Share of the kept points that may be false."""
        return round(1.0 - self.keep_precision, _DIGITS)

    @property
    def least_objects(self) -> int:
        """Number of objects below which no threshold can be guaranteed, were no point false."""
        if self.delta is None:
            return math.ceil(round(1.0 / self.alpha, 9)) - 1
        return math.ceil(round(math.log(self.delta) / math.log1p(-self.alpha), 9))


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A threshold, or why there is none.

    Attributes
    ----------
    threshold
        The lowest of `THRESHOLDS` that is guaranteed; None where none is.
    objects
        Number of objects that it rests on.
    least_objects
        Fewest with which any threshold can be guaranteed.
    bound
        At the threshold, or where there is none at the best one: in expectation,
        ``(n R + 1) / (n + 1)``, to be at most alpha; with delta the p-value, to be at most delta.
    """

    threshold: float | None
    objects: int
    least_objects: int
    bound: float


def choose_threshold(losses: Losses, goal: Goal) -> Choice:
    """Choose the lowest threshold that a goal is guaranteed at.

    Parameters
    ----------
    losses
        Of objects that were not used for anything that the confidences depend on.
    goal
        What is asked.

    Notes
    -----
    For 100 objects with losses of about 2 % (Beta with a mean of .02), alpha = .05 and delta = .1
    the bet rejects in 300 of 300 draws, Hoeffding and Bentkus's bound in none; with alpha = .1 and
    48 objects of 3 % in 300 and 1.
    """
    count = len(losses.objects)
    bounds = _bounds(losses.false_share, goal)
    level = goal.alpha if goal.delta is None else goal.delta
    # From the highest threshold down, up to the first that fails.
    failed = np.flatnonzero(bounds[::-1] > level)
    passed = len(bounds) if failed.size == 0 else int(failed[0])
    threshold = float(THRESHOLDS[len(bounds) - passed]) if passed else None
    return Choice(
        threshold=threshold,
        objects=count,
        least_objects=goal.least_objects,
        bound=float(bounds[len(bounds) - passed] if passed else bounds.min()),
    )


def _bounds(false_share: Floats, goal: Goal) -> Floats:
    """Return what each threshold (thresholds,) is judged by, for losses (n, thresholds)."""
    count = len(false_share)
    if goal.delta is None:
        above = np.maximum.accumulate(false_share[:, ::-1], axis=1)[:, ::-1]
        return np.asarray((above.sum(axis=0) + 1.0) / (count + 1))
    with np.errstate(divide="ignore"):
        logs = np.log1p(-goal.alpha) - np.log1p(-false_share)
    return np.asarray(np.exp(np.minimum(logs.sum(axis=0), 0.0)))
