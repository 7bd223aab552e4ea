"""Calibration metrics on arrays: by hand, and against scikit-learn and the extension."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.calibration import calibration_curve  # type: ignore[import-untyped]
from sklearn.metrics import brier_score_loss, log_loss  # type: ignore[import-untyped]

from harness.calibration import (
    brier_parts,
    negative_log_likelihood,
    precision_at,
    reliability,
    risk_at,
    risk_coverage,
)
from harness.native import binary_metrics

NOTHING = np.zeros(0)
NO_TRUTH = np.zeros(0, dtype=bool)


def some_points(seed: int, *, ties: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probabilities, truths that follow them, and predictions."""
    rng = np.random.default_rng(seed)
    probability = rng.beta(0.5, 0.7, size=400)
    if ties:
        probability = np.round(probability, 1)
    truth = rng.uniform(size=400) < probability**1.3
    return probability, truth, rng.uniform(size=400) < probability


def test_equal_widths_by_hand() -> None:
    probability = np.array([0.0, 0.4, 0.5, 0.9, 1.0])
    truth = np.array([False, True, False, True, True])
    found = reliability(probability, truth, bins=2)
    assert_array_equal(found.edges, [0.0, 0.5, 1.0])
    assert_array_equal(found.counts, [2, 3])
    assert_allclose(found.mean_predicted, [0.2, 0.8])
    assert_allclose(found.observed, [0.5, 2 / 3])
    assert found.calibration_error == pytest.approx((2 * 0.3 + 3 * (0.8 - 2 / 3)) / 5)


def test_equal_masses_by_hand() -> None:
    probability = np.array([0.3, 0.1, 0.3, 0.3, 0.9, 0.95])
    truth = np.array([True, False, True, False, True, True])
    # The tie's middle is the second half point of six: it lies in the first of two bins.
    found = reliability(probability, truth, bins=2, equal_mass=True)
    assert_array_equal(found.counts, [4, 2])
    assert_allclose(found.edges, [0.0, 0.6, 1.0])
    assert_allclose(found.mean_predicted, [0.25, 0.925])
    assert_allclose(found.observed, [0.5, 1.0])


def test_an_empty_bin_has_a_count_and_no_mean() -> None:
    found = reliability(np.array([0.1, 0.9]), np.array([False, True]), bins=3)
    assert_array_equal(found.counts, [1, 0, 1])
    assert np.isnan(found.mean_predicted[1])
    assert np.isnan(found.observed[1])
    assert found.calibration_error == pytest.approx(0.1)
    # One tie in 15 bins of equal mass: the others have no width.
    tied = reliability(np.full(9, 0.3), np.full(9, True), equal_mass=True)
    assert_array_equal(tied.counts, [0] * 7 + [9] + [0] * 7)
    assert_array_equal(tied.edges, [0.0] * 8 + [1.0] * 8)


def test_brier_parts_by_hand() -> None:
    parts = brier_parts(np.array([0.2, 0.4, 0.9]), np.array([False, True, True]), bins=2)
    assert parts is not None
    # Bins .3 against 1/2 (two points) and .9 against 1; two of three came true.
    assert parts.brier == pytest.approx((0.04 + 0.36 + 0.01) / 3)
    assert parts.reliability == pytest.approx((2 * 0.04 + 0.01) / 3)
    assert parts.resolution == pytest.approx((2 / 36 + 1 / 9) / 3)
    assert parts.uncertainty == pytest.approx(2 / 9)
    assert parts.within_variance == pytest.approx(2 * 0.01 / 3)
    assert parts.within_covariance == pytest.approx(2 * (0.05 + 0.05) / 3)


@pytest.mark.parametrize("equal_mass", [False, True])
@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_brier_is_the_sum_of_its_parts(seed: int, *, ties: bool, equal_mass: bool) -> None:
    probability, truth, _ = some_points(seed, ties=ties)
    parts = brier_parts(probability, truth, equal_mass=equal_mass)
    assert parts is not None
    murphy = parts.reliability - parts.resolution + parts.uncertainty
    within = parts.within_variance - parts.within_covariance
    assert murphy + within == pytest.approx(parts.brier, abs=1e-14)
    # Eleven values in 15 bins of equal width: each bin holds one, and Murphy's parts are all.
    if ties and not equal_mass:
        assert within == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_scikit_learn_agrees(seed: int) -> None:
    probability, truth, _ = some_points(seed, ties=False)
    diagram = reliability(probability, truth, bins=10)
    observed, predicted = calibration_curve(truth, probability, n_bins=10)
    assert_allclose(diagram.observed, observed)
    assert_allclose(diagram.mean_predicted, predicted)
    observed, predicted = calibration_curve(truth, probability, n_bins=10, strategy="quantile")
    of_mass = reliability(probability, truth, bins=10, equal_mass=True)
    assert_allclose(of_mass.observed, observed)
    assert_allclose(of_mass.mean_predicted, predicted)
    parts = brier_parts(probability, truth)
    assert parts is not None
    assert parts.brier == pytest.approx(brier_score_loss(truth, probability))
    assert negative_log_likelihood(probability, truth) == pytest.approx(
        log_loss(truth, probability)
    )


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_the_extension_agrees(seed: int, *, ties: bool) -> None:
    probability, truth, predicted = some_points(seed, ties=ties)
    ranking = np.where(predicted, probability, 1.0 - probability)
    theirs = binary_metrics(
        predicted=predicted, truth=truth, probability=probability, decision_confidence=ranking
    )
    parts = brier_parts(probability, truth)
    assert parts is not None
    curve = risk_coverage(ranking, predicted != truth)
    at = np.array([0.5, 0.8])
    risks = risk_at(curve, at)
    precisions = precision_at(ranking, predicted=predicted, truth=truth, coverages=at)
    ours = {
        "ece": reliability(probability, truth).calibration_error,
        "ece_equal_mass": reliability(probability, truth, equal_mass=True).calibration_error,
        "brier": parts.brier,
        "nll": negative_log_likelihood(probability, truth),
        "aurc": curve.aurc,
        "excess_aurc": curve.excess_aurc,
        "random_aurc": risk_coverage(np.zeros(len(truth)), predicted != truth).aurc,
        "risk_at_50": risks[0],
        "risk_at_80": risks[1],
        "precision_at_50": precisions[0],
        "precision_at_80": precisions[1],
    }
    for name, value in ours.items():
        assert value == pytest.approx(theirs[name], abs=1e-12), name


