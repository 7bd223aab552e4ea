"""The numbers of the report.

Single and cluttered scenes have theirs apart and together. Precision and calibration have
percentile intervals (`harness.segmentation.resampling`), means those of `harness.statistics`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.segmentation.calibration import ReliabilityBin
    from harness.statistics import MeanEstimate

SINGLE, CLUTTERED, POOLED = "single", "cluttered", "all"
ALL_CATEGORIES = "all categories"
BACKGROUND = "background"
MISSED = "missed"


@dataclass(frozen=True)
class Precision:
    """Average precision of masks, see `harness.segmentation.precision`.

    Attributes
    ----------
    scenes
        ``single``, ``cluttered`` or ``all``.
    category
        A category, or ``all categories``: the mean over those that have objects.
    truths, objects
        Number of objects in frames that count, and of the models they are of.
    """

    segmenter: str
    scenes: str
    category: str
    truths: int
    objects: int
    ap: MeanEstimate
    ap50: MeanEstimate
    ap75: MeanEstimate


@dataclass(frozen=True)
class Finding:
    """What becomes of the objects at the score from which on the map takes detections.

    Attributes
    ----------
    recall
        Share of the objects found: right category, an overlap of at least one half.
    iou
        Mean overlap of those found.
    """

    segmenter: str
    scenes: str
    category: str
    recall: MeanEstimate
    iou: MeanEstimate


@dataclass(frozen=True)
class FalseFinds:
    """Detections per frame that are of nothing, at the score from which on the map takes them."""

    segmenter: str
    scenes: str
    per_frame: MeanEstimate


@dataclass(frozen=True)
class Confusion:
    """Which category is taken for which, at the score from which on the map takes detections.

    Detections are matched with objects whatever their categories.

    Attributes
    ----------
    counts
        By true category, ``background`` for what is no object, then by the category found,
        ``missed`` for objects that nothing was matched with.
    """

    segmenter: str
    scenes: str
    counts: Mapping[str, Mapping[str, int]]


@dataclass(frozen=True)
class Calibration:
    """How far scores can be taken at their word, see `harness.segmentation.calibration`.

    Attributes
    ----------
    calibrated
        Whether these are the scores after calibration, where a segmenter calibrates.
    least_score
        Detections from this score on are counted.
    headline
        Whether this is the figure to name: all detections that the report asks for.
    detections
        Their number; the ignored ones left out.
    share_right
        Of them.
    """

    segmenter: str
    scenes: str
    calibrated: bool
    least_score: float
    headline: bool
    detections: int
    share_right: float | None
    ece: MeanEstimate
    ece_equal_mass: MeanEstimate
    brier: MeanEstimate
    bins: tuple[ReliabilityBin, ...]


@dataclass(frozen=True)
class Latency:
    """Time per frame, milliseconds."""

    segmenter: str
    frames: int
    median_ms: float
    p95_ms: float


@dataclass(frozen=True)
class FrameQuality:
    """Panoptic quality of a frame at the score from which on the map takes detections."""

    segmenter: str
    scene_id: str
    frame: int
    quality: float


@dataclass(frozen=True)
class Report:
    """All that the report states, but for the models' table."""

    scenes: Mapping[str, int]
    frames: Mapping[str, int]
    least_score: float
    temperatures: Mapping[str, float]
    precisions: tuple[Precision, ...]
    findings: tuple[Finding, ...]
    false_finds: tuple[FalseFinds, ...]
    confusions: tuple[Confusion, ...]
    calibrations: tuple[Calibration, ...]
    qualities: tuple[FrameQuality, ...]
    latencies: tuple[Latency, ...]
