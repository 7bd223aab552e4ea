"""One segmenter on one group of scenes: the numbers that it has there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from harness.native import CLASS_NAMES
from harness.segmentation import calibration
from harness.segmentation.matching import Matched, match
from harness.segmentation.numbers import (
    ALL_CATEGORIES,
    BACKGROUND,
    MISSED,
    Calibration,
    Confusion,
    FalseFinds,
    Finding,
    FrameQuality,
    Precision,
)
from harness.segmentation.precision import (
    HALF,
    THREE_QUARTERS,
    OfCategory,
    average_precision,
    judge,
)
from harness.segmentation.resampling import Resamples
from harness.segmentation.segmenter import LEAST_SCORE
from harness.statistics import MeanEstimate, mean_estimate

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy.typing as npt

    from harness.segmentation.rows import FrameRow, SceneRows

    Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """One segmenter on one group of scenes.

    Attributes
    ----------
    segmenter, group
        Names in the rows.
    scenes
        Of the group, in order.
    least_score
        From which on the map takes detections.
    seed
        Of the resampling.
    """

    segmenter: str
    group: str
    scenes: Sequence[SceneRows]
    least_score: float
    seed: int

    @cached_property
    def _frames(self) -> list[FrameRow]:
        return [frame for scene in self.scenes for frame in scene.frames]

    @cached_property
    def _targets(self) -> list[str]:
        """The target of each frame's scene: frames of one target share its shape."""
        return [scene.object_name for scene in self.scenes for _ in scene.frames]

    @cached_property
    def _draws(self) -> Resamples:
        return Resamples.draw(self._targets, seed=self.seed)

    @cached_property
    def _taken(self) -> list[Matched]:
        return [
            match(frame.truths, frame.found[self.segmenter], least_score=self.least_score)
            for frame in self._frames
        ]

    def precisions(self) -> Iterable[Precision]:
        """Average precision, of all categories and of each that has objects."""
        judged = judge([(frame.truths, frame.found[self.segmenter]) for frame in self._frames])
        shown = [of for of in judged if of.truths.any()]
        found = [average_precision(of, self._draws.weights) for of in shown]
        if not shown:
            return
        together = np.stack(found)
        # A draw that lacks a category has the mean over the others.
        defined = ~np.isnan(together)
        counts = defined.sum(axis=0)
        sums = np.where(defined, together, 0.0).sum(axis=0)
        mean = np.divide(sums, counts, out=np.full(sums.shape, np.nan), where=counts > 0)
        yield self._precision(ALL_CATEGORIES, shown, mean)
        for of, values in zip(shown, found, strict=True):
            yield self._precision(of.category, [of], values)

    def _precision(self, category: str, of: Sequence[OfCategory], values: Floats) -> Precision:
        names = [item.category for item in of]
        objects = {
            truth.object_name
            for frame in self._frames
            for truth in frame.truths
            if truth.category in names and not truth.ignored
        }
        truths = int(sum(item.truths.sum() for item in of))

        def estimate(of_draws: Floats) -> MeanEstimate:
            least = min(len(objects), self._draws.objects)
            return self._draws.estimate(of_draws, count=truths, objects=least)

        return Precision(
            segmenter=self.segmenter,
            scenes=self.group,
            category=category,
            truths=truths,
            objects=len(objects),
            ap=estimate(values.mean(axis=1)),
            ap50=estimate(values[:, HALF]),
            ap75=estimate(values[:, THREE_QUARTERS]),
        )

    def findings(self) -> Iterable[Finding]:
        """Recall and overlap, of all categories and of each that has objects."""
        objects, categories, overlap = [], [], []
        for taken in self._taken:
            hits = [(pair.truth, pair.iou) for pair in taken.hits]
            for truth, iou in [*hits, *((truth, np.nan) for truth in taken.missed)]:
                if truth is not None:
                    objects.append(truth.object_name)
                    categories.append(truth.category)
                    overlap.append(iou)
        names, of = np.array(objects, dtype=np.str_), np.array(categories, dtype=np.str_)
        values = np.array(overlap, dtype=np.float64)
        shown = [name for name in CLASS_NAMES[1:] if (of == name).any()]
        for category in (ALL_CATEGORIES, *shown):
            chosen = (of == category) | (category == ALL_CATEGORIES)
            found = (~np.isnan(values[chosen])).astype(np.float64)
            yield Finding(
                segmenter=self.segmenter,
                scenes=self.group,
                category=category,
                recall=mean_estimate(found, objects=names[chosen], seed=self.seed),
                iou=mean_estimate(values[chosen], objects=names[chosen], seed=self.seed),
            )

    def false_finds(self) -> FalseFinds:
        """Count detections of nothing per frame."""
        counts = np.array([len(taken.wrong) for taken in self._taken], dtype=np.float64)
        targets = np.array(self._targets, dtype=np.str_)
        return FalseFinds(
            self.segmenter, self.group, mean_estimate(counts, objects=targets, seed=self.seed)
        )

    def confusion(self) -> Confusion:
        """Count which category is taken for which."""
        counts = {
            true: dict.fromkeys((*CLASS_NAMES[1:], MISSED), 0)
            for true in (*CLASS_NAMES[1:], BACKGROUND)
        }
        for frame in self._frames:
            matched = match(
                frame.truths,
                frame.found[self.segmenter],
                least_score=self.least_score,
                by_category=False,
            )
            for pair in matched.hits + matched.wrong:
                true = BACKGROUND if pair.truth is None else pair.truth.category
                counts[true][pair.found.category] += 1
            for truth in matched.missed:
                counts[truth.category][MISSED] += 1
        return Confusion(self.segmenter, self.group, counts)

    def calibrations(self) -> Iterable[Calibration]:
        """Calibration before and after, of all detections and of those that the map takes."""
        before = any(self.segmenter in frame.uncalibrated for frame in self._frames)
        for calibrated in (False, True) if before else (True,):
            matched = [
                match(
                    frame.truths,
                    (frame.found if calibrated else frame.uncalibrated)[self.segmenter],
                )
                for frame in self._frames
            ]
            for least in dict.fromkeys((LEAST_SCORE, self.least_score)):
                yield self._calibration(matched, calibrated=calibrated, least=least)

    def _calibration(
        self, matched: Sequence[Matched], *, calibrated: bool, least: float
    ) -> Calibration:
        judged = [
            (number, pair.found.score, pair.right)
            for number, taken in enumerate(matched)
            for pair in taken.pairs
            if pair.found.score >= least and not pair.ignored
        ]
        frame = np.array([number for number, _, _ in judged], dtype=np.int64)
        scores = np.array([score for _, score, _ in judged], dtype=np.float64)
        right = np.array([flag for _, _, flag in judged], dtype=bool)
        weights = self._draws.weights[:, frame]

        def estimate(values: Floats) -> MeanEstimate:
            return self._draws.estimate(values, count=len(judged))

        ece = calibration.calibration_error
        return Calibration(
            segmenter=self.segmenter,
            scenes=self.group,
            calibrated=calibrated,
            least_score=least,
            headline=least == LEAST_SCORE,
            detections=len(judged),
            share_right=float(right.mean()) if judged else None,
            ece=estimate(ece(scores, right, calibration.equal_width(scores), weights)),
            ece_equal_mass=estimate(ece(scores, right, calibration.equal_mass(scores), weights)),
            brier=estimate(calibration.brier(scores, right, weights)),
            bins=calibration.reliability(scores, right),
        )

    def qualities(self) -> Iterable[FrameQuality]:
        """Panoptic quality of every frame that shows or was given anything."""
        names = [(scene.scene_id, n) for scene in self.scenes for n in range(len(scene.frames))]
        for (scene_id, number), taken in zip(names, self._taken, strict=True):
            if (quality := taken.quality) is not None:
                yield FrameQuality(self.segmenter, scene_id, number, quality)
