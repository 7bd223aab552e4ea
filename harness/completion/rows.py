"""What the report measures on one scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from harness.completion.metrics import CloudScore
    from harness.completion.spread import SpreadScore

UNREFINED = ", unrefined"


@dataclass(frozen=True)
class Completer:
    """A completer as the report runs it.

    Attributes
    ----------
    setting
        ``pipeline.completer``: ``cloud``, ``centersnap`` or ``python:module.function``.
    refine
        Whether its clouds are registered to the observed points.
    """

    setting: str
    refine: bool = True

    @property
    def name(self) -> str:
        """Name of its rows."""
        function = self.setting.removeprefix("python:").rpartition(".")[2]
        return function if self.refine else function + UNREFINED


@dataclass(frozen=True)
class CloudRow:
    """A cloud's scores on one part of the surface.

    Attributes
    ----------
    cloud
        Name of a completer or a baseline.
    part
        ``all``, ``seen`` or ``unseen``.
    """

    cloud: str
    part: str
    score: CloudScore


@dataclass(frozen=True)
class HandleRow:
    """What a completer made of a mug's handle.

    Attributes
    ----------
    seen_share
        Share of the handle's surface that the views saw.
    outcome
        ``right``, ``wrong place`` or ``left out``.
    distance_mm
        Mean distance of the handle's surface to the cloud.
    spread_at_handle_mm
        Mean spread of the points nearest to the handle's surface, where it truly is.
    spread_made_mm
        Mean spread of the points that the completer put clear of the body; None where it made none.
    spread_mm
        Mean spread of all points.
    """

    cloud: str
    seen_share: float
    outcome: str
    distance_mm: float
    spread_at_handle_mm: float
    spread_made_mm: float | None
    spread_mm: float


@dataclass(frozen=True)
class ViewsRow:
    """The fused cloud of several views beside the single views' own.

    Attributes
    ----------
    fused_mm, best_mm, mean_mm
        Chamfer distance of the fused cloud, and the least and the mean of the single views'.
    views
        Number of views that gave a cloud of their own.
    """

    cloud: str
    fused_mm: float
    best_mm: float
    mean_mm: float
    views: int


@dataclass(frozen=True)
class LatencyRow:
    """Time of a stage per frame.

    Attributes
    ----------
    stage
        ``complete`` or ``refine``; ``total`` is both.
    objects
        Objects in the scene.
    """

    cloud: str
    stage: str
    objects: int
    milliseconds: float


@dataclass(frozen=True)
class SceneRows:
    """All that is measured on one scene.

    Attributes
    ----------
    unseen_share
        Share of the target's surface that no view saw.
    spreads
        By completer.
    uncompleted
        Why a completer gave no cloud, by its name.
    """

    scene_id: str
    category: str
    object_name: str
    unseen_share: float
    clouds: tuple[CloudRow, ...]
    spreads: dict[str, SpreadScore] = field(default_factory=dict)
    handles: tuple[HandleRow, ...] = ()
    views: tuple[ViewsRow, ...] = ()
    latencies: tuple[LatencyRow, ...] = ()
    uncompleted: dict[str, str] = field(default_factory=dict)
