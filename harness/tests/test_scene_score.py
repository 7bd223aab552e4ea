"""What a record says of predictions, worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.scoring import Answers, confusion, log_loss, score

if TYPE_CHECKING:
    from harness.runs.records import Record

# The last point is a mug's that is taken for a bowl's, the second a free one taken for a mug's.
TRUTH = np.array([True, False, False, True])
PROBABILITIES = np.array([[0.1, 0.1, 0.8], [0.3, 0.1, 0.6], [0.7, 0.1, 0.2], [0.1, 0.6, 0.3]])
SEGMENTER_SCORE = 0.5


def predictions(**change: Any) -> Any:
    process = SimpleNamespace(lengthscale_m=0.02, outputscale=3.0)
    fields = {
        "class_names": ["free", "bowl", "mug"],
        "classes": np.array([6, 6, 0, 2], dtype=np.uint8),
        "probabilities": PROBABILITIES,
        "confidence": SEGMENTER_SCORE * PROBABILITIES[:, 2],
        "score": np.array([0.1, 0.2, 0.3, 0.4]),
        "clamped": np.array([False, True, False, False]),
        "gate": 1.0,
        "ood": None,
        "jitter": 0.0,
        "fits_unconverged": 2,
        "fits_at_bound": 1,
        "hyperparameters": dict.fromkeys(("free", "bowl", "mug"), process),
    }
    return SimpleNamespace(**fields | change)


IDENTITY = {"scene_id": "mug-0000", "model": "classic", "completion": "none", "tolerance_m": 0.005}


def record(*, mapped_as: str = "mug", part: slice = slice(None), **change: Any) -> Record:
    training: Any = SimpleNamespace(classes=np.array([0, 0, 0, 6, 6, 2], dtype=np.uint8))
    target: Any = SimpleNamespace(category="mug")
    item: Any = SimpleNamespace(category=mapped_as, score=SEGMENTER_SCORE)
    return score(
        Answers(predictions(**change), part),
        truth=TRUTH[part],
        data_distance_m=np.array([0.0, 0.03, 0.01, 0.02])[part],
        target=target,
        item=item,
        training=training,
        identity={
            **IDENTITY,
            "category": "mug",
            "object_name": "mug_0",
            "seed": 1,
            "segmenter": "oracle",
            "views": 3,
        },
    )


def test_the_raw_probability_is_calibrated_and_the_confidence_ranks_decisions() -> None:
    found = record()
    assert (found.tp, found.tn, found.fp, found.fn) == (1, 1, 1, 1)
    assert found.auroc == 0.75
    assert found.brier == pytest.approx((0.2**2 + 0.6**2 + 0.2**2 + 0.7**2) / 4)
    assert found.nll == pytest.approx(-np.log([0.8, 0.4, 0.8, 0.3]).mean())
    assert found.log_loss == pytest.approx(found.nll)
    assert found.base_rate == 0.5
    # Halved by the segmenter, the confidences in the decisions are .4, .3, .9 and .85.
    assert found.aurc == pytest.approx((0 + 1 / 2 + 1 / 3 + 1 / 2) / 4)


def test_the_baselines_rank_the_same_decisions() -> None:
    found = record()
    assert found.random_aurc == 0.5
    # Nearest to the data are the two right decisions.
    assert found.nearest_aurc == pytest.approx((0 + 0 + 1 / 3 + 1 / 2) / 4)
    assert found.score_aurc == pytest.approx((1 + 1 / 2 + 2 / 3 + 1 / 2) / 4)


def test_neighbours_are_not_counted_among_the_targets_training_points() -> None:
    found = record()
    assert (found.object_training_points, found.free_training_points) == (2, 3)
    assert (found.fits_unconverged, found.fits_at_bound) == (2, 1)


def test_a_category_that_the_classifier_does_not_know_has_no_probability() -> None:
    change: dict[str, Any] = {
        "class_names": ["free", "bowl"],
        "classes": np.array([2, 2, 0, 2], dtype=np.uint8),
        "probabilities": PROBABILITIES[:, :2],
        "hyperparameters": dict.fromkeys(
            ("free", "bowl"), SimpleNamespace(lengthscale_m=0.02, outputscale=3.0)
        ),
    }
    answers = Answers(predictions(**change), slice(None))
    assert answers.probability("mug").tolist() == [0.0] * 4
    found = record(**change)
    assert (found.brier, found.auroc, found.lengthscale_m) == (0.5, 0.5, None)


def test_the_recalibrated_probability_is_the_confidence_without_the_segmenter() -> None:
    recalibrated = np.array([0.9, 0.2, 0.1, 0.6])
    found = record(confidence=SEGMENTER_SCORE * recalibrated)
    # Four points in four bins, each as far from its truth as its probability.
    assert found.ece_recalibrated == pytest.approx((0.1 + 0.2 + 0.1 + 0.4) / 4)
    assert found.brier_recalibrated == pytest.approx((0.01 + 0.04 + 0.01 + 0.16) / 4)
    assert found.ece == pytest.approx((0.2 + 0.6 + 0.2 + 0.7) / 4)
    wrong = record(confidence=SEGMENTER_SCORE * recalibrated, mapped_as="bowl")
    assert (wrong.ece_recalibrated, wrong.brier_recalibrated) == (None, None)
    answers = Answers(predictions(), slice(None))
    sure: Any = SimpleNamespace(category="mug", score=0.0)
    assert answers.recalibrated(sure) is None


def test_a_test_set_is_scored_by_its_own_points() -> None:
    found = record(part=slice(0, 2))
    assert (found.tp, found.tn, found.fp, found.fn, found.test_points) == (1, 0, 1, 0, 2)
    assert found.brier == pytest.approx((0.2**2 + 0.6**2) / 2)
    assert (found.clamped_share, record(part=slice(2, 4)).clamped_share) == (0.5, 0.0)
    assert record().clamped_share == 0.25


def test_a_model_without_processes_has_no_hyperparameters() -> None:
    found = record(hyperparameters={}, gate=0.25, ood=1.5)
    assert (found.lengthscale_m, found.outputscale) == (None, None)
    assert (found.lengthscale_free_m, found.outputscale_free) == (None, None)
    assert (found.gate, found.ood) == (0.25, 1.5)


def test_the_log_loss_of_a_certain_error_is_finite() -> None:
    sure = np.array([0.0, 1.0])
    assert log_loss(sure, np.array([True, False])) == pytest.approx(6 * np.log(10))
    assert log_loss(sure, np.array([False, True])) == pytest.approx(1e-6, rel=1e-3)
    assert log_loss(np.zeros(0), np.zeros(0, dtype=bool)) is None


def test_confusion_counts_by_true_and_predicted_category() -> None:
    true = np.array(["mug", "free", "free", "mug"])
    found = confusion(Answers(predictions(), slice(None)), true=true, identity=IDENTITY)
    assert {(row.true, row.predicted): row.points for row in found} == {
        ("mug", "mug"): 1,
        ("free", "mug"): 1,
        ("free", "free"): 1,
        ("mug", "bowl"): 1,
    }
    part = confusion(Answers(predictions(), slice(0, 1)), true=true[:1], identity=IDENTITY)
    assert [(row.true, row.predicted, row.points) for row in part] == [("mug", "mug", 1)]
