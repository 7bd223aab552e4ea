"""A scene as a run saw it: views, detections, map, completed shapes, and every answer.

World coordinates are metres. What pictures are drawn of is kept in float32, what metrics are
computed from in float64.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.protocol import true_categories

if TYPE_CHECKING:
    from collections.abc import Mapping

Floats = npt.NDArray[np.float64]
Floats32 = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedDetection:
    """What the segmenter found in a view.

    Attributes
    ----------
    category, score
        As the segmenter says.
    object_id
        The tracked object that it became part of, by the map's id then; None for none.
    """

    category: str
    score: float
    object_id: int | None


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackedState:
    """A tracked object after one view: id, category, score and centroid (3,)."""

    id: int
    category: str
    score: float
    centroid_world: Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedView:
    """A frame and what was found in it.

    Attributes
    ----------
    rgb : (h, w, 3) uint8
    depth_m : (h, w) float32
        NaN where nothing was measured; kept in steps of 0.1 mm.
    true_ids : (h, w) uint16
        The true instance at each pixel, 0 for background; 0 everywhere where it is not known.
    found : (h, w) uint8
        1 + the index of the detection at each pixel, the surest of several; 0 for none.
    detections
        In the order of `found`.
    intrinsics : (4,) float64
        fx, fy, cx, cy, pixels.
    world_from_camera : (4, 4) float64
    joint_positions_rad : (7,) float64 or None
        The Panda's joints.
    tracked
        The tracker after this view, by rising id.
    """

    rgb: Bytes
    depth_m: Floats32
    true_ids: npt.NDArray[np.uint16]
    found: Bytes
    detections: tuple[RecordedDetection, ...]
    intrinsics: Floats
    world_from_camera: Floats
    joint_positions_rad: Floats | None
    tracked: tuple[TrackedState, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class TrueObject:
    """An object as it truly stands; the target is a recording's first.

    Attributes
    ----------
    instance_id
        Its value in `RecordedView.true_ids`.
    vertices_world : (n, 3) float32
    faces : (m, 3) int32
    """

    instance_id: int
    name: str
    category: str
    vertices_world: Floats32
    faces: Ints


@dataclass(frozen=True, eq=False, kw_only=True)
class MappedCloud:
    """A tracked object at the end: what was observed of it, and its completed shape.

    Attributes
    ----------
    id, category, score, centroid_world : (3,) float64
        As the map says.
    observed_world : (n, 3) float32
        Points of its cloud, at most `MOST_OBSERVED`.
    completed_world : (m, 3) float32
        Points of its completion, spread evenly in every prefix; none without one.
    spread_m : (m,) float32
        Expected distance of each from the true surface.
    """

    id: int
    category: str
    score: float
    centroid_world: Floats
    observed_world: Floats32
    completed_world: Floats32
    spread_m: Floats32


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedVoxels:
    """The map's occupied voxels at the end.

    Attributes
    ----------
    size_m
        Edge.
    centres_world : (n, 3) float32
    rgb : (n, 3) uint8
    classes : (n,) uint8
        Index into `harness.native.CLASS_NAMES`.
    object_ids : (n,) uint32
        0 for none.
    confidence : (n,) float32
        NaN where no point was asked about.
    first_view : (n,) uint8
        Index of the view after which the voxel was first occupied.
    """

    size_m: float
    centres_world: Floats32
    rgb: Bytes
    classes: Bytes
    object_ids: npt.NDArray[np.uint32]
    confidence: Floats32
    first_view: Bytes


@dataclass(frozen=True, eq=False, kw_only=True)
class TestSetPart:
    """Which of the test points are one set's: `completion` as records state it, and a slice."""

    completion: str
    part: slice


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelAnswers:
    """What a model says of each test point, (m,).

    Attributes
    ----------
    classes : uint8
        Index into `harness.native.CLASS_NAMES`; 0 is free space.
    probability : float64
        Raw, of the target's category.
    recalibrated : float64
        After recalibration; NaN where the map takes the target for something else.
    confidence : float64
        That of the recorded metrics: recalibrated, times the segmenter's score and the completer's.
    score : float64
        The seed's, its Eqs. 2 and 3 as min-max over all test sets, times the segmenter's score.
    variance : float64
        Latent; 0 of a model without one.
    """

    classes: Bytes
    probability: Floats
    recalibrated: Floats
    confidence: Floats
    score: Floats
    variance: Floats


@dataclass(frozen=True, eq=False, kw_only=True)
class Recording:
    """A scene of a run.

    Attributes
    ----------
    scene_id, category, seed
        As in the records; the category is the target's.
    segmenter, completer
        Names.
    views
        In the order in which they were taken.
    objects
        As they truly are; the target is the first.
    tracked
        The map's objects at the end.
    target_id
        The one that is the target; None where it was missed.
    voxels
        The map.
    training_world : (n, 3) float32
        What the models learned from; none of a missed target.
    training_classes : (n,) uint8
    test_world : (m, 3) float32
        Test points of all sets.
    test_sets
        Which are whose.
    distances_m : (objects, m) float64
        Distance of each test point to each true object's mesh.
    data_distance_m : (m,) float64
        To the nearest training point; infinite for a missed target.
    completer_confidence : (m,) float64
        How sure the completer is of each test point; 1 for points that none made.
    answers
        By model.
    """

    scene_id: str
    category: str
    seed: int
    segmenter: str
    completer: str
    views: tuple[RecordedView, ...]
    objects: tuple[TrueObject, ...]
    tracked: tuple[MappedCloud, ...]
    target_id: int | None
    voxels: RecordedVoxels
    training_world: Floats32
    training_classes: Bytes
    test_world: Floats32
    test_sets: tuple[TestSetPart, ...]
    distances_m: Floats
    data_distance_m: Floats
    completer_confidence: Floats
    answers: Mapping[str, ModelAnswers]

    @property
    def target(self) -> TrueObject:
        """The object that was asked about."""
        return self.objects[0]

    @property
    def target_cloud(self) -> MappedCloud | None:
        """The target in the map."""
        return next((item for item in self.tracked if item.id == self.target_id), None)

    def part(self, completion: str) -> slice:
        """Which test points are a set's; an empty slice where the scene has none.

        Parameters
        ----------
        completion
            As records state it: ``none`` for the box.
        """
        parts = {item.completion: item.part for item in self.test_sets}
        return parts.get(completion, slice(0, 0))

    def on_target(self, tolerance_m: float) -> npt.NDArray[np.bool_]:
        """Whether each test point (m,) lies on an object of the target's category."""
        true = true_categories(self.distances_m, self.objects, tolerance_m=tolerance_m)
        return np.asarray(true == self.category)
