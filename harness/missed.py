"""What a benchmark records of a target that the segmenter missed.

It is no lost scene: whoever asks such a map about the target's points is told everywhere that they
are not on the object, with a probability of 0. Nothing true is found and nothing is claimed, so
that recall is 0 and precision undefined. What is asked of points that a completer makes has failed,
for there is nothing to complete.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from harness.protocol import (
    COMPLETED,
    HasCompleter,
    completion_name,
    draw_test_points,
    true_categories,
)
from harness.runs.records import Record, SceneResult, Variant
from harness.scoring import count_confusion, score_missed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.config import Config
    from harness.native import MeshTruth
    from harness.runs.job import SceneJob
    from sim_scenes import Scene


class Compares(HasCompleter, Protocol):
    """What is needed of a pipeline."""

    @property
    def segmenter(self) -> str:
        """Its name."""
        ...

    @property
    def models(self) -> list[str]:
        """Names of its classifiers."""
        ...


def answer_missed(
    scene: Scene,
    *,
    job: SceneJob,
    config: Config,
    pipeline: Compares,
    truths: Sequence[MeshTruth],
    reason: str,
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
    """
    protocol = config.protocol
    target = scene.objects[0]
    result = SceneResult(records=[])
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
                    "views": len(scene.frames),
                    "redraws": scene.redraw_count,
                }
                result.records.append(score_missed(true == target.category, identity=identity))
    return result
