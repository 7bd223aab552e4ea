"""One scene of the report: simulate it and let every segmenter look at its frames."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from harness.scene_run import simulate_job
from harness.segmentation.masks import encode, pixels
from harness.segmentation.rows import (
    LEAST_SHARE,
    Choice,
    Found,
    FrameRow,
    SceneRows,
    TimedScene,
    Truth,
)
from harness.segmentation.segmenter import (
    make_segmenter,
    segment_frame,
    segmenter_json,
    truth_for,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.config import Config
    from harness.runs.job import SceneJob
    from harness.segmentation.segmenter import Segments
    from sim_scenes import Frame, Scene

MS = 1000.0


@dataclass(frozen=True)
class Plan:
    """What every scene of the report is asked: its segmenters, in the order of their rows."""

    choices: tuple[Choice, ...]


def find_instances(job: SceneJob, config: Config, plan: Plan) -> SceneRows:
    """Simulate a job's scene and segment its frames; the workers' function."""
    return segment_scene(simulate_job(job, config), job=job, config=config, plan=plan)


def segment_scene(scene: Scene, *, job: SceneJob, config: Config, plan: Plan) -> SceneRows:
    """Segment a scene's frames by every segmenter."""
    segmenters = {
        item: make_segmenter(segmenter_json(config, item.setting)) for item in plan.choices
    }
    raw = {
        item: make_segmenter(segmenter_json(config, item.setting, calibrated=False))
        for item, segmenter in segmenters.items()
        if segmenter.temperature is not None and config.pipeline["segmentation"]["calibrated"]
    }
    return SceneRows(
        scene_id=job.scene_id,
        category=job.category,
        object_name=job.object_name,
        cluttered=job.cluttered,
        frames=tuple(
            FrameRow(
                truths=true_instances(frame, scene),
                found=_found(segmenters, frame, scene),
                uncalibrated=_found(raw, frame, scene),
            )
            for frame in scene.frames
        ),
        temperatures={
            item.name: segmenter.temperature
            for item, segmenter in segmenters.items()
            if segmenter.temperature is not None
        },
    )


def true_instances(frame: Frame, scene: Scene) -> tuple[Truth, ...]:
    """List the objects that a frame shows, by their true masks."""
    if frame.instance_ids is None:
        return ()
    truths = []
    for item in scene.objects:
        mask = encode(frame.instance_ids == item.instance_id)
        if shown := pixels(mask):
            ignored = shown < LEAST_SHARE * frame.instance_ids.size
            truths.append(Truth(item.name, item.category, mask, ignored))
    return tuple(truths)


def time_scene(job: SceneJob, config: Config, plan: Plan) -> TimedScene:
    """Time every segmenter on a job's frames; the function of the one worker that does so."""
    scene = simulate_job(job, config)
    times = {}
    for item in plan.choices:
        segmenter = make_segmenter(segmenter_json(config, item.setting))
        # What is set up by the first frame is no part of a frame's time.
        segment_frame(segmenter, scene.frames[0], categories=truth_for(item.setting, scene))
        measured = []
        for frame in scene.frames:
            start = time.perf_counter()
            segment_frame(segmenter, frame, categories=truth_for(item.setting, scene))
            measured.append(MS * (time.perf_counter() - start))
        times[item.name] = tuple(measured)
    return TimedScene(job.scene_id, times)


def _found(
    segmenters: Mapping[Choice, Segments], frame: Frame, scene: Scene
) -> dict[str, tuple[Found, ...]]:
    return {
        item.name: tuple(
            Found(detection.category, float(detection.score), encode(detection.mask))
            for detection in segment_frame(
                segmenter, frame, categories=truth_for(item.setting, scene)
            )
        )
        for item, segmenter in segmenters.items()
    }
