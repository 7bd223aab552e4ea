"""From frames to a map with completed shapes, in stages that configurations can share."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from harness.native import Pipeline, Segmenter
from harness.recordings.watch import MapWatch
from harness.stages.clock import Times, spent_since

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.config import Config
    from harness.native import Detection
    from harness.stages.clock import StageClock
    from harness.stages.keys import StageKeys
    from harness.stages.memo import Memo
    from sim_scenes import Frame, Scene

MAPPING = ("segmenter", "segmentation", "map")
"""Settings of the pipeline that shape its map, all others left out."""


@dataclass(frozen=True, eq=False)
class Mapped:
    """A map, and what was noted while it was made.

    Attributes
    ----------
    pipeline
        The map; not to be changed, for other configurations share it.
    watch
        None where the run records nothing.
    """

    pipeline: Pipeline
    watch: MapWatch | None


def map_in_stages(
    scene: Scene, *, config: Config, keys: StageKeys, memo: Memo, clock: StageClock
) -> Mapped:
    """Segment, map and complete a scene; returns a pipeline of the whole configuration.

    Parameters
    ----------
    scene
        The frames.
    config, keys
        The configuration, and the keys of its stages.
    memo, clock
        Keep what the stages yield and what they took.
    """
    found = memo.get(
        "segment", keys.detections, lambda: _segment(scene, config=config), clock=clock
    )
    mapped = memo.get("map", keys.map, lambda: _map(scene, found, config=config), clock=clock)
    completed = mapped.pipeline
    if config.pipeline["completer"] != "none":
        completed = memo.get(
            "complete",
            keys.completed,
            lambda: _complete(scene, found, mapped.pipeline, config=config),
            clock=clock,
        )
    return Mapped(completed.reconfigured(config.pipeline_json()), mapped.watch)


def frame_arguments(frame: Frame, scene: Scene) -> dict[str, Any]:
    """Arguments of a pipeline's and a segmenter's methods that take a frame."""
    camera = frame.intrinsics
    return {
        "rgb": frame.rgb,
        "depth_m": frame.depth_m,
        "intrinsics": (camera.fx, camera.fy, camera.cx, camera.cy),
        "world_from_camera": frame.world_from_camera,
        "instance_ids": frame.instance_ids,
        "categories": scene.categories,
    }


def _settings(config: Config, *sections: str, **more: Any) -> str:
    """Write a pipeline's settings of some sections, the others' left at their defaults."""
    return json.dumps({name: config.pipeline[name] for name in sections} | more, sort_keys=True)


@lru_cache(maxsize=4)
def _segmenter(settings: str) -> Segmenter:
    """Make a segmenter once in a process: its weights take longer to read than a frame."""
    return Segmenter(settings)


def _segment(scene: Scene, *, config: Config) -> tuple[list[list[Detection]], Times]:
    segmenter = _segmenter(_settings(config, "segmenter", "segmentation"))
    start = time.perf_counter()
    found = [segmenter.segment(**frame_arguments(frame, scene)) for frame in scene.frames]
    return found, (("segment", None, time.perf_counter() - start),)


def _map(
    scene: Scene, found: Sequence[Sequence[Detection]], *, config: Config
) -> tuple[Mapped, Times]:
    pipeline = Pipeline(_settings(config, *MAPPING, completer="none"))
    watch = MapWatch() if config.run.record == "all" else None
    for frame, detections in zip(scene.frames, found, strict=True):
        ids = pipeline.add_frame(**frame_arguments(frame, scene), detections=detections)
        if watch is not None:
            watch.note(frame, detections, ids, pipeline)
    return Mapped(pipeline, watch), spent_since(pipeline, ())


def _complete(
    scene: Scene, found: Sequence[Sequence[Detection]], mapped: Pipeline, *, config: Config
) -> tuple[Pipeline, Times]:
    table_height_m = config.pipeline["metric"]["table_height_m"]
    settings = _settings(
        config, *MAPPING, "completer", "completion", metric={"table_height_m": table_height_m}
    )
    pipeline = mapped.reconfigured(settings)
    for index, (frame, detections) in enumerate(zip(scene.frames, found, strict=True)):
        pipeline.complete_frame(index, **frame_arguments(frame, scene), detections=detections)
    return pipeline, spent_since(pipeline, ())
