"""What a benchmark records of a target that the segmenter missed.

It is no lost scene: whoever asks such a map about the target's points is told everywhere that they
are not on the object, with a probability of 0. Nothing true is found and nothing is claimed, so
that recall is 0 and precision undefined. What is asked of points that a completer makes has failed,
for there is nothing to complete.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from harness.asked import AskedPoints
from harness.drawn_points import draw_test_points
from harness.protocol import COMPLETED, completion_name, true_categories
from harness.recordings.file import encode
from harness.recordings.make import missed_answers, record_scene
from harness.runs.records import Record, SceneResult, Variant
from harness.scoring import count_confusion, scene_facts, score_missed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.config import Config
    from harness.native import MeshTruth, Pipeline
    from harness.recordings.watch import MapWatch
    from harness.runs.job import SceneJob
    from sim_scenes import Scene


def answer_missed(
    scene: Scene,
    *,
    job: SceneJob,
    config: Config,
    pipeline: Pipeline,
    truths: Sequence[MeshTruth],
    reason: str,
    watch: MapWatch | None = None,
) -> SceneResult:
    """Record that a map does not hold the target, a scene's first object.

    Parameters
    ----------
    scene, job, config
        As for `harness.scene_run.evaluate_scene`.
    pipeline
        The map.
    truths
        The true meshes of the scene's objects.
    reason
        Why its completion has no points.
    watch
        What was noted while the map was made, for a recording; None where none is kept.
    """
    protocol = config.protocol
    target = scene.objects[0]
    result = SceneResult(records=[])
    asked: list[AskedPoints] = []
    distances = []
    start = 0
    for test_set in protocol.test_sets:
        name = completion_name(test_set, pipeline)
        if test_set == COMPLETED:
            result.records.extend(
                Record.failed(
                    job,
                    variant=Variant(model, name, pipeline.segmenter),
                    views=len(scene.frames),
                    tolerance_m=tolerance_m,
                    failure=reason,
                    target_missed=True,
                )
                for model in pipeline.models
                for tolerance_m in protocol.tolerances_m
            )
            continue
        points = draw_test_points(
            target, test_set=test_set, count=protocol.test_points, seed=job.seed
        )
        distances_m = np.stack([truth.distances(points) for truth in truths])
        distances.append(distances_m)
        part = slice(start, start := start + len(points))
        asked.append(AskedPoints(name, points, np.ones(len(points)), part))
        for tolerance_m in protocol.tolerances_m:
            true = true_categories(distances_m, scene.objects, tolerance_m=tolerance_m)
            for model in pipeline.models:
                identity = {
                    "scene_id": job.scene_id,
                    "model": model,
                    "completion": name,
                    "tolerance_m": tolerance_m,
                }
                result.confusion.extend(
                    count_confusion(true, np.full(len(true), "free"), identity=identity)
                )
                identity |= {
                    "category": target.category,
                    "object_name": target.name,
                    "seed": job.seed,
                    "segmenter": pipeline.segmenter,
                    **scene_facts(scene),
                }
                result.records.append(score_missed(true == target.category, identity=identity))
    if watch is None:
        return result
    recording = record_scene(
        scene,
        job=job,
        pipeline=pipeline,
        watch=watch,
        target_id=None,
        training=None,
        asked=asked,
        distances_m=np.concatenate(distances, axis=1),
        data_distance_m=np.full(start, np.inf),
        answers={model: missed_answers(start) for model in pipeline.models},
    )
    return replace(result, recording=encode(recording))
