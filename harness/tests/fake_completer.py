"""Completions without a network, for tests of what is done with them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

NEAR_M = 0.005
LEAST_PIXELS = 20
OWN = f"python:{__name__}.complete_observed"


@dataclass(frozen=True, eq=False)
class FakeCompletion:
    """A completed shape as the pipeline hands it out."""

    points_world: np.ndarray
    spread_m: np.ndarray

    @property
    def confidence(self) -> np.ndarray:
        return np.asarray(1.0 - np.exp(-NEAR_M / self.spread_m))

    def write_ply(self, path: Path) -> None:
        path.write_text(f"{len(self.points_world)} points", encoding="utf-8")


@dataclass(frozen=True, eq=False)
class FakeCompletions:
    """The part of a pipeline that completes; all else is asked of `pipeline`."""

    completer: str = "cloud"
    completed: dict[int, FakeCompletion] = field(default_factory=dict)
    reason: str = "3 of its pixels have a valid depth"
    pipeline: Any = None
    segmenter: str = "oracle"

    def completion(self, object_id: int) -> FakeCompletion | None:
        return self.completed.get(object_id)

    def uncompleted(self, object_id: int) -> str | None:
        return None if object_id in self.completed else self.reason

    def __getattr__(self, name: str) -> Any:
        return getattr(self.pipeline, name)


def fake_completion(points_world: np.ndarray, *, spread_m: float = 0.003) -> FakeCompletion:
    """Points with one spread for all."""
    return FakeCompletion(points_world, np.full(len(points_world), spread_m))


def complete_observed(
    *,
    rgb: np.ndarray,
    depth_m: np.ndarray,
    intrinsics: tuple[float, float, float, float],
    world_from_camera: np.ndarray,
    masks: np.ndarray,
    categories: list[str],
) -> list[tuple[np.ndarray, np.ndarray | None] | None]:
    """A completer from outside: what was observed, and a copy 5 mm behind it, of more doubt."""
    fx, fy, cx, cy = intrinsics
    found: list[tuple[np.ndarray, np.ndarray | None] | None] = []
    for mask in masks:
        v, u = np.nonzero(mask & np.isfinite(depth_m))
        if len(u) < LEAST_PIXELS:
            found.append(None)
            continue
        z = depth_m[v, u].astype(np.float64)
        rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(len(u))], axis=1)
        points = np.concatenate([rays * z[:, None], rays * (z[:, None] + 0.005)])
        found.append((points, np.repeat([0.002, 0.006], len(u))))
    return found


def complete_nothing(**frame: Any) -> list[None]:
    """A completer that declines every object."""
    return [None] * len(frame["masks"])
