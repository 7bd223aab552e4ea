"""One scene of the report: complete its target by every completer and measure the clouds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from harness.asked import no_completion
from harness.completion.baselines import mirrored, observed_only, scaled_mean_shape
from harness.completion.clouds import observed_of
from harness.completion.handle import find_handle
from harness.completion.metrics import MM, PARTS, Measured, Surface, measure_cloud
from harness.completion.pictures import draw_scene
from harness.completion.rows import CloudRow, HandleRow, LatencyRow, SceneRows, ViewsRow
from harness.completion.spread import mean_mm, score_spread
from harness.scene_run import map_scene, simulate_job
from harness.truth import SceneFailure, find_mapped, mesh_truth
from sim_scenes.geometry import apply, inverse

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import numpy.typing as npt

    from harness.asked import Completion
    from harness.completion.mean_shape import MeanShape
    from harness.completion.rows import Completer
    from harness.config import Config
    from harness.native import Pipeline
    from harness.runs.job import SceneJob
    from sim_scenes import Scene, SceneObject

    Floats = npt.NDArray[np.float64]

STAGES = ("complete", "refine")
EMBEDDED = "embedded"
"""Weights that come with the program."""


@dataclass(frozen=True, eq=False)
class Plan:
    """What every scene of the report is asked.

    Attributes
    ----------
    completers
        In the order of their rows.
    mean_shapes
        By category.
    pictures
        Folder of the scenes' pictures.
    """

    completers: tuple[Completer, ...]
    mean_shapes: Mapping[str, MeanShape]
    pictures: Path


@dataclass(frozen=True, eq=False)
class Completed:
    """What a completer made of the target.

    Attributes
    ----------
    completion
        None where it made nothing, for the reason given.
    views
        What each view gave of its own.
    seconds
        Time of each stage, all frames together.
    """

    completion: Completion | None
    views: Sequence[Completion]
    reason: str
    seconds: Mapping[str, float]


def score_scene(job: SceneJob, config: Config, plan: Plan) -> SceneRows:
    """Simulate a job's scene and measure every completer and baseline; the workers' function."""
    return measure_scene(simulate_job(job, config), job=job, config=config, plan=plan)


def measure_scene(scene: Scene, *, job: SceneJob, config: Config, plan: Plan) -> SceneRows:
    """Measure every completer and baseline on a scene's target, its first object.

    Raises
    ------
    SceneFailure
        No view measured a point of the target, or the map does not hold it.
    """
    target = scene.objects[0]
    observed = observed_of(scene, target)
    if len(observed) == 0:
        raise SceneFailure(f"no view measured the depth of {target.name}")
    surface = Surface.of(target, observed_world=observed, seed=job.seed)
    camera = np.mean([frame.world_from_camera[:3, 3] for frame in scene.frames], axis=0)
    table_height_m = float(config.pipeline["metric"]["table_height_m"])
    baselines = {
        "observed": observed_only(observed),
        "mean shape": scaled_mean_shape(
            plan.mean_shapes[target.category], observed, table_height_m=table_height_m
        ),
        "mirrored": mirrored(observed, camera_world=camera),
    }
    found = {
        item.name: complete_target(scene, completer=item, config=config) for item in plan.completers
    }
    clouds: dict[str, Completion] = {
        name: item.completion for name, item in found.items() if item.completion is not None
    }
    points = {name: cloud.points_world for name, cloud in clouds.items()} | baselines
    measured = {name: measure_cloud(cloud, surface) for name, cloud in points.items()}
    draw_scene(
        plan.pictures / f"{job.scene_id}.png",
        surface.truth,
        title=job.scene_id,
        surface_world=surface.samples_world,
        observed_world=observed,
        clouds={
            item.name: clouds[item.name].points_world
            for item in plan.completers
            if item.refine and item.name in clouds
        },
        camera_world=camera,
    )
    return SceneRows(
        scene_id=job.scene_id,
        category=target.category,
        object_name=target.name,
        unseen_share=float(1.0 - surface.seen.mean()),
        clouds=tuple(
            CloudRow(name, part, measured[name].scores[part]) for name in points for part in PARTS
        ),
        spreads={
            name: score_spread(cloud.spread_m, cloud.confidence, measured[name].distances_m)
            for name, cloud in clouds.items()
        },
        handles=handle_rows(clouds, surface, target) if target.category == "mug" else (),
        views=views_rows(found, {name: measured[name] for name in clouds}, surface),
        latencies=tuple(
            row
            for name, item in found.items()
            for row in latency_rows(name, item.seconds, scene=scene)
        ),
        uncompleted={name: item.reason for name, item in found.items() if item.completion is None},
    )


def with_completer(config: Config, completer: Completer) -> Config:
    """Let a configuration's pipeline complete as a completer says.

    Weights that the configuration names are of the completer that it names; others have their own.
    """
    completion = config.pipeline["completion"] | {"refine": completer.refine}
    if completer.setting != config.pipeline["completer"]:
        completion["weights"] = EMBEDDED
    settings = config.pipeline | {"completer": completer.setting, "completion": completion}
    return config.model_copy(update={"pipeline": settings})


def complete_target(scene: Scene, *, completer: Completer, config: Config) -> Completed:
    """Map a scene under a completer and take what it made of the target.

    Raises
    ------
    SceneFailure
        The map does not hold the target.
    """
    pipeline = map_scene(scene, config=with_completer(config, completer))
    truths = [mesh_truth(item) for item in scene.objects]
    mapped = find_mapped(pipeline.objects(), truths, name=scene.objects[0].name)
    completion = pipeline.completion(mapped.id)
    reason = "" if completion is not None else no_completion(pipeline, mapped.id)
    views = pipeline.view_completions(mapped.id)
    return Completed(completion, views, reason, stage_seconds(pipeline))


def stage_seconds(pipeline: Pipeline) -> dict[str, float]:
    """Read the time that a pipeline has spent on completion, by stage."""
    return {stage: seconds for stage, _, seconds in pipeline.timings() if stage in STAGES}


def latency_rows(name: str, seconds: Mapping[str, float], *, scene: Scene) -> list[LatencyRow]:
    """Give each stage's time per frame, and their total."""
    per_frame = {stage: MM * time / len(scene.frames) for stage, time in seconds.items()}
    per_frame["total"] = sum(per_frame.values())
    return [LatencyRow(name, stage, len(scene.objects), t) for stage, t in per_frame.items()]


