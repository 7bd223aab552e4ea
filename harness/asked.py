"""The points that classifiers are asked about, test set by test set, all in one question."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from harness.drawn_points import draw_test_points
from harness.protocol import COMPLETED, HasCompleter, completion_name

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy.typing as npt

    from sim_scenes import SceneObject

    Floats = npt.NDArray[np.float64]


class Completion(Protocol):
    """What is needed of a completed object."""

    @property
    def points_world(self) -> Floats:
        """Points (n, 3), metres; every prefix is spread evenly over the surface."""
        ...

    @property
    def spread_m(self) -> Floats:
        """Expected distance (n,) of each from the true surface, metres."""
        ...

    @property
    def confidence(self) -> Floats:
        """Probability (n,) that each lies within 5 mm of the true surface."""
        ...

    def write_ply(self, path: Path) -> None:
        """Write points and spreads as a PLY file."""
        ...


class Completes(HasCompleter, Protocol):
    """What is needed of a pipeline."""

    def completion(self, object_id: int) -> Completion | None:
        """Completed shape of a mapped object, if it has one."""
        ...

    def uncompleted(self, object_id: int) -> str | None:
        """Why it has none."""
        ...


@dataclass(frozen=True, eq=False)
class AskedPoints:
    """The points of one test set.

    Attributes
    ----------
    completion
        The completion that its records state.
    points_world : (n, 3) float64
        Metres.
    confidence : (n,) float64
        How sure the completer is of each; 1 for points that none made.
    part
        Those of the concatenated points of all test sets.
    """

    completion: str
    points_world: Floats
    confidence: Floats
    part: slice


@dataclass(frozen=True)
class MissingPoints:
    """A test set without points, and why it has none."""

    completion: str
    reason: str


def gather_test_sets(
    test_sets: Sequence[str],
    *,
    target: SceneObject,
    object_id: int,
    pipeline: Completes,
    count: int,
    seed: int,
) -> tuple[list[AskedPoints], list[MissingPoints]]:
    """Draw the points of test sets, or take them from the completed shape of an object.

    Parameters
    ----------
    test_sets
        Their names, in the order of the points.
    target
        The object as it truly is, for the sets that are drawn.
    object_id
        The mapped object that stands for it, for the completed set.
    pipeline
        The map.
    count
        Points of each set; a completion of fewer gives all it has.
    seed
        Of the draws.
    """
    asked: list[AskedPoints] = []
    missing: list[MissingPoints] = []
    start = 0
    for test_set in test_sets:
        name = completion_name(test_set, pipeline)
        if test_set != COMPLETED:
            points = draw_test_points(target, test_set=test_set, count=count, seed=seed)
            confidence = np.ones(len(points))
        elif (completion := pipeline.completion(object_id)) is not None:
            points = np.ascontiguousarray(completion.points_world[:count])
            confidence = np.ascontiguousarray(completion.confidence[:count])
        else:
            missing.append(MissingPoints(name, no_completion(pipeline, object_id)))
            continue
        asked.append(AskedPoints(name, points, confidence, slice(start, start + len(points))))
        start += len(points)
    return asked, missing


def no_completion(pipeline: Completes, object_id: int) -> str:
    """Say why an object has no completion."""
    reason = pipeline.uncompleted(object_id) or "the pipeline gives no reason"
    return f"object {object_id} has no completion: {reason}"
