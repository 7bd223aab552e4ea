"""What the report holds of one scene: the true instances of every frame, and those found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.segmentation.masks import RunLengths

LEAST_SHARE = 1e-3
"""An object counts where at least this share of the image's pixels shows it, as for
`sim_scenes.views`; one that shows fewer is ignored: neither finding nor missing it counts."""


@dataclass(frozen=True)
class Choice:
    """A segmenter as the report runs it.

    Attributes
    ----------
    setting
        ``pipeline.segmenter``: ``maskrcnn``, ``maskrcnn_rgbd``, ``oracle`` or
        ``python:module.function``.
    """

    setting: str

    @property
    def name(self) -> str:
        """Name of its rows."""
        return self.setting.removeprefix("python:").rpartition(".")[2]


@dataclass(frozen=True)
class Truth:
    """An object as a frame truly shows it.

    Attributes
    ----------
    object_name, category
        Of its model.
    ignored
        Whether too little of it is in view to count.
    """

    object_name: str
    category: str
    mask: RunLengths
    ignored: bool


@dataclass(frozen=True)
class Found:
    """An instance that a segmenter found."""

    category: str
    score: float
    mask: RunLengths


@dataclass(frozen=True)
class FrameRow:
    """One frame.

    Attributes
    ----------
    truths
        In order of their instance ids; objects out of view have none.
    found
        By the segmenter's name.
    uncalibrated
        The same with the scores as the network gives them, of segmenters that calibrate.
    """

    truths: tuple[Truth, ...]
    found: dict[str, tuple[Found, ...]]
    uncalibrated: dict[str, tuple[Found, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class SceneRows:
    """All that is kept of one scene.

    Attributes
    ----------
    category, object_name
        Of the target.
    cluttered
        Whether other objects stand around it.
    temperatures
        By which each calibrating segmenter divides its logits.
    """

    scene_id: str
    category: str
    object_name: str
    cluttered: bool
    frames: tuple[FrameRow, ...]
    temperatures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class TimedScene:
    """Time of one scene's frames, by the segmenter's name, milliseconds."""

    scene_id: str
    milliseconds: dict[str, tuple[float, ...]]
