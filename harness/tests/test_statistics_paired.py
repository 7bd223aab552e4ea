"""Paired tests: worked by hand, held against SciPy's, and against what they promise."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.stats import permutation_test, t as student, ttest_1samp

from harness.benchmarks.statistics_check import Design
from harness.statistics import (
    ALPHA,
    LEAST_OBJECTS,
    PairedTest,
    benjamini_hochberg,
    bootstrap_interval,
    paired_test,
)
from harness.statistics.paired import EXACT_OBJECTS, attainable_level
from harness.tests.test_statistics import names

if TYPE_CHECKING:
    from harness.statistics.paired import Alternative

ALTERNATIVES: tuple[Alternative, ...] = ("two-sided", "less", "greater")


def outcome(values: Any, *, sizes: list[int] | None = None, **settings: Any) -> PairedTest:
    objects = names(sizes or [1] * len(values))
    return paired_test(np.array(values, dtype=np.float64), objects=objects, seed=0, **settings)


def test_every_change_of_signs_is_counted() -> None:
    # The observed sum is 1+2+3+4+5+6 less twice the 1: 19. Of the 64 sums, those that lack at most
    # 1 of 21 are as far out: no minus, the 1 alone, and their mirror images.
    found = outcome([-1, 2, 3, 4, 5, 6])
    assert found.p_value == 4 / 64
    assert outcome([-1, 2, 3, 4, 5, 6], alternative="greater").p_value == 2 / 64
    assert outcome([-1, 2, 3, 4, 5, 6], alternative="less").p_value == 63 / 64
    assert (found.mean, found.scenes, found.objects) == (19 / 6, 6, 6)


@pytest.mark.parametrize("alternative", ALTERNATIVES)
@pytest.mark.parametrize("count", [8, 12])
def test_agrees_with_scipys_permutation_test(count: int, alternative: Alternative) -> None:
    values = np.random.default_rng(count).normal(0.4, 1.0, size=count)
    theirs = permutation_test(
        (values,), np.sum, permutation_type="samples", n_resamples=1 << 13, alternative=alternative
    )
    assert outcome(values, alternative=alternative).p_value == pytest.approx(theirs.pvalue)


@pytest.mark.parametrize("alternative", ALTERNATIVES)
def test_random_changes_of_signs_agree_with_all_of_them(alternative: Alternative) -> None:
    # An object of zeros changes nothing, but makes too many objects to go through.
    values = np.random.default_rng(5).normal(0.3, 1.0, size=EXACT_OBJECTS)
    exact = outcome(values, alternative=alternative).p_value
    padded = np.append(values, 0.0)
    drawn = outcome(padded, alternative=alternative).p_value
    assert exact is not None
    # Four standard deviations of a share of 10,000.
    assert drawn == pytest.approx(exact, abs=4 * math.sqrt(exact * (1 - exact) / 10_000))
    assert drawn == outcome(padded, alternative=alternative).p_value


def test_thousands_of_objects_are_tested_as_students_t_would() -> None:
    values = np.random.default_rng(0).normal(0.06, 1.0, size=3000)
    p_value = outcome(values).p_value
    expected = ttest_1samp(values, 0.0).pvalue
    assert 0.02 < expected < 0.2
    # Five standard deviations of a share of 2,048.
    assert p_value == pytest.approx(expected, abs=5 * math.sqrt(expected / 2048))


def test_random_changes_never_make_a_p_value_of_zero() -> None:
    assert outcome(np.arange(1.0, 30.0)).p_value == 1 / 10_001


def test_the_scenes_of_an_object_change_sign_together() -> None:
    values = np.random.default_rng(3).normal(1.0, 1.0, size=8)
    once, copied = outcome(values), outcome(np.repeat(values, 4), sizes=[4] * 8)
    assert copied.p_value == once.p_value
    assert copied.effect_size == pytest.approx(once.effect_size)
    assert copied.minimum_detectable == pytest.approx(once.minimum_detectable)
    assert (copied.scenes, copied.objects) == (32, 8)
    assert once.p_value is not None
    alone = outcome(np.repeat(values, 4)).p_value
    assert alone is not None
    assert alone < once.p_value / 4


def test_the_interval_is_that_of_the_means() -> None:
    values = np.random.default_rng(4).normal(size=9)
    found = outcome(values, margin=0.3)
    assert (found.low, found.high) == bootstrap_interval(values, objects=names([1] * 9), seed=0)


def test_a_margin_moves_the_null_hypothesis() -> None:
    values = np.random.default_rng(6).normal(size=10)
    for alternative in ALTERNATIVES:
        moved = outcome(values, margin=-0.02, alternative=alternative)
        plain = outcome(values + 0.02, alternative=alternative)
        assert moved.p_value == plain.p_value
        assert moved.minimum_detectable == pytest.approx(plain.minimum_detectable)
    assert outcome(values, margin=-0.02).mean == values.mean()


@pytest.mark.parametrize("alternative", ALTERNATIVES)
def test_swapping_the_sides_mirrors_the_test(alternative: Alternative) -> None:
    values = np.random.default_rng(7).normal(0.4, 1.0, size=10)
    mirror: dict[str, Alternative] = {"less": "greater", "greater": "less"}
    ours = outcome(values, margin=0.1, alternative=alternative)
    theirs = outcome(-values, margin=-0.1, alternative=mirror.get(alternative, alternative))
    assert ours.p_value == theirs.p_value
    assert theirs.mean is not None
    assert theirs.effect_size is not None
    assert (ours.mean, ours.effect_size) == pytest.approx((-theirs.mean, -theirs.effect_size))
    assert ours.minimum_detectable == pytest.approx(theirs.minimum_detectable)


def test_the_effect_size_is_hedges_g() -> None:
    # Means 1 to 6: mean 3.5, standard deviation sqrt(3.5); with 5 degrees of freedom the
    # correction is Gamma(2.5) / (sqrt(2.5) Gamma(2)) = 0.8408.
    found = outcome([1, 2, 3, 4, 5, 6])
    assert found.effect_size == pytest.approx(3.5 / math.sqrt(3.5) * 0.84075, rel=1e-4)
    # An object's weight is one, however many scenes it has.
    assert outcome([1, 1, 1, 2, 3, 4, 5, 6], sizes=[3, 1, 1, 1, 1, 1]).effect_size == pytest.approx(
        found.effect_size
    )


def test_the_minimum_detectable_difference_is_quantiles_of_t_times_the_standard_error() -> None:
    values = np.array([0.1, 0.2, 0.0, 0.3, 0.1, 0.4, 0.2, 0.5])
    error = values.std(ddof=1) / math.sqrt(8)
    # Of 256 sums, 12 on two sides are the most below 5 %; 12 on one side too.
    for alternative, tail in (("two-sided", 12 / 256 / 2), ("less", 12 / 256)):
        expected = (student.ppf(1 - tail, 7) + student.ppf(0.8, 7)) * error
        found = outcome(values, alternative=alternative)
        assert found.minimum_detectable == pytest.approx(expected)


@pytest.mark.parametrize(
    ("objects", "level"), [(5, 0.0), (6, 2 / 64), (7, 6 / 128), (16, 3276 / 65536), (17, ALPHA)]
)
def test_the_level_that_changes_of_signs_attain(objects: int, level: float) -> None:
    assert attainable_level(objects, alternative="two-sided") == level


@pytest.mark.parametrize(("alternative", "enough"), [("two-sided", 6), ("less", 5)])
def test_too_few_objects_are_not_tested(alternative: Alternative, enough: int) -> None:
    values = -np.arange(1.0, enough + 1)
    found = outcome(values, alternative=alternative)
    assert found.p_value is not None
    assert found.p_value <= ALPHA
    assert found.minimum_detectable is not None
    fewer = outcome(values[:-1], alternative=alternative)
    assert (fewer.p_value, fewer.minimum_detectable) == (None, None)
    assert fewer.mean == values[:-1].mean()


def test_few_objects_have_a_mean_and_no_interval() -> None:
    few = outcome([0.1, 0.2] * (LEAST_OBJECTS - 1), sizes=[2] * (LEAST_OBJECTS - 1))
    assert few.mean == pytest.approx(0.15)
    assert (few.low, few.high, few.p_value, few.effect_size) == (None, None, None, None)


@pytest.mark.parametrize("count", [1, 3, 8, 40])
def test_identical_runs_do_not_differ(count: int) -> None:
    found = outcome([0.0] * count)
    assert (found.mean, found.p_value) == (0.0, 1.0)
    if count >= 6:
        assert (found.low, found.high) == (0.0, 0.0)
        assert (found.effect_size, found.minimum_detectable) == (0.0, 0.0)
    else:
        assert found.minimum_detectable is None


def test_the_same_difference_everywhere_has_no_spread() -> None:
    found = outcome([0.1 + 1e-17, 0.1 * (1 + 1e-15)] + [0.1] * 8)
    assert found.p_value == 2 / 1024
    assert (found.effect_size, found.minimum_detectable) == (None, 0.0)
    assert outcome([0.3 - 0.2] * 6, margin=0.1).p_value == 1.0


def test_undefined_differences_are_dropped() -> None:
    found = outcome([0.1, np.nan, 0.3, np.nan], sizes=[2, 1, 1])
    assert (found.mean, found.scenes, found.objects) == (0.2, 2, 2)
    nothing = outcome([np.nan, np.nan])
    assert nothing == PairedTest(None, None, None, None, None, None, scenes=0, objects=0)
    assert outcome([]) == nothing


def test_what_is_no_series_of_differences_is_refused() -> None:
    with pytest.raises(ValueError, match="differences holds an infinite value"):
        outcome([0.1, np.inf])
    with pytest.raises(ValueError, match=r"differences has shape \(2,\) and objects \(3,\)"):
        paired_test(np.zeros(2), objects=names([3]), seed=0)


def test_a_minimum_detectable_difference_is_found_eight_times_in_ten() -> None:
    rng = np.random.default_rng(0)
    sizes = [3] * 10
    # Half of the variance is the object's own: the mean's is (1 + 1 / 3) / 10.
    errors, found = [], 0
    quantiles = student.ppf(1 - 48 / 1024 / 2, 9) + student.ppf(0.8, 9)
    difference = quantiles * math.sqrt((1 + 1 / 3) / 10)
    for _ in range(400):
        noise = np.repeat(rng.normal(size=10), 3) + rng.normal(size=30)
        result = outcome(noise + difference, sizes=sizes)
        assert result.p_value is not None
        assert result.minimum_detectable is not None
        found += result.p_value <= ALPHA
        errors.append(result.minimum_detectable)
    # Binomial standard deviation 0.02.
    assert found / 400 == pytest.approx(0.8, abs=0.06)
    assert np.mean(errors) == pytest.approx(difference, rel=0.05)


def test_a_true_null_is_rejected_no_more_often_than_it_says() -> None:
    rng = np.random.default_rng(1)
    rejected = {"objects": 0, "scenes": 0}
    for _ in range(400):
        values = np.repeat(rng.normal(size=8), 4) + rng.normal(size=32)
        for unit, sizes in (("objects", [4] * 8), ("scenes", None)):
            p_value = outcome(values, sizes=sizes).p_value
            assert p_value is not None
            rejected[unit] += p_value <= ALPHA
    # Binomial standard deviation 0.011; scenes taken for independent reject far too often.
    assert rejected["objects"] / 400 <= 0.08
    assert rejected["scenes"] / 400 >= 0.15


def test_the_standard_error_of_a_simulated_design() -> None:
    # Objects of 3 and 2 scenes: (0.5 (9 + 4) + 0.5 (3 + 2)) / 25 = 0.36.
    design = Design.of(2, icc=0.5)
    assert design.standard_error == pytest.approx(0.6)
    means = design.draw(4000, kind="exponential", rng=np.random.default_rng(0)).mean(axis=1)
    assert means.std() == pytest.approx(0.6, rel=0.1)
    assert means.mean() == pytest.approx(0.0, abs=0.05)
    np.testing.assert_array_equal(design.totals(np.arange(5.0)[np.newaxis]), [[3.0, 7.0]])


# --- families ---


def test_benjamini_hochberg_by_hand() -> None:
    # Sorted: .01 x 4/1, .02 x 4/2, .03 x 4/3, .5 x 4/4, and the least of what follows.
    q_values = benjamini_hochberg(np.array([0.03, 0.01, np.nan, 0.5, 0.02]))
    np.testing.assert_allclose(q_values, [0.04, 0.04, np.nan, 0.5, 0.04])


def test_undefined_tests_are_not_of_the_family() -> None:
    assert np.isnan(benjamini_hochberg(np.array([np.nan, np.nan]))).all()
    assert benjamini_hochberg(np.array([])).size == 0
    np.testing.assert_allclose(benjamini_hochberg(np.array([np.nan, 0.03]))[1], 0.03)


def test_benjamini_hochberg_rejects_by_its_definition() -> None:
    rng = np.random.default_rng(2)
    for size, share in itertools.product((1, 7, 40), (0.01, 0.05, 0.2)):
        p_values = rng.uniform(size=size) ** 3
        ordered = np.sort(p_values)
        passing = np.flatnonzero(ordered <= share * np.arange(1, size + 1) / size)
        bound = ordered[passing[-1]] if passing.size else -1.0
        np.testing.assert_array_equal(benjamini_hochberg(p_values) <= share, p_values <= bound)


def test_what_is_no_p_value_is_refused() -> None:
    with pytest.raises(ValueError, match=r"\[0, 1\]|between 0 and 1"):
        benjamini_hochberg(np.array([0.1, 1.2]))