def views_rows(
    found: Mapping[str, Completed], fused: Mapping[str, Measured], surface: Surface
) -> tuple[ViewsRow, ...]:
    """Hold each completer's fused cloud against its views' own; none of what one view completed.

    All are measured against the same samples of the surface.
    """
    rows = []
    for name, cloud in fused.items():
        single = [
            chamfer_mm(measure_cloud(view.points_world, surface)) for view in found[name].views
        ]
        if len(single) > 1:
            rows.append(
                ViewsRow(
                    cloud=name,
                    fused_mm=chamfer_mm(cloud),
                    best_mm=min(single),
                    mean_mm=float(np.mean(single)),
                    views=len(single),
                )
            )
    return tuple(rows)


def chamfer_mm(measured: Measured) -> float:
    """Chamfer distance over the whole surface of a cloud that has points."""
    chamfer = measured.scores["all"].chamfer_mm
    if chamfer is None:
        raise SceneFailure("a completer gave a cloud without points")
    return chamfer


def handle_rows(
    clouds: Mapping[str, Completion], surface: Surface, target: SceneObject
) -> tuple[HandleRow, ...]:
    """Say what each completer made of a mug's handle; none of a mug without one."""
    object_from_world = inverse(target.world_from_object)
    samples = apply(object_from_world, surface.samples_world)
    mug = find_handle(samples)
    if mug is None:
        return ()
    handle = mug.is_handle(samples)
    rows = []
    for name, cloud in clouds.items():
        points = apply(object_from_world, cloud.points_world)
        outcome, made = mug.outcome(points)
        distances, nearest = cKDTree(points).query(samples[handle])
        rows.append(
            HandleRow(
                cloud=name,
                seen_share=float(surface.seen[handle].mean()),
                outcome=outcome.value,
                distance_mm=float(np.mean(distances)) * MM,
                spread_at_handle_mm=float(cloud.spread_m[nearest].mean()) * MM,
                spread_made_mm=mean_mm(cloud.spread_m, made),
                spread_mm=float(cloud.spread_m.mean()) * MM,
            )
        )
    return tuple(rows)
