from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Self, final

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]

__all__ = [
    "Completion",
    "Detection",
    "Hyperparameters",
    "MappedObject",
    "MeshTruth",
    "OccupancyMap",
    "Pipeline",
    "Predictions",
    "Segmenter",
    "TrainingSet",
    "Voxels",
    "binary_metrics",
    "check_pipeline_config",
    "gp_log_likelihood",
    "gp_posterior",
    "nearest_observation",
]

def check_pipeline_config(text: str) -> str: ...
def gp_log_likelihood(
    *,
    points: _Floats,
    labels: npt.NDArray[np.uint8],
    lengthscales: _Floats,
    outputscales: _Floats,
    means: _Floats,
    smoothness: str = "5/2",
) -> tuple[_Floats, _Floats]: ...
def gp_posterior(
    *,
    points: _Floats,
    labels: npt.NDArray[np.uint8],
    test_points: _Floats,
    lengthscales: _Floats,
    outputscales: _Floats,
    means: _Floats,
    smoothness: str = "5/2",
) -> tuple[_Floats, _Floats]: ...
def binary_metrics(
    *,
    predicted: npt.NDArray[np.bool_],
    truth: npt.NDArray[np.bool_],
    probability: _Floats | None = None,
    decision_confidence: _Floats | None = None,
) -> dict[str, float | int | None]: ...
def nearest_observation(*, points: _Floats, observed: _Floats) -> _Floats: ...

@final
class MeshTruth:
    def __new__(cls, vertices: _Floats, faces: npt.NDArray[np.uint32]) -> Self: ...
    @property
    def degenerate_faces(self) -> int: ...
    def distances(self, points: _Floats) -> _Floats: ...
    def ray_depths(self, origins: _Floats, directions: _Floats) -> _Floats: ...

@final
class OccupancyMap:
    def __new__(cls, resolution_m: float = 0.005) -> Self: ...
    @staticmethod
    def read(path: str | PathLike[str]) -> OccupancyMap: ...
    @property
    def resolution_m(self) -> float: ...
    def insert_scan(
        self, origin_world: _Floats, points_world: _Floats, max_range_m: float | None = None
    ) -> None: ...
    def leaves(self) -> tuple[_Floats, _Floats, npt.NDArray[np.float32]]: ...
    def write_bt(self, path: str | PathLike[str]) -> None: ...
    def write_ot(self, path: str | PathLike[str]) -> None: ...

@final
class MappedObject:
    @property
    def id(self) -> int: ...
    @property
    def category(self) -> str: ...
    @property
    def score(self) -> float: ...
    @property
    def views(self) -> int: ...
    @property
    def centroid_world(self) -> _Floats: ...
    @property
    def points_world(self) -> _Floats: ...
    @property
    def rgb(self) -> npt.NDArray[np.uint8]: ...
    def write_ply(self, path: str | PathLike[str]) -> None: ...

@final
class Completion:
    """An object's completed shape in the world.

    ``points_world`` (n, 3) lie on the surface, seen and unseen, every prefix of them spread evenly;
    ``spread_m`` (n,) is the expected distance of each from the true surface, metres, and
    ``confidence`` (n,) the probability that it lies within 5 mm, for Laplace's distribution:
    1 - exp(-0.005 / spread). The residuals are the mean distance of the view's observed points from
    the completed surface before and after its registration, metres; None without one and for what
    several views gave together.
    """

    @property
    def category(self) -> str: ...
    @property
    def score(self) -> float: ...
    @property
    def points_world(self) -> _Floats: ...
    @property
    def spread_m(self) -> _Floats: ...
    @property
    def confidence(self) -> _Floats: ...
    @property
    def residual_before_m(self) -> float | None: ...
    @property
    def residual_after_m(self) -> float | None: ...
    def write_ply(self, path: str | PathLike[str]) -> None:
        """Write ``x y z spread``, doubles, metres, as binary PLY."""

