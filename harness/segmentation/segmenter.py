"""The segmenters of the report: made once in a process, asked frame by frame."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

from harness import native
from harness.truth import ORACLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    import numpy.typing as npt

    from harness.config import Config
    from sim_scenes import Frame, Scene

LEAST_SCORE = 0.05
"""Detections down to this score are asked for, whatever the map would take: average precision
counts them all."""


class Detected(Protocol):
    """What is needed of a detection."""

    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """Its pixels (h, w)."""
        ...

    @property
    def category(self) -> str:
        """Its category."""
        ...

    @property
    def score(self) -> float:
        """How sure the segmenter is of it, in [0, 1]."""
        ...


class Segments(Protocol):
    """What is needed of a segmenter."""

    @property
    def temperature(self) -> float | None:
        """By which it divides its logits; None for one that does not calibrate."""
        ...

    def segment(
        self,
        *,
        rgb: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        intrinsics: tuple[float, float, float, float],
        world_from_camera: npt.NDArray[np.float64],
        instance_ids: npt.NDArray[np.uint16] | None = None,
        categories: Mapping[int, str] | None = None,
    ) -> Sequence[Detected]:
        """Find the instances in a frame."""
        ...


def with_segmenter(config: Config, setting: str, **segmentation: Any) -> Config:
    """Let a configuration's pipeline segment by another segmenter and other settings of it."""
    pipeline = config.pipeline | {
        "segmenter": setting,
        "segmentation": config.pipeline["segmentation"] | segmentation,
    }
    return config.model_copy(update={"pipeline": pipeline})


def segmenter_json(config: Config, setting: str, *, calibrated: bool | None = None) -> str:
    """Write the ``[pipeline]`` table of a segmenter that gives its unsure detections too."""
    change: dict[str, Any] = {"least_score": LEAST_SCORE}
    if calibrated is not None:
        change["calibrated"] = calibrated
    return with_segmenter(config, setting, **change).pipeline_json()


@lru_cache(maxsize=8)
def make_segmenter(pipeline_json: str) -> Segments:
    """Make a segmenter, or return the one that this process has made already."""
    segmenter: Segments = native.Segmenter(pipeline_json)
    return segmenter


def truth_for(setting: str, scene: Scene) -> dict[int, str] | None:
    """Return a scene's categories for the segmenter that stands for the truth; no other sees any.

    Parameters
    ----------
    setting
        ``pipeline.segmenter``.
    scene
        With its true masks.
    """
    return scene.categories if setting == ORACLE else None


def segment_frame(
    segmenter: Segments, frame: Frame, *, categories: Mapping[int, str] | None
) -> Sequence[Detected]:
    """Find the instances in a frame; only with categories is the truth handed over."""
    camera = frame.intrinsics
    return segmenter.segment(
        rgb=frame.rgb,
        depth_m=frame.depth_m,
        intrinsics=(camera.fx, camera.fy, camera.cx, camera.cy),
        world_from_camera=frame.world_from_camera,
        instance_ids=None if categories is None else frame.instance_ids,
        categories=categories,
    )
