"""Masks as COCO's run lengths: small enough to pass between processes and to keep."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from pycocotools import mask as coco_mask

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]
    Flags = npt.NDArray[np.bool_]

RunLengths: TypeAlias = dict[str, Any]
"""A mask as pycocotools encodes it: ``size`` and ``counts``."""


def encode(mask: Flags) -> RunLengths:
    """Encode a mask (h, w)."""
    encoded: RunLengths = coco_mask.encode(np.asfortranarray(mask, dtype=np.uint8))
    return encoded


def decode(encoded: RunLengths) -> Flags:
    """Decode a mask (h, w)."""
    with warnings.catch_warnings():
        # pycocotools 2.0 makes an array as numpy 1 did, which numpy 2 remarks on.
        warnings.simplefilter("ignore", DeprecationWarning)
        return np.asarray(coco_mask.decode(encoded), dtype=bool)


def pixels(encoded: RunLengths) -> int:
    """Count a mask's pixels."""
    return int(coco_mask.area(encoded))


def box(encoded: RunLengths) -> list[float]:
    """Left, top, width and height of the box around a mask, pixels."""
    return [float(value) for value in coco_mask.toBbox(encoded)]


def overlaps(
    found: Sequence[RunLengths], true: Sequence[RunLengths], *, ignored: Sequence[bool]
) -> Floats:
    """Intersection over union (n, m) of found with true masks.

    Of a true mask that is ignored it is the intersection over the found mask's own area, as COCO
    has it for a crowd: a mask that lies within what is ignored is not held against the segmenter.
    """
    if not found or not true:
        return np.zeros((len(found), len(true)))
    table = coco_mask.iou(list(found), list(true), [int(flag) for flag in ignored])
    return np.asarray(table, dtype=np.float64)