@final
class Detection:
    """An object found in a frame.

    ``mask`` (h, w) is at the image's full resolution, and ``box`` (4,) its left, top, right and
    bottom in pixels: the outer edges of the mask's pixels, of which the first has its centre at 0
    and its edges at -0.5 and 0.5. ``class_scores`` (6,) are the probabilities of the categories, in
    the order of `harness.native.CLASS_NAMES` after ``"free"``; what they leave of 1 is the
    probability of none of them. ``category`` is the most probable one, ``score`` how probable it is
    that the detection is right.

    A detection made anew of ``mask``, ``class_scores`` and ``score`` is the same one: what
    `Segmenter.segment` gives can be kept as arrays.
    """

    def __new__(
        cls, *, mask: npt.NDArray[np.bool_], class_scores: _Floats, score: float
    ) -> Self: ...
    @property
    def mask(self) -> npt.NDArray[np.bool_]: ...
    @property
    def box(self) -> _Floats: ...
    @property
    def category(self) -> str: ...
    @property
    def score(self) -> float: ...
    @property
    def class_scores(self) -> _Floats: ...

@final
class Segmenter:
    """The segmenter of a pipeline's configuration, by itself: what `Pipeline.add_frame` works with.

    ``name`` is as the configuration spells it: ``"maskrcnn"``, a network that sees colour,
    ``"maskrcnn_rgbd"``, which sees depth too, ``"oracle"``, which needs a frame's ``instance_ids``
    and ``categories``, or ``"python:module.function"``. Such a function is imported when the
    segmenter is made, and called for every frame as `harness.native.SegmenterFunction` says.
    ``temperature`` is what a network's logits are divided by to make its scores probabilities: 1
    with ``segmentation.calibrated = false``, None for a segmenter that is no network of ours.
    """

    def __new__(cls, config: str = "{}") -> Self: ...
    @property
    def name(self) -> str: ...
    @property
    def temperature(self) -> float | None: ...
    def segment(
        self,
        *,
        rgb: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        intrinsics: Sequence[float] | _Floats,
        world_from_camera: _Floats,
        instance_ids: npt.NDArray[np.uint16] | None = None,
        categories: Mapping[int, str] | None = None,
    ) -> list[Detection]:
        """Find the objects in a frame; none where nothing is in view."""

@final
class Voxels:
    @property
    def centres_world(self) -> _Floats: ...
    @property
    def size_m(self) -> float: ...
    @property
    def rgb(self) -> npt.NDArray[np.uint8]: ...
    @property
    def histograms(self) -> _Floats: ...
    @property
    def classes(self) -> npt.NDArray[np.uint8]: ...
    @property
    def object_ids(self) -> npt.NDArray[np.uint32]: ...
    @property
    def confidence(self) -> _Floats: ...

@final
class TrainingSet:
    def __new__(
        cls,
        points_world: _Floats,
        classes: npt.NDArray[np.uint8],
        *,
        viewpoint_world: _Floats | None = None,
    ) -> Self: ...
    @property
    def points_world(self) -> _Floats: ...
    @property
    def classes(self) -> npt.NDArray[np.uint8]: ...
    @property
    def viewpoint_world(self) -> _Floats | None: ...

@final
class Hyperparameters:
    @property
    def lengthscale_m(self) -> float: ...
    @property
    def outputscale(self) -> float: ...
    @property
    def mean(self) -> float: ...

@final
class Predictions:
    @property
    def class_names(self) -> list[str]: ...
    @property
    def classes(self) -> npt.NDArray[np.uint8]: ...
    @property
    def probabilities(self) -> _Floats: ...
    @property
    def variance(self) -> _Floats: ...
    @property
    def score(self) -> _Floats: ...
    @property
    def confidence(self) -> _Floats: ...
    @property
    def clamped_share(self) -> float: ...
    @property
    def clamped(self) -> npt.NDArray[np.bool_]: ...
    @property
    def jitter(self) -> float: ...
    @property
    def hyperparameters(self) -> dict[str, Hyperparameters]: ...
    @property
    def difference_variance(self) -> _Floats | None: ...
    @property
    def gate(self) -> float: ...
    @property
    def prior_probability(self) -> _Floats | None: ...
    @property
    def embedding(self) -> _Floats | None: ...
    @property
    def ood(self) -> float | None: ...
    @property
    def fits_unconverged(self) -> int: ...
    @property
    def fits_at_bound(self) -> int: ...

