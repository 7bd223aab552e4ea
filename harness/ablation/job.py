"""A scene under every cell of a grid, as a job and as its result."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.config import Config
    from harness.runs.job import SceneJob
    from harness.runs.records import SceneResult


@dataclass(frozen=True)
class CellScene:
    """A scene under one cell: the cell's short hash, its plan's job, and its configuration."""

    cell: str
    job: SceneJob
    config: Config


@dataclass(frozen=True)
class SceneCells:
    """A scene under all cells that lack it."""

    scene_id: str
    parts: tuple[CellScene, ...]


@dataclass(frozen=True)
class CellResults:
    """What a scene yields.

    Attributes
    ----------
    results, failures
        By cell: its result, or why it has none.
    computed
        How often each stage was computed for all of them.
    """

    results: Mapping[str, SceneResult] = field(default_factory=dict)
    failures: Mapping[str, str] = field(default_factory=dict)
    computed: Mapping[str, int] = field(default_factory=dict)
