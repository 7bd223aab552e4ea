"""Puts together what a run keeps of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.recordings.recording import (
    MappedCloud,
    ModelAnswers,
    Recording,
    TestSetPart,
    TrueObject,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.asked import AskedPoints
    from harness.native import MappedObject, Pipeline, TrainingSet
    from harness.recordings.watch import MapWatch
    from harness.runs.job import SceneJob
    from harness.scoring import Answers
    from sim_scenes import Scene

    Floats = npt.NDArray[np.float64]

MOST_OBSERVED = 4000
"""Of an object's observed points; a cloud of more is thinned evenly in its order."""


def record_scene(
    scene: Scene,
    *,
    job: SceneJob,
    pipeline: Pipeline,
    watch: MapWatch,
    target_id: int | None,
    training: TrainingSet | None,
    asked: Sequence[AskedPoints],
    distances_m: Floats,
    data_distance_m: Floats,
    answers: Mapping[str, ModelAnswers],
) -> Recording:
    """Record a scene.

    Parameters
    ----------
    scene, job
        Frames and truth, and which scene it is.
    pipeline, watch
        Its map, and what was noted while it was made.
    target_id
        The mapped object that is the target; None where it was missed.
    training
        What the models learned from, if they did.
    asked
        The test points of all sets.
    distances_m : (objects, m) float64
        Of each to each true mesh.
    data_distance_m : (m,) float64
        Of each to the nearest training point.
    answers
        By model.
    """
    points = np.concatenate([item.points_world for item in asked]).astype(np.float32)
    learned = np.zeros((0, 3)) if training is None else training.points_world
    return Recording(
        scene_id=job.scene_id,
        category=scene.objects[0].category,
        seed=job.seed,
        segmenter=pipeline.segmenter,
        completer=pipeline.completer,
        views=tuple(watch.views),
        objects=tuple(_true_objects(scene)),
        tracked=tuple(_clouds(pipeline)),
        target_id=target_id,
        voxels=watch.voxels(pipeline),
        training_world=learned.astype(np.float32),
        training_classes=np.zeros(0, np.uint8) if training is None else training.classes,
        test_world=points,
        test_sets=tuple(TestSetPart(completion=item.completion, part=item.part) for item in asked),
        distances_m=distances_m,
        data_distance_m=data_distance_m,
        completer_confidence=np.concatenate([item.confidence for item in asked]),
        answers=answers,
    )


def model_answers(answers: Answers, *, category: str, item: MappedObject) -> ModelAnswers:
    """Take from a model's answers about all test points what is kept of them.

    Parameters
    ----------
    answers
        About all test points.
    category
        The target's.
    item
        The target in the map.
    """
    probability = answers.probability(category)
    recalibrated = answers.recalibrated(item) if item.category == category else None
    return ModelAnswers(
        classes=answers.classes,
        probability=probability,
        recalibrated=np.full(len(probability), np.nan) if recalibrated is None else recalibrated,
        confidence=answers.target_confidence(category, item),
        score=answers.score,
        variance=answers.predictions.variance,
    )


def missed_answers(count: int) -> ModelAnswers:
    """Say of every point (count,) that it is not on the target, as of one that was missed."""
    never = np.zeros(count)
    return ModelAnswers(
        classes=np.zeros(count, np.uint8),
        probability=never,
        recalibrated=np.full(count, np.nan),
        confidence=never,
        score=never,
        variance=never,
    )


def _true_objects(scene: Scene) -> list[TrueObject]:
    made = []
    for item in scene.objects:
        vertices, faces = item.mesh_world()
        made.append(
            TrueObject(
                instance_id=item.instance_id,
                name=item.name,
                category=item.category,
                vertices_world=vertices.astype(np.float32),
                faces=faces.astype(np.int32),
            )
        )
    return made


def _clouds(pipeline: Pipeline) -> list[MappedCloud]:
    made = []
    for item in pipeline.objects():
        completion = None if pipeline.completer == "none" else pipeline.completion(item.id)
        whole = np.zeros((0, 3)) if completion is None else completion.points_world
        spread = np.zeros(0) if completion is None else completion.spread_m
        stride = -(-len(item.points_world) // MOST_OBSERVED) or 1
        made.append(
            MappedCloud(
                id=item.id,
                category=item.category,
                score=item.score,
                centroid_world=item.centroid_world,
                observed_world=item.points_world[::stride].astype(np.float32),
                completed_world=whole.astype(np.float32),
                spread_m=spread.astype(np.float32),
            )
        )
    return made
