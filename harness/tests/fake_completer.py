"""Completions without a network, for tests of what is done with them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

NEAR_M = 0.005


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

    def completion(self, object_id: int) -> FakeCompletion | None:
        return self.completed.get(object_id)

    def uncompleted(self, object_id: int) -> str | None:
        return None if object_id in self.completed else self.reason

    def __getattr__(self, name: str) -> Any:
        return getattr(self.pipeline, name)


def fake_completion(points_world: np.ndarray, *, spread_m: float = 0.003) -> FakeCompletion:
    """Points with one spread for all."""
    return FakeCompletion(points_world, np.full(len(points_world), spread_m))
