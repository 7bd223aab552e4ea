"""The one door to Rust: everything that Python uses of the compiled extension.

Points are ``(n, 3) float64`` arrays in world metres, C-contiguous. Classes are indices: 0 is free
space, 1 to 6 the categories of `CLASS_NAMES`. A wrong shape or type raises an error that names the
argument; a file that cannot be read or written raises OSError; a value that makes no sense raises
ValueError.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from harness._native import (
    Completion,
    Detection,
    Hyperparameters,
    MappedObject,
    MeshTruth,
    OccupancyMap,
    Pipeline,
    Predictions,
    Segmenter,
    TrainingSet,
    Voxels,
    binary_metrics,
    check_pipeline_config,
    gp_log_likelihood,
    gp_posterior,
    nearest_observation,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

Floats = npt.NDArray[np.float64]


class SegmenterFunction(Protocol):
    """What ``segmenter = "python:module.function"`` names: a function that finds objects.

    It is imported where the pipeline is made, in worker processes too, and called for every frame.
    An exception that it raises, or an answer that breaks this protocol, raises ValueError in
    `Pipeline.add_frame` and `Segmenter.segment`, whose cause is that exception; the map is
    unchanged.
    """

    def __call__(
        self,
        *,
        rgb: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        intrinsics: tuple[float, float, float, float],
        world_from_camera: Floats,
    ) -> Iterable[Mapping[str, Any] | object]:
        """Find the objects in a frame.

        Parameters
        ----------
        rgb : (h, w, 3) uint8
        depth_m : (h, w) float32
            Along the optical axis, metres; NaN where nothing was measured.
        intrinsics
            fx, fy, cx, cy in pixels; the centre of the first pixel is (0, 0).
        world_from_camera : (4, 4) float64
            Camera axes are x right, y down, z forward; the world's z points up.

        Returns
        -------
        Iterable
            One detection for each object, none where nothing is in view: a mapping with these keys,
            or an object with these attributes.

            ``mask`` : (h, w) bool
                The object's pixels, at least one.
            ``category``
                Its name, one of `CLASS_NAMES` but ``"free"``.
            ``class_scores`` : (6,) float64
                In place of ``category``: the probability of each category, in the order of
                `CLASS_NAMES` after ``"free"``. What they leave of 1 is that of being none of them.
            ``score``
                How probable it is that the detection is right, from 0 to 1. It can be left out
                beside ``class_scores``, and is their largest then; ``category`` is taken to have
                this probability, and the other categories none.
        """
        ...


class CompleterFunction(Protocol):
    """What ``completer = "python:module.function"`` names: a function that completes shapes.

    It is imported where the pipeline is made, in worker processes too, and called for every frame
    with an object in view. An exception that it raises, or an answer that breaks this protocol,
    raises ValueError in `Pipeline.add_frame` and `Pipeline.complete_frame`, whose cause is that
    exception; the pipeline is unchanged.
    """

    def __call__(
        self,
        *,
        rgb: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        intrinsics: tuple[float, float, float, float],
        world_from_camera: Floats,
        masks: npt.NDArray[np.bool_],
        categories: list[str],
    ) -> Sequence[tuple[Floats, Floats | None] | None]:
        """Complete the objects in a frame.

        Parameters
        ----------
        rgb : (h, w, 3) uint8
        depth_m : (h, w) float32
            Along the optical axis, metres; NaN where nothing was measured.
        intrinsics
            fx, fy, cx, cy in pixels; the centre of the first pixel is (0, 0).
        world_from_camera : (4, 4) float64
            Camera axes are x right, y down, z forward; the world's z points up.
        masks : (n, h, w) bool
            The pixels of each of n objects.
        categories
            Their names.

        Returns
        -------
        Sequence
            One entry for each object, in their order: None if it is not completed, or
            ``(points_camera, spread_m)``: points on its whole surface, (k, 3) float64, metres, in
            the camera's frame, and the expected distance of each from the true surface, (k,)
            float64, metres. None in place of the latter claims no doubt: a confidence of 1.
        """
        ...


CLASS_NAMES = ("free", "bottle", "bowl", "camera", "can", "laptop", "mug")

__all__ = [
    "CLASS_NAMES",
    "CompleterFunction",
    "Completion",
    "Detection",
    "Hyperparameters",
    "MappedObject",
    "MeshTruth",
    "OccupancyMap",
    "Pipeline",
    "Predictions",
    "Segmenter",
    "SegmenterFunction",
    "TrainingSet",
    "Voxels",
    "binary_metrics",
    "check_pipeline_config",
    "gp_log_likelihood",
    "gp_posterior",
    "nearest_observation",
]
