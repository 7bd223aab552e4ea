"""Average precision of masks: COCO's, evaluated by pycocotools.

AP is the mean of the precisions at 101 recalls and over ten least overlaps from .50 to .95; AP50
and AP75 are those at one (Lin et al. 2014, "Microsoft COCO", and its evaluation code). Up to 100
detections of a frame count; objects that are ignored are COCO's crowds.
"""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from harness.native import CLASS_NAMES
from harness.segmentation.masks import box, pixels

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy.typing as npt

    from harness.segmentation.rows import Found, Truth

    Floats = npt.NDArray[np.float64]
    Flags = npt.NDArray[np.bool_]

MOST_DETECTIONS = 100
LEAST_OVERLAPS = np.linspace(0.5, 0.95, 10)
RECALLS = np.linspace(0.0, 1.0, 101)
HALF, THREE_QUARTERS = 0, 5
"""Where .50 and .75 stand in `LEAST_OVERLAPS`."""


@dataclass(frozen=True, eq=False)
class OfCategory:
    """The detections of one category in all frames, by falling score, as pycocotools judged them.

    Attributes
    ----------
    truths : (frames,) float64
        Objects that count.
    frame : (n,) int64
        Of each detection.
    right, wrong : (overlaps, n) bool
        At each least overlap; neither where the detection is of an ignored object.
    """

    category: str
    truths: Floats
    frame: npt.NDArray[np.int64]
    right: Flags
    wrong: Flags


def judge(frames: Sequence[tuple[Sequence[Truth], Sequence[Found]]]) -> list[OfCategory]:
    """Let pycocotools match detections with objects, in each frame and category."""
    with redirect_stdout(io.StringIO()):
        evaluation = COCOeval(*_datasets(frames), iouType="segm")
        evaluation.params.areaRng = [[0, 1e10]]
        evaluation.params.areaRngLbl = ["all"]
        evaluation.params.maxDets = [MOST_DETECTIONS]
        evaluation.evaluate()
    # By category, then frame; None where a frame has neither objects nor detections of a category.
    judged: list[Any] = evaluation.evalImgs
    return [
        _collect(name, judged[number * len(frames) : (number + 1) * len(frames)])
        for number, name in enumerate(CLASS_NAMES[1:])
    ]


def average_precision(of: OfCategory, weights: Floats) -> Floats:
    """Average precision at each least overlap, of each of several draws of frames.

    The same as pycocotools accumulates from a data set that holds a frame as often as its weight
    says.

    Parameters
    ----------
    of
        The judged detections.
    weights : (draws, frames) float64
        How often each draw has each frame.

    Returns
    -------
    precision : (draws, overlaps) float64
        NaN where a draw has no object of the category.
    """
    objects = weights @ of.truths
    mean = np.full((len(weights), len(LEAST_OVERLAPS)), np.nan)
    times = weights[:, of.frame]
    for column, (right, wrong) in enumerate(zip(of.right, of.wrong, strict=True)):
        hits = np.cumsum(times * right, axis=1)
        total = hits + np.cumsum(times * wrong, axis=1)
        precision = hits / (total + np.spacing(1.0))
        # The precision at a recall is the best at it or any higher one.
        precision = np.maximum.accumulate(precision[:, ::-1], axis=1)[:, ::-1]
        for row in np.flatnonzero(objects > 0):
            reached = np.searchsorted(hits[row] / objects[row], RECALLS, side="left")
            within = reached < len(of.frame)
            mean[row, column] = precision[row, reached[within]].sum() / len(RECALLS)
    return mean


def _datasets(frames: Sequence[tuple[Sequence[Truth], Sequence[Found]]]) -> Iterator[COCO]:
    """Describe objects and detections as two COCO data sets."""
    true: list[list[tuple[Truth | Found, dict[str, float]]]] = [
        [(item, {"iscrowd": int(item.ignored)}) for item in truths] for truths, _ in frames
    ]
    found: list[list[tuple[Truth | Found, dict[str, float]]]] = [
        [(item, {"iscrowd": 0, "score": item.score}) for item in seen] for _, seen in frames
    ]
    for side in (true, found):
        rows = [(image, *entry) for image, entries in enumerate(side) for entry in entries]
        sizes = {image: item.mask["size"] for image, item, _ in rows}
        dataset = COCO()
        dataset.dataset = {
            "images": [
                {"id": image, "height": height, "width": width}
                for image, (height, width) in enumerate(
                    sizes.get(image, (0, 0)) for image in range(len(frames))
                )
            ],
            "categories": [{"id": CLASS_NAMES.index(name)} for name in CLASS_NAMES[1:]],
            "annotations": [
                {
                    # COCO takes a match with annotation 0 for none.
                    "id": number,
                    "image_id": image,
                    "category_id": CLASS_NAMES.index(item.category),
                    "segmentation": item.mask,
                    "area": pixels(item.mask),
                    "bbox": box(item.mask),
                    **more,
                }
                for number, (image, item, more) in enumerate(rows, start=1)
            ],
        }
        dataset.createIndex()
        yield dataset


def _collect(category: str, judged: Sequence[dict[str, Any] | None]) -> OfCategory:
    truths = np.zeros(len(judged))
    frame, scores, right, ignored = [], [], [], []
    for number, item in enumerate(judged):
        if item is None:
            continue
        truths[number] = np.count_nonzero(np.asarray(item["gtIgnore"]) == 0)
        scores.append(np.asarray(item["dtScores"], dtype=np.float64))
        frame.append(np.full(len(item["dtScores"]), number))
        right.append(np.asarray(item["dtMatches"]) > 0)
        ignored.append(np.asarray(item["dtIgnore"], dtype=bool))
    if not frame:
        none = np.zeros((len(LEAST_OVERLAPS), 0), dtype=bool)
        return OfCategory(category, truths, np.zeros(0, dtype=np.int64), none, none)
    # Equal scores keep their order, as in pycocotools.
    order = np.argsort(-np.concatenate(scores), kind="stable")
    matched = np.concatenate(right, axis=1)[:, order]
    counts = ~np.concatenate(ignored, axis=1)[:, order]
    return OfCategory(
        category, truths, np.concatenate(frame)[order], matched & counts, ~matched & counts
    )
