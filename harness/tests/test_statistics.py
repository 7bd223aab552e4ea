"""Bootstrap intervals, held against SciPy's and against what they promise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import bootstrap, norm, t as student

from harness.statistics import (
    LEAST_OBJECTS,
    MeanEstimate,
    bootstrap_interval,
    mean_estimate,
)


def names(sizes: list[int]) -> np.ndarray:
    """Object of each scene, where object i has sizes[i] of them."""
    return np.repeat([f"mug_{i:02d}" for i in range(len(sizes))], sizes)


def interval(
    values: np.ndarray, *, sizes: list[int] | None = None, **settings: Any
) -> tuple[float, float]:
    objects = names(sizes or [1] * len(values))
    bounds = bootstrap_interval(values, objects=objects, **settings)
    assert bounds is not None
    return bounds


def estimate_of(values: list[float]) -> MeanEstimate:
    return mean_estimate(np.array(values), objects=names([1] * len(values)), seed=0)


@pytest.mark.parametrize("count", [8, 16, 100])
def test_agrees_with_scipys_bca(count: int) -> None:
    values = np.random.default_rng(count).exponential(size=count)
    # Ours widens the normal quantile by Student's, and by the spread that resampling loses.
    wider = float(np.sqrt(count / (count - 1)) * student.ppf(0.975, count - 1))
    theirs = bootstrap(
        (values,),
        np.mean,
        n_resamples=40_000,
        confidence_level=2 * float(norm.cdf(wider)) - 1,
        method="BCa",
        rng=np.random.default_rng(1),
    ).confidence_interval
    ours = interval(values, seed=2, resamples=40_000)
    # Two independent draws of the same quantiles: apart by a small share of the width.
    assert ours == pytest.approx(theirs, abs=0.04 * (theirs.high - theirs.low))


def test_covers_the_true_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    for count in (8, 40):
        hits = 0
        for trial in range(400):
            low, high = interval(rng.normal(3.0, 1.0, size=count), seed=trial, resamples=1000)
            hits += low <= 3.0 <= high
        # Nominal 0.95; binomial standard deviation 0.011, and a point of undercoverage at 8.
        assert 0.91 <= hits / 400 <= 0.98


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


def test_the_scenes_of_an_object_are_drawn_together() -> None:
    # Copies of a scene say nothing new: the interval is that of one scene of each object.
    values = np.random.default_rng(3).normal(size=6)
    assert interval(np.repeat(values, 4), sizes=[4] * 6, seed=0) == pytest.approx(
        interval(values, seed=0)
    )


def test_covers_the_true_mean_of_scenes_that_share_objects() -> None:
    rng = np.random.default_rng(0)
    sizes = [3] * 20
    hits = {"objects": 0, "scenes": 0}
    for trial in range(400):
        # Half of the variance is the object's own.
        values = np.repeat(rng.normal(size=20), 3) + rng.normal(size=60)
        for unit, sizes_of in (("objects", sizes), ("scenes", None)):
            low, high = interval(values, sizes=sizes_of, seed=trial, resamples=1000)
            hits[unit] += low <= 0.0 <= high
    # Nominal 0.95, binomial standard deviation 0.011; scenes taken for independent fall short.
    assert 0.88 <= hits["objects"] / 400 <= 0.97
    assert hits["scenes"] / 400 < 0.86


def test_an_objects_weight_is_its_number_of_scenes() -> None:
    values = np.array([0.0, 0.0, 0.0, 1.0, 0.5, 0.5, 0.2])
    estimate = mean_estimate(values, objects=names([3, 1, 1, 1, 1]), seed=0)
    assert estimate.mean == pytest.approx(2.2 / 7)
    assert estimate.low is not None
    assert estimate.high is not None
    assert 0.0 <= estimate.low < 2.2 / 7 < estimate.high <= 1.0


@pytest.mark.parametrize("scenes", [1, 4])
def test_too_few_objects_have_no_interval(scenes: int) -> None:
    few = [scenes] * (LEAST_OBJECTS - 1)
    values = np.random.default_rng(0).normal(size=sum(few))
    assert bootstrap_interval(values, objects=names(few), seed=0) is None
    estimate = mean_estimate(values, objects=names(few), seed=0)
    assert (estimate.low, estimate.high, estimate.count) == (None, None, sum(few))
    assert estimate.mean == pytest.approx(values.mean())


@pytest.mark.parametrize("values", [[0.5] * 5, [0.1, 0.1 + 1e-17, 0.1 * (1 + 1e-15), 0.1, 0.1]])
def test_equal_values_have_an_interval_without_width(values: list[float]) -> None:
    low, high = interval(np.array(values), seed=0)
    assert low == high == pytest.approx(values[0])


def test_one_outlier_is_no_special_case() -> None:
    low, high = interval(np.array([0.0] * 19 + [1.0]), seed=0)
    assert 0.0 <= low < 0.05 < high <= 1.0


def test_undefined_values_are_left_out_and_counted() -> None:
    estimate = estimate_of([1.0, np.nan, 3.0])
    assert (estimate.mean, estimate.count) == (2.0, 2)
    nothing = estimate_of([np.nan, np.nan])
    assert (nothing.mean, nothing.low, nothing.high, nothing.count) == (None, None, None, 0)
    assert estimate_of([]).count == 0


def test_thousands_of_objects_take_no_more_than_a_moment() -> None:
    values = np.random.default_rng(0).normal(size=3000)
    low, high = interval(values, seed=0)
    half = student.ppf(0.975, 2999) * values.std(ddof=1) / np.sqrt(3000)
    # The quantiles of 1,000 resamples; the indices of 10,000 would fill 240 MB.
    expected = (values.mean() - half, values.mean() + half)
    assert (low, high) == pytest.approx(expected, abs=0.2 * half)
