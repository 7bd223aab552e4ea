"""Which detection is of which object.

Detections are taken by falling score, each with the true object that it overlaps most of those yet
unmatched, if by at least `LEAST_IOU`: COCO's rule. A detection without an object is wrong, unless
it lies for the most part on an object of which too little is in view to count.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.segmentation.masks import overlaps

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.segmentation.rows import Found, Truth

LEAST_IOU = 0.5


@dataclass(frozen=True)
class Pair:
    """A detection and the object that it was matched with.

    Attributes
    ----------
    truth
        None without one.
    iou
        Overlap with it; 0 without one.
    ignored
        Whether the detection is of an object that does not count, so that it is neither right nor
        wrong.
    """

    found: Found
    truth: Truth | None
    iou: float
    ignored: bool

    @property
    def right(self) -> bool:
        """Whether it found an object."""
        return self.truth is not None


@dataclass(frozen=True)
class Matched:
    """The matches of one frame.

    Attributes
    ----------
    pairs
        One for each detection, by falling score.
    missed
        Objects that count and that no detection found.
    """

    pairs: tuple[Pair, ...]
    missed: tuple[Truth, ...]

    @property
    def hits(self) -> tuple[Pair, ...]:
        """Detections of an object."""
        return tuple(pair for pair in self.pairs if pair.right)

    @property
    def wrong(self) -> tuple[Pair, ...]:
        """Detections of nothing."""
        return tuple(pair for pair in self.pairs if not pair.right and not pair.ignored)

    @property
    def quality(self) -> float | None:
        """Panoptic quality in [0, 1]; None of a frame without objects and detections.

        Sum of the matches' overlaps over (matches + half of the wrong + half of the missed):
        Kirillov et al. 2019, "Panoptic Segmentation".
        """
        unmatched = len(self.wrong) + len(self.missed)
        if not self.hits and not unmatched:
            return None
        return sum(pair.iou for pair in self.hits) / (len(self.hits) + unmatched / 2)


def match(
    truths: Sequence[Truth],
    found: Sequence[Found],
    *,
    least_score: float = 0.0,
    by_category: bool = True,
) -> Matched:
    """Match the detections of one frame with its objects.

    Parameters
    ----------
    truths, found
        The frame's; `found` in any order.
    least_score
        Detections below it are left out.
    by_category
        Whether only an object of the detection's category will do.
    """
    ordered = sorted(
        (item for item in found if item.score >= least_score), key=lambda item: -item.score
    )
    ignored = np.array([item.ignored for item in truths], dtype=bool)
    table = overlaps(
        [item.mask for item in ordered], [item.mask for item in truths], ignored=ignored.tolist()
    )
    free = ~ignored
    pairs = []
    for item, row in zip(ordered, table, strict=True):
        alike = np.array(
            [not by_category or truth.category == item.category for truth in truths], dtype=bool
        )
        fits = alike & (row >= LEAST_IOU)
        if (candidates := fits & free).any():
            best = int(np.where(candidates, row, -1.0).argmax())
            free[best] = False
            pairs.append(Pair(item, truths[best], float(row[best]), ignored=False))
        else:
            pairs.append(Pair(item, None, 0.0, ignored=bool((fits & ignored).any())))
    missed = tuple(truth for truth, left in zip(truths, free, strict=True) if left)
    return Matched(tuple(pairs), missed)
