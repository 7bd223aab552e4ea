"""Calibration errors: by hand, and as the score crate computes them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from harness.native import binary_metrics
from harness.segmentation.calibration import (
    brier,
    calibration_error,
    equal_mass,
    equal_width,
    reliability,
)

ONCE = np.ones((1, 200))


@pytest.mark.parametrize("seed", range(4))
def test_errors_are_those_of_the_score_crate(seed: int) -> None:
    random = np.random.default_rng(seed)
    # Few values, so that there are ties.
    scores = random.integers(0, 41, size=200) / 40
    right = random.random(200) < scores**2
    theirs = binary_metrics(predicted=scores > 0.5, truth=right, probability=scores)
    for key, bins in (("ece", equal_width(scores)), ("ece_equal_mass", equal_mass(scores))):
        assert calibration_error(scores, right, bins, ONCE) == pytest.approx(theirs[key])
    assert brier(scores, right, ONCE) == pytest.approx(theirs["brier"])


def test_a_score_that_keeps_its_word_has_no_error() -> None:
    scores, right = np.full(4, 0.75), np.array([True, True, True, False])
    weights = np.array([[1.0, 1, 1, 1], [0, 0, 0, 0], [1, 0, 0, 3]])
    errors = calibration_error(scores, right, equal_width(scores), weights)
    assert errors[[0, 2]] == pytest.approx([0.0, 0.5])
    assert np.isnan(errors[1])
    assert brier(scores, right, weights)[0] == pytest.approx(0.1875)
    assert np.isnan(brier(scores, right, weights)[1])


def test_no_detection_has_no_error() -> None:
    none, flags = np.zeros(0), np.zeros(0, dtype=bool)
    for bins in (equal_width(none), equal_mass(none)):
        assert np.isnan(calibration_error(none, flags, bins, np.zeros((2, 0)))).all()
    assert reliability(none, flags) == ()


def test_bins_of_the_diagram_hold_every_detection_once() -> None:
    scores = np.array([0.0, 0.01, 0.5, 0.99, 1.0])
    assert_array_equal(equal_width(scores), [0, 0, 7, 14, 14])
    bins = reliability(scores, np.array([False, True, True, True, False]))
    assert [(item.count, item.share_right) for item in bins] == [(2, 0.5), (1, 1.0), (2, 0.5)]
    assert [item.mean_score for item in bins] == pytest.approx([0.005, 0.5, 0.995])
