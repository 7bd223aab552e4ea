"""The pattern search and Platt's recalibration, on problems whose answers are known."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression  # type: ignore[import-untyped]

from harness.tuning.platt import LEAST_SLOPE, fit_platt, logit
from harness.tuning.search import Parameter, Trial, pattern_search

if TYPE_CHECKING:
    from collections.abc import Callable

A, B = Parameter("a", 1e-3, 10.0), Parameter("b", 1e-2, 100.0)


def bowl(*centre: float, tilt: float = 0.0) -> Callable[[tuple[float, ...]], float]:
    """A quadratic of the logarithms with its least value, 1, at the centre."""

    def loss(values: tuple[float, ...]) -> float:
        off = [math.log(value / middle) for value, middle in zip(values, centre, strict=True)]
        return 1.0 + sum(x * x for x in off) + tilt * math.prod(off)

    return loss


@pytest.mark.parametrize("start", [(0.02, 3.0), (5.0, 0.05), (0.3, 7.0), (1e-3, 100.0)])
def test_a_quadratic_is_met_between_the_steps(start: tuple[float, ...]) -> None:
    found = pattern_search(bowl(0.3, 7.0), start, parameters=(A, B))
    # Along each axis the parabola is exact.
    assert found.best.values == pytest.approx((0.3, 7.0), rel=1e-6)
    assert found.best.loss == pytest.approx(1.0, abs=1e-9)
    assert len(found.trials) <= 45


def test_a_tilted_valley_is_found_within_a_step() -> None:
    found = pattern_search(bowl(0.3, 7.0, tilt=1.0), (0.02, 0.5), parameters=(A, B))
    for value, middle in zip(found.best.values, (0.3, 7.0), strict=True):
        assert abs(math.log(value / middle)) < math.log(2.0) / 2
    assert found.best.loss < 1.05


def test_no_setting_is_asked_twice_and_all_are_kept() -> None:
    asked: list[tuple[float, ...]] = []
    loss = bowl(0.31, 6.1)

    def noted(values: tuple[float, ...]) -> float:
        asked.append(values)
        return loss(values)

    found = pattern_search(noted, (0.02, 3.0), parameters=(A, B))
    assert [trial.values for trial in found.trials] == asked
    assert len({tuple(round(math.log(v), 9) for v in values) for values in asked}) == len(asked)
    assert found.best in found.trials
    assert found.best.loss == min(trial.loss for trial in found.trials)
    again = pattern_search(loss, (0.02, 3.0), parameters=(A, B))
    assert again == found


def test_curves_run_through_the_best_of_the_pattern() -> None:
    found = pattern_search(bowl(0.3, 7.0), (0.1, 5.0), parameters=(A, B))
    for index in range(2):
        curve = found.curve(index)
        values = [trial.values[index] for trial in curve]
        assert values == sorted(values)
        place = curve.index(found.centre)
        assert 0 < place < len(curve) - 1
        for trial in curve:
            assert trial.loss >= found.centre.loss
            assert trial.values[1 - index] == pytest.approx(found.centre.values[1 - index])


def test_a_search_stays_within_its_bounds() -> None:
    found = pattern_search(bowl(1e-6), (50.0,), parameters=(A,))
    assert found.best.values == (A.low,)
    assert all(A.low <= trial.values[0] <= A.high for trial in found.trials)
    found = pattern_search(bowl(1e6), (0.5,), parameters=(A,))
    assert found.best.values == (A.high,)


def test_a_flat_loss_ends_at_its_start() -> None:
    found = pattern_search(lambda _: 0.5, (0.2, 2.0), parameters=(A, B))
    assert found.best == Trial((0.2, 2.0), 0.5)
    assert len(found.trials) == 1 + 4 * 2


# --- recalibration ---


def sample(*, slope: float, intercept: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities that are off by a line on their logit, and truths."""
    rng = np.random.default_rng(0)
    logits = rng.normal(scale=2.0, size=count)
    truth = rng.random(count) < 1 / (1 + np.exp(-(slope * logits + intercept)))
    return 1 / (1 + np.exp(-logits)), truth


@pytest.mark.parametrize(("slope", "intercept"), [(1.0, 0.0), (0.4, -0.7), (2.5, 1.0)])
def test_the_line_is_that_of_logistic_regression(slope: float, intercept: float) -> None:
    probability, truth = sample(slope=slope, intercept=intercept, count=20_000)
    found = fit_platt(probability, truth)
    theirs = LogisticRegression(C=1e9, tol=1e-10).fit(logit(probability)[:, None], truth)
    assert found.slope == pytest.approx(theirs.coef_[0, 0], rel=1e-4)
    assert found.intercept == pytest.approx(theirs.intercept_[0], abs=1e-4)
    # Three standard errors or so of 20,000 points.
    assert found.slope == pytest.approx(slope, rel=0.1)
    assert found.apply(probability).mean() == pytest.approx(truth.mean(), abs=1e-6)


def test_a_ranking_upside_down_keeps_its_order_and_says_the_base_rate() -> None:
    probability, truth = sample(slope=1.0, intercept=0.0, count=5000)
    found = fit_platt(1 - probability, truth)
    assert found.slope == LEAST_SLOPE
    assert np.ptp(found.apply(probability)) < 0.1
    assert found.apply(1 - probability).mean() == pytest.approx(truth.mean(), abs=1e-6)


@pytest.mark.parametrize("truth", [[True, False, True, False], [True, True, False, False]])
def test_certain_probabilities_give_finite_lines(truth: list[bool]) -> None:
    found = fit_platt(np.array([1.0, 1.0, 0.0, 0.0]), np.array(truth))
    assert math.isfinite(found.slope)
    assert math.isfinite(found.intercept)
    assert found.slope >= LEAST_SLOPE
