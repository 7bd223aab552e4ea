"""Bootstrap intervals, held against SciPy's and against what they promise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import bootstrap

from harness.statistics import bootstrap_interval, mean_estimate


def interval(values: np.ndarray, **settings: Any) -> tuple[float, float]:
    bounds = bootstrap_interval(values, **settings)
    assert bounds is not None
    return bounds


@pytest.mark.parametrize("count", [8, 16, 100])
def test_agrees_with_scipys_bca(count: int) -> None:
    values = np.random.default_rng(count).exponential(size=count)
    theirs = bootstrap(
        (values,), np.mean, n_resamples=40_000, method="BCa", rng=np.random.default_rng(1)
    ).confidence_interval
    ours = interval(values, seed=2, resamples=40_000)
    # Two independent draws of the same quantiles: apart by a small share of the width.
    assert ours == pytest.approx(theirs, abs=0.03 * (theirs.high - theirs.low))


def test_covers_the_true_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    hits = 0
    for trial in range(400):
        low, high = interval(rng.normal(3.0, 1.0, size=40), seed=trial, resamples=1000)
        hits += low <= 3.0 <= high
    # Nominal 0.95; binomial standard deviation 0.011, and some undercoverage at n = 40.
    assert 0.90 <= hits / 400 <= 0.98


def test_brackets_the_mean_and_shrinks_with_the_confidence() -> None:
    values = np.array([0.1, 0.4, 0.35, 0.8, 0.2])
    wide = interval(values, seed=0)
    narrow = interval(values, seed=0, confidence=0.5)
    assert wide[0] < narrow[0] < values.mean() < narrow[1] < wide[1]
    assert values.min() <= wide[0]
    assert wide[1] <= values.max()


def test_the_same_seed_draws_the_same_interval() -> None:
    values = np.random.default_rng(0).normal(size=7)
    assert interval(values, seed=4) == interval(values, seed=4)
    assert interval(values, seed=4) != interval(values, seed=5)


def test_one_value_has_no_interval() -> None:
    assert bootstrap_interval(np.array([0.3]), seed=0) is None
    estimate = mean_estimate(np.array([0.3]), seed=0)
    assert (estimate.mean, estimate.low, estimate.high, estimate.count) == (0.3, None, None, 1)


@pytest.mark.parametrize("values", [[0.5, 0.5, 0.5], [0.1, 0.1 + 1e-17, 0.1 * (1 + 1e-15)]])
def test_equal_values_have_an_interval_without_width(values: list[float]) -> None:
    low, high = interval(np.array(values), seed=0)
    assert low == high == pytest.approx(values[0])


def test_two_values_and_one_outlier_are_no_special_case() -> None:
    assert bootstrap_interval(np.array([0.0, 1.0]), seed=0) == (0.0, 1.0)
    low, high = interval(np.array([0.0] * 19 + [1.0]), seed=0)
    assert 0.0 <= low < 0.05 < high <= 1.0


def test_undefined_values_are_left_out_and_counted() -> None:
    estimate = mean_estimate(np.array([1.0, np.nan, 3.0]), seed=0)
    assert (estimate.mean, estimate.count) == (2.0, 2)
    nothing = mean_estimate(np.array([np.nan, np.nan]), seed=0)
    assert (nothing.mean, nothing.low, nothing.high, nothing.count) == (None, None, None, 0)
    assert mean_estimate(np.array([]), seed=0).count == 0
