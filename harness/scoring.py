"""What a classifier's answers about one test set are worth: its records and its confusion."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from harness.native import CLASS_NAMES, binary_metrics
from harness.runs.confusion import Confusion
from harness.runs.records import Record
from sim_scenes.geometry import apply

if TYPE_CHECKING:
    import numpy.typing as npt

    from harness.native import Hyperparameters, MappedObject, Predictions, TrainingSet
    from sim_scenes import Scene, SceneObject

    Floats = npt.NDArray[np.float64]

LOG_LOSS_CLIP = 1e-6


@dataclass(frozen=True, eq=False)
class Answers:
    """A model's answers about one test set; all test sets are asked about at once.

    Attributes
    ----------
    predictions
        About the points of all test sets.
    part
        Those of this one.
    completer_confidence : (n,) float64 or None
        Of all test sets: what the predictions' confidences hold as the completer's share.
    """

    predictions: Predictions
    part: slice
    completer_confidence: Floats | None = None

    @property
    def classes(self) -> npt.NDArray[np.uint8]:
        """Predicted class (n,) of each point."""
        return np.asarray(self.predictions.classes[self.part])

    @property
    def confidence(self) -> Floats:
        """Recalibrated probability (n,), times the segmenter's score and the completer's."""
        return np.asarray(self.predictions.confidence[self.part])

    @property
    def score(self) -> Floats:
        """The seed's score (n,): its min-max form, by the extremes of all test sets together.

        It is affine in the variance, so that these extremes change no order.
        """
        return np.ascontiguousarray(self.predictions.score[self.part])

    @property
    def clamped_share(self) -> float:
        """Share of these points whose variance was negative and clamped."""
        clamped = self.predictions.clamped[self.part]
        return float(np.mean(clamped)) if len(clamped) else 0.0

    def probability(self, category: str) -> Floats:
        """Raw probability (n,) of a category; 0 where the classifier does not know it."""
        names = self.predictions.class_names
        if category not in names:
            return np.zeros(len(self.classes))
        column = names.index(category)
        return np.ascontiguousarray(self.predictions.probabilities[self.part, column])

    def target_confidence(self, category: str, item: MappedObject) -> Floats:
        """Confidence (n,) that a point lies on the target, of a category, that a map holds as item.

        The confidence is that of the category which the map gives the object; where that is wrong,
        the raw probability of the right one stands in.
        """
        return self.confidence if item.category == category else self.probability(category)

    def recalibrated(self, item: MappedObject) -> Floats | None:
        """Recalibrated probability (n,) that a point lies on a mapped object.

        None where the segmenter gives the object no score or the completer a point none, for the
        confidence holds both as factors.
        """
        others = np.full(len(self.classes), item.score)
        if self.completer_confidence is not None:
            others *= self.completer_confidence[self.part]
        return np.minimum(self.confidence / others, 1.0) if (others > 0).all() else None


def scene_facts(scene: Scene) -> dict[str, Any]:
    """Fields of a record that tell which scene it is of, whatever a model says of it."""
    low, high = (bound(scene.objects[0].vertices, axis=0) for bound in (np.min, np.max))
    middle = apply(scene.objects[0].world_from_object, ((low + high) / 2)[np.newaxis])[0]
    cameras = np.array([frame.world_from_camera[:3, 3] for frame in scene.frames])
    shown = [
        float(np.mean(frame.instance_ids == scene.objects[0].instance_id))
        for frame in scene.frames
        if frame.instance_ids is not None
    ]
    return {
        "views": len(scene.frames),
        "redraws": scene.redraw_count,
        "camera_distance_m": float(np.linalg.norm(cameras - middle, axis=1).mean()),
        "visible_share": float(np.mean(shown)) if len(shown) == len(scene.frames) else None,
    }


def score(
    answers: Answers,
    *,
    truth: npt.NDArray[np.bool_],
    data_distance_m: Floats,
    target: SceneObject,
    item: MappedObject,
    training: TrainingSet,
    identity: dict[str, Any],
) -> Record:
    """Score one model's answers at one tolerance.

    The metrics of ranking and calibration judge the classifier alone, by its raw probability of
    the target's category and, where said so, by the recalibrated one. Decisions are ranked by the
    confidence, the recalibrated probability times the segmenter's score.

    Parameters
    ----------
    answers
        About the test points.
    truth : (n,) bool
        Whether each point lies on an object of the target's category.
    data_distance_m : (n,) float64
        Distance of each point to the nearest training point, metres.
    target
        The object asked about.
    item
        What the map takes it for.
    training
        What the model learned from.
    identity
        The fields of the record that say which result it is.
    """
    target_class = CLASS_NAMES.index(target.category)
    predicted = answers.classes == target_class
    probability = answers.probability(target.category)
    confidence = answers.target_confidence(target.category, item)
    metrics = binary_metrics(
        predicted=predicted,
        truth=truth,
        probability=probability,
        decision_confidence=np.where(predicted, confidence, 1.0 - confidence),
    )
    aurc_by_score, aurc_by_nearness = (
        binary_metrics(predicted=predicted, truth=truth, decision_confidence=ranking)["aurc"]
        for ranking in (answers.score, -data_distance_m)
    )
    recalibrated = answers.recalibrated(item) if item.category == target.category else None
    after = (
        {}
        if recalibrated is None
        else binary_metrics(predicted=predicted, truth=truth, probability=recalibrated)
    )
    names = {field.name for field in fields(Record)}
    predictions = answers.predictions
    return Record(
        **identity,
        **cast("dict[str, Any]", {name: metrics[name] for name in metrics.keys() & names}),
        base_rate=float(truth.mean()) if len(truth) else None,
        ece_recalibrated=after.get("ece"),
        brier_recalibrated=after.get("brier"),
        log_loss=log_loss(probability, truth),
        nearest_aurc=aurc_by_nearness,
        score_aurc=aurc_by_score,
        test_points=len(truth),
        object_training_points=int(np.count_nonzero(training.classes == target_class)),
        free_training_points=int(np.count_nonzero(training.classes == 0)),
        clamped_share=answers.clamped_share,
        gate=predictions.gate,
        ood=predictions.ood,
        jitter=predictions.jitter,
        fits_unconverged=predictions.fits_unconverged,
        fits_at_bound=predictions.fits_at_bound,
        # A map that takes the target for something else has no process of its category.
        **_scales(predictions.hyperparameters.get(target.category), suffixes=("_m", "")),
        **_scales(predictions.hyperparameters.get("free"), suffixes=("_free_m", "_free")),
    )


def score_missed(truth: npt.NDArray[np.bool_], *, identity: dict[str, Any]) -> Record:
    """Score that no test point is said to lie on the target, for the map does not hold it.

    Parameters
    ----------
    truth : (n,) bool
        Whether each point lies on an object of the target's category.
    identity
        The fields of the record that say which result it is.
    """
    never = np.zeros(len(truth))
    metrics = binary_metrics(
        predicted=np.zeros(len(truth), dtype=bool),
        truth=truth,
        probability=never,
        decision_confidence=1.0 - never,
    )
    names = {field.name for field in fields(Record)}
    return Record(
        **identity,
        **cast("dict[str, Any]", {name: metrics[name] for name in metrics.keys() & names}),
        target_missed=True,
        base_rate=float(truth.mean()) if len(truth) else None,
        log_loss=log_loss(never, truth),
        test_points=len(truth),
        object_training_points=0,
        free_training_points=0,
    )


def log_loss(probability: Floats, truth: npt.NDArray[np.bool_]) -> float | None:
    """Mean negative log-likelihood of the truth, nats; None without points."""
    if len(truth) == 0:
        return None
    of_truth = np.where(truth, probability, 1.0 - probability)
    return float(-np.log(np.clip(of_truth, LOG_LOSS_CLIP, 1.0 - LOG_LOSS_CLIP)).mean())


def confusion(
    answers: Answers, *, true: npt.NDArray[np.str_], identity: dict[str, Any]
) -> list[Confusion]:
    """Count the points of each true category and predicted class.

    Parameters
    ----------
    answers
        About the test points.
    true : (n,) str
        Category of the object that each point lies on, a neighbour too; ``free`` on none.
    identity
        The fields of the rows that say which result they are of.
    """
    return count_confusion(true, np.array(CLASS_NAMES)[answers.classes], identity=identity)


def count_confusion(
    true: npt.NDArray[np.str_], predicted: npt.NDArray[np.str_], *, identity: dict[str, Any]
) -> list[Confusion]:
    """Count the points of each pair of true (n,) and predicted (n,) category."""
    pairs, counts = np.unique(np.stack([true, predicted]), axis=1, return_counts=True)
    return [
        Confusion(**identity, true=str(of), predicted=str(taken_for), points=int(count))
        for (of, taken_for), count in zip(pairs.T, counts, strict=True)
    ]


def _scales(process: Hyperparameters | None, *, suffixes: tuple[str, str]) -> dict[str, Any]:
    """Fields of a process's hyperparameters; null where the model has none."""
    return {
        f"lengthscale{suffixes[0]}": process.lengthscale_m if process else None,
        f"outputscale{suffixes[1]}": process.outputscale if process else None,
    }
