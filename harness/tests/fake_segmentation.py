"""Scenes of the segmentation report without a simulator or a network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.segmentation.masks import encode
from harness.segmentation.rows import Found, FrameRow, SceneRows, TimedScene, Truth

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.config import Config
    from harness.runs.job import SceneJob
    from harness.segmentation.scene import Plan

SCENE_FUNCTION = f"{__name__}:find_instances"
TIMING_FUNCTION = f"{__name__}:time_scene"
SIZE = (24, 32)


def mask(left: int, width: int = 8, *, top: int = 4, height: int = 10) -> np.ndarray:
    """A rectangle in an image of `SIZE`."""
    pixels = np.zeros(SIZE, dtype=bool)
    pixels[top : top + height, left : left + width] = True
    return pixels


def truth(
    left: int, category: str = "mug", *, name: str = "", width: int = 8, ignored: bool = False
) -> Truth:
    return Truth(name or f"{category}_0", category, encode(mask(left, width)), ignored)


def found(left: int, category: str = "mug", *, score: float = 0.9, width: int = 8) -> Found:
    return Found(category, score, encode(mask(left, width)))


@dataclass(frozen=True)
class FakeDetection:
    mask: np.ndarray
    category: str
    score: float


@dataclass(frozen=True)
class PerturbedMasks:
    """A segmenter that finds the true masks a pixel to the right, sure by a half or more."""

    categories: Mapping[int, str]
    ids: np.ndarray
    temperature: float | None = None

    def segment(self, **frame: Any) -> list[FakeDetection]:
        return [
            FakeDetection(np.roll(self.ids == number, 1, axis=1), name, 0.5 + 0.1 * number)
            for number, name in self.categories.items()
        ]


def find_instances(job: SceneJob, config: Config, plan: Plan) -> SceneRows:
    """Two frames: one found a pixel off, one missed in every third scene."""
    del config
    missed = job.seed % 3 == 0
    wrong = found(20, "can", score=0.2, width=6)
    frames = tuple(
        FrameRow(
            truths=(truth(4, job.category, name=job.object_name),),
            found={
                item.name: (wrong,)
                if missed and number
                else (found(5, job.category, score=0.8), wrong)
                for item in plan.choices
            },
            uncalibrated={
                item.name: (found(5, job.category, score=0.99),) for item in plan.choices
            },
        )
        for number in range(2)
    )
    temperatures = {item.name: 1.5 for item in plan.choices}
    return SceneRows(
        job.scene_id, job.category, job.object_name, job.cluttered, frames, temperatures
    )


def time_scene(job: SceneJob, config: Config, plan: Plan) -> TimedScene:
    del config
    return TimedScene(job.scene_id, {item.name: (100.0, 120.0) for item in plan.choices})
