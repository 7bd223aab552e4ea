"""A pattern search over positive parameters, whose every trial is kept.

Hooke and Jeeves (1961), "Direct search solution of numerical and statistical problems": from the
best setting one parameter at a time is multiplied and divided by a factor; the factor shrinks once
nothing helps. The search so ends with a curve through the best setting along each parameter, by
which the choice can be checked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

FACTORS = (2.0, math.sqrt(2.0))
"""By how much a parameter is changed, first and last."""

LEAST_GAIN = 1e-6
"""Nats; less is rounding, for which no setting is left."""


@dataclass(frozen=True)
class Parameter:
    """A positive setting.

    Attributes
    ----------
    key
        Dotted key in the ``[pipeline]`` table.
    low, high
        Bounds of the search.
    """

    key: str
    low: float
    high: float


@dataclass(frozen=True)
class Trial:
    """A setting that was tried.

    Attributes
    ----------
    values
        One of each parameter.
    loss
        What it cost.
    """

    values: tuple[float, ...]
    loss: float


@dataclass(frozen=True)
class Search:
    """A finished search.

    Attributes
    ----------
    best
        The best trial.
    centre
        The best on the pattern; `best` may lie between its points.
    trials
        All, in their order.
    """

    best: Trial
    centre: Trial
    trials: tuple[Trial, ...]

    def curve(self, index: int) -> list[Trial]:
        """Trials that differ from the centre in one parameter alone, by that parameter."""
        line = [
            trial
            for trial in self.trials
            if all(
                math.isclose(value, centre, rel_tol=1e-9)
                for place, (value, centre) in enumerate(
                    zip(trial.values, self.centre.values, strict=True)
                )
                if place != index
            )
        ]
        return sorted(line, key=lambda trial: trial.values[index])


def pattern_search(
    loss: Callable[[tuple[float, ...]], float],
    start: Sequence[float],
    *,
    parameters: Sequence[Parameter],
    factors: Sequence[float] = FACTORS,
) -> Search:
    """Minimise a loss of positive parameters.

    A parabola through the last three trials along each parameter, in its logarithm, gives one more
    trial between the steps.

    Parameters
    ----------
    loss
        Of one value per parameter; each setting is asked once.
    start
        Where to begin; brought within the bounds.
    parameters
        Their bounds.
    factors
        Steps, in the order they are taken.
    """
    trials: dict[tuple[float, ...], Trial] = {}

    def attempt(values: Sequence[float]) -> Trial:
        inside = tuple(
            min(max(value, item.low), item.high)
            for value, item in zip(values, parameters, strict=True)
        )
        # What goes forth and back by a factor comes back but for rounding.
        key = tuple(round(math.log(value), 9) for value in inside)
        if key not in trials:
            trials[key] = Trial(inside, loss(inside))
        return trials[key]

    best = attempt(start)
    for factor in factors:
        improved = True
        while improved:
            improved = False
            for index in range(len(parameters)):
                for step in (factor, 1.0 / factor):
                    while (
                        trial := attempt(_scaled(best.values, index, step))
                    ).loss < best.loss - LEAST_GAIN:
                        best, improved = trial, True
    between = [
        _vertex(
            attempt(_scaled(best.values, index, 1.0 / factors[-1])),
            best,
            attempt(_scaled(best.values, index, factors[-1])),
            index=index,
        )
        for index in range(len(parameters))
    ]
    refined = min(best, attempt(between), key=lambda trial: trial.loss)
    return Search(refined, best, tuple(trials.values()))


def _scaled(values: Sequence[float], index: int, step: float) -> tuple[float, ...]:
    return tuple(value * step if at == index else value for at, value in enumerate(values))


def _vertex(below: Trial, middle: Trial, above: Trial, *, index: int) -> float:
    """Value of a parameter where the parabola through three trials is least."""
    a, b, c = (math.log(trial.values[index]) for trial in (below, middle, above))
    down, up = below.loss - middle.loss, above.loss - middle.loss
    if not (a < b < c and down >= 0 and up >= 0 and down + up > 0):
        return middle.values[index]
    left, right = b - a, c - b
    shift = (down * right**2 - up * left**2) / (2 * (down * right + up * left))
    return math.exp(min(max(b + shift, a), c))