@final
class Pipeline:
    def __new__(cls, config: str = "{}") -> Self: ...
    @property
    def segmenter(self) -> str:
        """Name of the segmenter, as the configuration spells it; see `Segmenter`."""

    @property
    def completer(self) -> str:
        """Name of the completer, as the configuration spells it.

        It is ``"none"``, ``"cloud"``, ``"centersnap"`` or ``"python:module.function"``. Such a
        function is imported when the pipeline is made, and called for every frame as
        `harness.native.CompleterFunction` says.
        """
    @property
    def models(self) -> list[str]: ...
    def add_frame(
        self,
        *,
        rgb: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        intrinsics: Sequence[float] | _Floats,
        world_from_camera: _Floats,
        instance_ids: npt.NDArray[np.uint16] | None = None,
        categories: Mapping[int, str] | None = None,
        detections: Sequence[Detection] | None = None,
    ) -> list[int | None]:
        """Segment a frame, complete the objects in it and map it; return the object of each.

        ``detections`` take the place of those that the segmenter would find, which is not asked
        then: its own, kept, give the same bits. None is returned for a detection of too few pixels
        with a trusted depth.
        """

    def reconfigured(self, config: str) -> Pipeline:
        """Make a pipeline that stands where this one does, with other stages after the map.

        It holds a copy of the map, and neither changes the other from then on; its timings are of
        what it does itself. ``segmenter``, ``[segmentation]`` and ``[map]`` must stay as they are:
        anything else raises ValueError, which names the key. Completions are copied too if all that
        shapes those of single views stays as it is: ``completer``, ``[completion]`` and, with
        ``"cloud"``, ``metric.table_height_m``. Otherwise each of `frames_to_complete` must be given
        to `complete_frame`, unless the completer is ``"none"``.
        """

    @property
    def frames_to_complete(self) -> list[int]:
        """Indices from 0, in order, of the frames that `complete_frame` must still be given.

        Until then, completions are refused with ValueError, and so are further frames.
        """

    def complete_frame(
        self,
        index: int,
        *,
        rgb: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],
        intrinsics: Sequence[float] | _Floats,
        world_from_camera: _Floats,
        instance_ids: npt.NDArray[np.uint16] | None = None,
        categories: Mapping[int, str] | None = None,
        detections: Sequence[Detection],
    ) -> None:
        """Complete the objects of the next frame that a reconfigured pipeline is to complete again.

        The frame and its detections are those that were mapped. With all frames done, the pipeline
        is bit for bit as if it had added them under its own configuration.
        """

    def objects(self) -> list[MappedObject]: ...
    def completion(self, object_id: int) -> Completion | None:
        """Fuse what the views of an object gave; None if none of them completed it."""

    def view_completions(self, object_id: int) -> list[Completion]:
        """List what each view that completed an object gave, in their order."""

    def uncompleted(self, object_id: int) -> str | None:
        """Say why an object has no completion, by its last view; None if it has one."""

    def voxels(self) -> Voxels: ...
    def training_set(self, object_id: int, *, seed: int) -> TrainingSet: ...
    def classify(
        self,
        object_id: int,
        training: TrainingSet,
        test_points: _Floats,
        *,
        model: str = "metric",
        completion_confidence: _Floats | None = None,
    ) -> Predictions: ...
    def query_embedding(
        self, object_id: int, training: TrainingSet, points: _Floats
    ) -> tuple[_Floats, _Floats]: ...
    def annotate(self, object_id: int, test_points: _Floats, predictions: Predictions) -> int: ...
    def occupancy(self) -> OccupancyMap: ...
    def timings(self) -> list[tuple[str, str | None, float]]: ...
