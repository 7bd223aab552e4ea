"""What keeping the confident points costs: the share of false ones, by threshold and object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.statistics import MeanEstimate, mean_estimate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.calibration.series import ScenePoints

Floats = npt.NDArray[np.float64]

THRESHOLDS: Floats = np.arange(991) / 1000.0
"""Confidences among which a threshold is chosen, fixed beforehand. They end at 0.99: a scene keeps
few points above, of which a single false one would be a large share."""

CONFIDENCE = "confidence"
"""The series that is thresholded."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Losses:
    """Shares of false points among the kept ones.

    Attributes
    ----------
    objects : (n,) str
        Class and name of each object.
    false_share : (n, thresholds) float64
        At `THRESHOLDS`: mean over the object's scenes of the share of the kept points, those with
        at least this confidence, that do not lie on the mesh; 0 of a scene that keeps none. The
        mean over objects is what is to be expected in a scene of a new object, however many scenes
        each has here.
    """

    objects: npt.NDArray[np.str_]
    false_share: Floats

    def of(self, chosen: npt.NDArray[np.intp]) -> Losses:
        """Losses of some of the objects, by index."""
        return Losses(objects=self.objects[chosen], false_share=self.false_share[chosen])


@dataclass(frozen=True, kw_only=True)
class Kept:
    """What a threshold keeps of scenes; means over scenes, with intervals over objects.

    Attributes
    ----------
    threshold
        Points of at least this confidence are kept.
    precision
        Share of the kept points that lie on the mesh; 1 of a scene that keeps none, as in
        `Losses`.
    precision_where_kept
        The same of the scenes that keep a point.
    kept
        Share of the test points that are kept.
    recall
        Share of the test points on the mesh that are kept; undefined in a scene without one.
    scenes, objects, empty
        Number of scenes, of objects, and of scenes that keep none.
    """

    threshold: float
    precision: MeanEstimate
    precision_where_kept: MeanEstimate
    kept: MeanEstimate
    recall: MeanEstimate
    scenes: int
    objects: int
    empty: int


def object_losses(scenes: Sequence[ScenePoints]) -> Losses:
    """Measure every threshold on every object.

    Parameters
    ----------
    scenes
        Each with points; of any classes.
    """
    kept, false = np.zeros((2, len(scenes), len(THRESHOLDS)))
    for index, scene in enumerate(scenes):
        confidence = scene.on_object[CONFIDENCE]
        kept[index] = _count(confidence)
        false[index] = _count(confidence[~scene.truth])
    names, member = np.unique(object_names(scenes), return_inverse=True)
    share = np.divide(false, kept, out=np.zeros_like(false), where=kept > 0)
    total = np.zeros((len(names), len(THRESHOLDS)))
    np.add.at(total, member, share)
    return Losses(objects=names, false_share=total / np.bincount(member)[:, np.newaxis])


def judge_threshold(scenes: Sequence[ScenePoints], threshold: float, *, seed: int) -> Kept:
    """Measure what a threshold keeps of scenes.

    Parameters
    ----------
    scenes
        Each with points.
    threshold
        Points of at least this confidence are kept.
    seed
        Of the intervals' resampling.
    """
    rows = []
    for scene in scenes:
        keep = scene.on_object[CONFIDENCE] >= threshold
        kept, right = np.count_nonzero(keep), np.count_nonzero(keep & scene.truth)
        on_mesh = np.count_nonzero(scene.truth)
        rows.append(
            (
                right / kept if kept else 1.0,
                right / kept if kept else np.nan,
                kept / len(keep),
                right / on_mesh if on_mesh else np.nan,
            )
        )
    objects = object_names(scenes)
    precision, where_kept, kept_share, recall = (
        mean_estimate(np.array(column), objects=objects, seed=seed)
        for column in zip(*rows, strict=True)
    )
    return Kept(
        threshold=threshold,
        precision=precision,
        precision_where_kept=where_kept,
        kept=kept_share,
        recall=recall,
        scenes=len(scenes),
        objects=len(np.unique(objects)),
        empty=len(scenes) - where_kept.count,
    )


def object_names(scenes: Sequence[ScenePoints]) -> npt.NDArray[np.str_]:
    """Name the object (scenes,) of each scene by class and name."""
    return np.array([f"{scene.category}/{scene.object_name}" for scene in scenes], dtype=np.str_)


def _count(confidence: Floats) -> npt.NDArray[np.intp]:
    """Count the confidences (n,) at or above each threshold (thresholds,)."""
    return len(confidence) - np.searchsorted(np.sort(confidence), THRESHOLDS, side="left")
