"""Tests of mean losses against margins: by hand, against scipy, and where the truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from harness.gate.losses import judge_losses
from harness.gate.margins import FLOOR, GATED, LEVEL


def names(*counts: int) -> np.ndarray:
    return np.repeat(np.arange(len(counts)), counts)


def test_with_one_scene_of_each_object_it_is_students_test() -> None:
    rng = np.random.default_rng(0)
    losses = rng.normal(0.1, 1.0, size=(4, 12))
    # So small a margin has no floor to speak of, and is hardly a margin.
    margins = np.full(4, 1e-9)
    found = judge_losses(losses, objects=np.arange(12), margins=margins)
    peer = stats.ttest_1samp(losses, 1e-9, axis=1, alternative="greater").pvalue
    np.testing.assert_allclose(found.q_values, stats.false_discovery_control(peer), rtol=1e-6)
    low, high = stats.t.interval(0.95, 11, losses.mean(axis=1), stats.sem(losses, axis=1))
    np.testing.assert_allclose(found.mean - found.half_width, low)
    np.testing.assert_allclose(found.mean + found.half_width, high)


def test_by_hand_with_a_margin_and_a_floor() -> None:
    losses = np.array([[0.02, 0.04, 0.02, 0.04, 0.03]])
    found = judge_losses(losses, objects=np.arange(5), margins=np.array([0.01]))
    # Standard deviation 0.01, standard error 0.01 / sqrt(5); floor 0.0025.
    scale = np.sqrt(0.01**2 / 5 + (FLOOR * 0.01) ** 2)
    assert found.mean[0] == pytest.approx(0.03)
    assert found.q_values[0] == pytest.approx(stats.t.sf(0.02 / scale, 4))
    reach = stats.t.isf(LEVEL, 4) + stats.t.ppf(0.8, 4)
    assert found.minimum_detectable[0] == pytest.approx(0.01 + reach * scale)
    assert found.worse.tolist() == [True]


def test_more_scenes_of_the_same_objects_that_say_the_same_add_nothing() -> None:
    losses = np.random.default_rng(1).normal(0.02, 0.02, size=(3, 9))
    margins = np.full(3, 0.01)
    once = judge_losses(losses, objects=np.arange(9), margins=margins)
    thrice = judge_losses(
        np.repeat(losses, 3, axis=1), objects=np.repeat(np.arange(9), 3), margins=margins
    )
    np.testing.assert_allclose(thrice.q_values, once.q_values)
    assert thrice.objects.tolist() == [9] * 3
    assert thrice.scenes.tolist() == [27] * 3


def test_answers_without_spread_are_judged_by_the_margin() -> None:
    losses = np.array([[0.0] * 8, [0.009] * 8, [0.02] * 8, [-0.5] * 8])
    found = judge_losses(losses, objects=np.arange(8), margins=np.full(4, 0.01))
    assert found.worse.tolist() == [False, False, True, False]
    assert found.half_width == pytest.approx(0.0, abs=1e-12)


def test_undefined_scenes_are_left_out_and_few_objects_are_not_judged() -> None:
    losses = np.full((3, 8), 0.5)
    losses[0, :2] = np.nan
    losses[1, :4] = np.nan
    losses[2] = np.nan
    found = judge_losses(losses, objects=np.arange(8), margins=np.full(3, 0.01))
    assert found.scenes.tolist() == [6, 4, 0]
    assert found.judged.tolist() == [True, False, False]
    assert found.worse.tolist() == [True, False, False]
    assert np.isnan(found.q_values).tolist() == [False, True, True]
    assert np.isnan(found.mean).tolist() == [False, False, True]


def test_the_level_holds_where_the_loss_is_the_margin() -> None:
    rng = np.random.default_rng(2)
    objects = names(2, 2, 2, 2, 1, 1, 1, 1, 1, 1)
    failed = 0
    for _ in range(1500):
        # What objects share is as large as what scenes have of their own.
        losses = 0.01 + rng.normal(0, 0.02, 10)[objects] + rng.normal(0, 0.02, objects.size)
        tests = judge_losses(losses[np.newaxis], objects=objects, margins=np.array([0.01]))
        failed += int(tests.worse[0])
    assert 0.03 < failed / 1500 < 0.07


def test_what_is_said_to_be_detectable_is_found_four_times_in_five() -> None:
    rng = np.random.default_rng(3)
    found = 0
    margin, spread = 0.01, 0.05
    typical = judge_losses(
        stats.norm.ppf((np.arange(16) + 0.5) / 16)[np.newaxis] * spread,
        objects=np.arange(16),
        margins=np.array([margin]),
    ).minimum_detectable[0]
    for _ in range(1000):
        losses = rng.normal(typical, spread, size=(1, 16))
        tests = judge_losses(losses, objects=np.arange(16), margins=np.array([margin]))
        found += int(tests.worse[0])
    assert 0.74 < found / 1000 < 0.88


def test_every_margin_is_a_small_positive_share_of_what_shall_be_caught() -> None:
    assert len({metric.key for metric in GATED}) == len(GATED)
    assert all(0 < metric.margin <= 0.01 for metric in GATED)
