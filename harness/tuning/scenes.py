"""Validation scenes, simulated and mapped once, that any setting can be asked about."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.asked import gather_test_sets
from harness.assets import generate_assets
from harness.errors import InputError
from harness.native import Pipeline
from harness.protocol import true_categories
from harness.runs.job import plan_jobs
from harness.scene_run import map_scene, scene_spec, without_idle_completer
from harness.scoring import Answers
from harness.truth import SceneFailure, find_mapped, mesh_truth
from sim_scenes import SceneError, load_object_set, simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    import numpy.typing as npt

    from harness.config import Config
    from harness.native import TrainingSet
    from sim_scenes import Scene, SceneObject

    Floats = npt.NDArray[np.float64]


STRIDE = 4
"""Pixels of a view from one to the next in its small copy."""

GIVEN = {"completer": "none", "segmenter": "oracle"}
"""What a pipeline is told that has neither to find the object nor to complete it."""


@dataclass(frozen=True, eq=False)
class TuningScene:
    """A mapped scene with its training points and the test points of all test sets.

    Attributes
    ----------
    category
        The target's.
    view
        Arguments of `Pipeline.add_frame`: a small view that shows the target alone.
    training
        What the models learn from, drawn from the whole map.
    points : (n, 3) float64
        Test points, metres.
    truth : (n,) bool
        Whether each lies on an object of the target's category.
    """

    scene_id: str
    category: str
    view: Mapping[str, Any]
    training: TrainingSet
    points: Floats
    truth: npt.NDArray[np.bool_]

    def probability(self, *, model: str, settings: dict[str, Any]) -> Floats:
        """Raw probability (n,) of the target's category under a ``[pipeline]`` table.

        A pipeline keeps its settings, and mapping a scene again costs as much as a model. Beside
        the training points a model needs to know of the map only which object is meant, by its
        true mask; nor does it need the completer, whose points are there already.
        """
        pipeline = Pipeline(json.dumps(settings | GIVEN, sort_keys=True))
        (object_id,) = pipeline.add_frame(**self.view)
        if object_id is None:
            raise InputError(f"{self.scene_id}: no view shows the target; change [scenes]")
        try:
            predictions = pipeline.classify(object_id, self.training, self.points, model=model)
        except ValueError as error:
            raise InputError(f"{self.scene_id}, model {model}: {error}") from error
        return Answers(predictions, slice(None)).probability(self.category)


def validation_folder(work: Path, *, config: Config, split: str, count: int, seed: int) -> Path:
    """Write meshes of a split, `count` of each class, and return their folder.

    The same arguments give the same bytes, so that a folder from before is written over.
    """
    folder = work / "meshes" / f"{split}-{seed}"
    try:
        generate_assets(
            folder, split=split, seed=seed, counts=dict.fromkeys(config.run.classes, count)
        )
    except (ValueError, OSError) as error:
        raise InputError(" ".join(str(error).split())) from error
    return folder


def tuning_scenes(
    config: Config, *, folder: Path, test_points: int, lost: Callable[[str, str], None]
) -> Iterator[TuningScene]:
    """Simulate and map a run's scenes of the objects in a folder.

    Parameters
    ----------
    config
        Scenes, protocol and pipeline; ``run.scenes`` of each class.
    folder
        Meshes with a manifest.
    test_points
        Of each test set.
    lost
        Told the id of each scene that cannot be had, and why.
    """
    objects = load_object_set(folder)
    for job in plan_jobs(config, objects.models):
        try:
            scene = simulate(scene_spec(job, config), seed=job.seed, objects=objects)
            target = scene.objects[0]
            pipeline = map_scene(scene, config=without_idle_completer(config))
            truths = [mesh_truth(item) for item in scene.objects]
            mapped = find_mapped(pipeline.objects(), truths, name=target.name)
            if mapped.category != target.category:
                lost(job.scene_id, f"its segmenter takes {target.name} for a {mapped.category}")
                continue
            training = pipeline.training_set(mapped.id, seed=job.seed)
            asked, missing = gather_test_sets(
                config.protocol.test_sets,
                target=target,
                object_id=mapped.id,
                pipeline=pipeline,
                count=test_points,
                seed=job.seed,
            )
        except (SceneError, SceneFailure, ValueError) as error:
            lost(job.scene_id, str(error))
            continue
        if missing:
            lost(job.scene_id, missing[0].reason)
            continue
        points = np.concatenate([item.points_world for item in asked])
        distances_m = np.stack([truth.distances(points) for truth in truths])
        tolerance_m = config.protocol.reported_tolerance_m
        true = true_categories(distances_m, scene.objects, tolerance_m=tolerance_m)
        yield TuningScene(
            scene_id=job.scene_id,
            category=target.category,
            view=_small_view(scene, target),
            training=training,
            points=points,
            truth=true == target.category,
        )


def _small_view(scene: Scene, target: SceneObject) -> dict[str, Any]:
    """Every `STRIDE`-th pixel of the frame that shows most of the target, and nothing else."""
    shown = [
        (np.zeros_like(frame.depth_m, dtype=np.uint16), frame)
        if frame.instance_ids is None
        else (np.where(frame.instance_ids == target.instance_id, np.uint16(1), np.uint16(0)), frame)
        for frame in scene.frames
    ]
    mask, frame = max(shown, key=lambda pair: int(np.count_nonzero(pair[0])))
    every = (slice(None, None, STRIDE), slice(None, None, STRIDE))
    camera = frame.intrinsics
    return {
        "rgb": np.ascontiguousarray(frame.rgb[every]),
        "depth_m": np.ascontiguousarray(frame.depth_m[every]),
        "intrinsics": tuple(
            value / STRIDE for value in (camera.fx, camera.fy, camera.cx, camera.cy)
        ),
        "world_from_camera": frame.world_from_camera,
        "instance_ids": np.ascontiguousarray(mask[every]),
        "categories": {1: target.category},
    }
