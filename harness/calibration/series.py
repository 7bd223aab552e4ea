"""The scores of a scene's points that are held against the truth, and the baselines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.native import CLASS_NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.recordings.recording import ModelAnswers, Recording

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

SERIES = {
    "raw_score": "the seed's Eq. 2, read as the probability that the decision is right",
    "normalised_score": "the seed's Eq. 3 times the segmenter's score, read likewise",
    "probability": "the classifier's, of the target's category",
    "recalibrated": "the probability after recalibration",
    "confidence": "the recalibrated probability times the segmenter's and the completer's score",
    "random": "baseline: the decisions in random order",
    "nearest": "baseline: the decisions by closeness to the nearest training point",
}
"""What is held against the truth, by name."""

SCORES = ("raw_score", "normalised_score")
"""Those of the decision, whatever it is; no probabilities."""

BASELINES = ("random", "nearest")
"""Those that rank alone."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ScenePoints:
    """A model's answers about the points of a test set in one scene.

    Attributes
    ----------
    truth, predicted : (n,) bool
        Whether each point lies on an object of the target's category, and is said to.
    on_object : mapping to (n,) float64
        By series: what it says, read as the probability that the point lies on the object. A
        series that is not defined in the scene, and a baseline, is not there. The seed's scores
        are of the decision: one of s reads as s where the point is put on the object and as 1 - s
        elsewhere; where the scores leave [0, 1], so does this.
    of_decision : mapping to (n,) float64
        By series: what ranks the decisions, as in the records: a probability p reads as 1 - p
        where the point is not put on the object.
    """

    scene_id: str
    category: str
    object_name: str
    completion: str
    model: str
    truth: Bools
    predicted: Bools
    on_object: Mapping[str, Floats]
    of_decision: Mapping[str, Floats]


def scene_points(
    recording: Recording, *, completion: str, model: str, tolerance_m: float
) -> ScenePoints:
    """Take a model's answers about a test set from a recording.

    Parameters
    ----------
    recording
        Of the scene; it has answers of the model.
    completion
        The test set, as records state it; no points where the scene has none.
    model
        By name.
    tolerance_m
        Distance within which a point lies on a mesh, metres.
    """
    part, answers = recording.part(completion), recording.answers[model]
    predicted = answers.classes[part] == CLASS_NAMES.index(recording.category)
    of_decision = {"random": np.zeros(len(predicted))}
    on_object: dict[str, Floats] = {}
    if recording.target_id is not None:
        of_decision["nearest"] = -recording.data_distance_m[part]
        for name, score in seed_scores(answers).items():
            of_decision[name] = score[part]
            on_object[name] = np.where(predicted, score[part], 1.0 - score[part])
    for name in ("probability", "recalibrated", "confidence"):
        value: Floats = getattr(answers, name)[part]
        if not np.isnan(value).any():
            on_object[name] = value
            of_decision[name] = np.where(predicted, value, 1.0 - value)
    return ScenePoints(
        scene_id=recording.scene_id,
        category=recording.category,
        object_name=recording.target.name,
        completion=completion,
        model=model,
        truth=recording.on_target(tolerance_m)[part],
        predicted=predicted,
        on_object=on_object,
        of_decision=of_decision,
    )


def seed_scores(answers: ModelAnswers) -> dict[str, Floats]:
    """Return the seed's scores (m,) of every test point, by name of `SCORES`.

    The raw one is Eq. 2 as it is written, ``s = (1 - sigma) / (1 - sigma_min)``, with sigma the
    predicted class's variance as in the normalised one (`ModelAnswers.score`), which takes s from
    its least to its greatest and multiplies it by the segmenter's score. The raw one is negative
    where ``sigma > 1 > sigma_min``, turns the order of the points around where ``sigma_min > 1``,
    and is not there where ``sigma_min = 1``. A model without a variance has neither.
    """
    variance = answers.variance
    if not variance.any():
        return {}
    scores = {"normalised_score": answers.score}
    least = variance.min()
    if least != 1.0:
        scores["raw_score"] = (1.0 - variance) / (1.0 - least)
    return scores
