"""What a record says of predictions, worked out by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.scene_run import category_probability, score

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
        "clamped_share": 0.0,
        "jitter": 0.0,
        "fits_unconverged": 2,
        "fits_at_bound": 1,
        "hyperparameters": dict.fromkeys(("free", "bowl", "mug"), process),
    }
    return SimpleNamespace(**fields | change)


def record(**change: Any) -> Record:
    training: Any = SimpleNamespace(classes=np.array([0, 0, 0, 6, 6, 2], dtype=np.uint8))
    target: Any = SimpleNamespace(category="mug")
    return score(
        predictions(**change),
        truth=TRUTH,
        data_distance_m=np.array([0.0, 0.03, 0.01, 0.02]),
        target=target,
        training=training,
        identity={
            "scene_id": "mug-0000",
            "category": "mug",
            "object_name": "mug_0",
            "seed": 1,
            "model": "classic",
            "completion": "none",
            "segmenter": "oracle",
            "views": 3,
            "tolerance_m": 0.005,
        },
    )


def test_the_raw_probability_is_calibrated_and_the_confidence_ranks_decisions() -> None:
    found = record()
    assert (found.tp, found.tn, found.fp, found.fn) == (1, 1, 1, 1)
    assert found.auroc == 0.75
    assert found.brier == pytest.approx((0.2**2 + 0.6**2 + 0.2**2 + 0.7**2) / 4)
    assert found.nll == pytest.approx(-np.log([0.8, 0.4, 0.8, 0.3]).mean())
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
    change = {
        "class_names": ["free", "bowl"],
        "classes": np.array([2, 2, 0, 2], dtype=np.uint8),
        "probabilities": PROBABILITIES[:, :2],
        "hyperparameters": dict.fromkeys(
            ("free", "bowl"), SimpleNamespace(lengthscale_m=0.02, outputscale=3.0)
        ),
    }
    assert category_probability(predictions(**change), "mug").tolist() == [0.0] * 4
    found = record(**change)
    assert (found.brier, found.auroc, found.lengthscale_m) == (0.5, 0.5, None)