def test_risk_grows_as_errors_come_in() -> None:
    # Falling confidence: right, wrong, right, wrong.
    curve = risk_coverage(np.array([0.2, 0.9, 0.4, 0.3]), np.array([True, False, True, False]))
    assert_allclose(curve.coverage, [0.25, 0.5, 0.75, 1.0])
    assert_allclose(curve.risk, [0.0, 0.5, 1 / 3, 0.5])
    assert curve.aurc == pytest.approx(1 / 3)
    # Best order: 0, 0, 1/3, 1/2.
    assert curve.excess_aurc == pytest.approx(1 / 3 - 5 / 24)


def test_ties_take_their_mean_risk_over_orders() -> None:
    confidence = np.array([0.9, 0.5, 0.5, 0.5, 0.1])
    wrong = np.array([False, True, False, False, True])
    curve = risk_coverage(confidence, wrong)
    # In the tie each place is wrong one time in three.
    assert_allclose(curve.risk, [0, 1 / 3 / 2, 2 / 3 / 3, 1 / 4, 2 / 5])
    shuffled = risk_coverage(confidence[[0, 2, 1, 3, 4]], wrong[[0, 2, 1, 3, 4]])
    assert_array_equal(curve.risk, shuffled.risk)
    assert_array_equal(risk_coverage(np.array([0.0, -0.0]), wrong[:2]).risk, [0.5, 0.5])


def test_the_best_order_has_no_excess_and_no_order_beats_it() -> None:
    rng = np.random.default_rng(0)
    wrong = rng.uniform(size=50) < 0.3
    best = risk_coverage(-wrong.astype(float), wrong)
    assert best.excess_aurc == pytest.approx(0.0, abs=1e-15)
    assert best.aurc is not None
    for _ in range(20):
        assert (risk_coverage(rng.uniform(size=50), wrong).aurc or 0.0) > best.aurc


def test_a_coverage_is_rounded_up_to_whole_points() -> None:
    wrong = np.arange(100) >= 55
    curve = risk_coverage(-np.arange(100.0), wrong)
    # .55 * 100 is 55.00000000000001 in float64, which keeps 55.
    assert_allclose(risk_at(curve, np.array([1e-9, 0.55, 0.555, 1.0])), [0, 0, 1 / 56, 0.45])


def test_nothing_to_judge_has_no_value() -> None:
    assert reliability(NOTHING, NO_TRUTH).calibration_error is None
    assert reliability(NOTHING, NO_TRUTH, equal_mass=True).calibration_error is None
    assert brier_parts(NOTHING, NO_TRUTH) is None
    assert negative_log_likelihood(NOTHING, NO_TRUTH) is None
    curve = risk_coverage(NOTHING, NO_TRUTH)
    assert curve.aurc is None
    assert curve.excess_aurc is None
    at = np.array([0.5])
    assert np.isnan(risk_at(curve, at))
    none = np.zeros(3, dtype=bool)
    assert np.isnan(precision_at(np.ones(3), predicted=none, truth=~none, coverages=at))


def test_what_makes_no_sense_is_refused() -> None:
    truth = np.array([True, False])
    with pytest.raises(ValueError, match=r"probability\[1\] is 1\.5; it must lie in \[0, 1\]"):
        reliability(np.array([0.5, 1.5]), truth)
    with pytest.raises(ValueError, match=r"probability\[0\] is nan"):
        negative_log_likelihood(np.array([np.nan, 0.5]), truth)
    with pytest.raises(ValueError, match=r"shape \(1,\) and truth \(2,\)"):
        brier_parts(np.array([0.5]), truth)
    with pytest.raises(ValueError, match="bins is 0"):
        reliability(np.array([0.5, 0.5]), truth, bins=0)
    with pytest.raises(ValueError, match=r"confidence_of_decision\[1\] is inf"):
        risk_coverage(np.array([0.5, np.inf]), truth)
    with pytest.raises(ValueError, match=r"shape \(1,\) and wrong \(2,\)"):
        risk_coverage(np.array([0.5]), truth)
    for coverage in (0.0, 1.1, np.nan):
        with pytest.raises(ValueError, match=r"must lie in \(0, 1\]"):
            risk_at(risk_coverage(np.ones(2), truth), np.array([coverage]))
