"""A recording worked out by hand for tests of the view, and the rows of a file read back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from rerun.chunk import RrdReader

from harness.recordings.recording import (
    MappedCloud,
    ModelAnswers,
    RecordedDetection,
    RecordedView,
    RecordedVoxels,
    Recording,
    TestSetPart,
    TrackedState,
    TrueObject,
)
from harness.runs.records import Record

if TYPE_CHECKING:
    from pathlib import Path

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

WIDTH, HEIGHT = 160, 120
INTRINSICS = np.array([150.0, 148.0, 78.0, 61.0])
LOW, HIGH = np.array([0.42, -0.05, 0.0]), np.array([0.54, 0.03, 0.09])
"""The target: a block on the table, with its faces along the axes."""

JOINTS_RAD = np.array([0.28, 0.43, 0.26, -1.5, -0.6, 1.29, 0.11])
EYES = ((0.75, 0.2, 0.4), (0.3, -0.3, 0.35))
CENTROID = np.array([0.48, -0.01, 0.05])


def look_at(eye: npt.ArrayLike) -> Floats:
    """Pose (4, 4) of a camera that looks at the target, tilted about its axis."""
    origin = np.asarray(eye, dtype=np.float64)
    forward = (LOW + HIGH) / 2 - origin
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.1, 0.0, 1.0))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    pose[:3, 3] = origin
    return pose


def see(pose: Floats) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.float32]]:
    """Mask and depth (h, w) of the block, by where each pixel's ray enters and leaves its slabs."""
    fx, fy, cx, cy = INTRINSICS
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(u.shape)], axis=-1) @ pose[:3, :3].T
    enter = np.minimum((LOW - pose[:3, 3]) / rays, (HIGH - pose[:3, 3]) / rays).max(axis=-1)
    leave = np.maximum((LOW - pose[:3, 3]) / rays, (HIGH - pose[:3, 3]) / rays).min(axis=-1)
    hit = (enter < leave) & (enter > 0)
    return hit, np.where(hit, enter, np.nan).astype(np.float32)


def block() -> TrueObject:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return TrueObject(
        instance_id=3,
        name="mug one",
        category="mug",
        vertices_world=(LOW + corners * (HIGH - LOW)).astype(np.float32),
        faces=np.array(faces, dtype=np.int32),
    )


def view(eye: npt.ArrayLike, *, tracked: tuple[TrackedState, ...]) -> RecordedView:
    pose = look_at(eye)
    mask, depth_m = see(pose)
    return RecordedView(
        rgb=np.stack([np.full(mask.shape, 90), mask * 200, ~mask * 200], axis=-1).astype(np.uint8),
        depth_m=depth_m,
        true_ids=np.where(mask, 3, 0).astype(np.uint16),
        found=np.where(mask, 2, 0).astype(np.uint8),
        detections=(
            RecordedDetection(category="bowl", score=0.625, object_id=None),
            RecordedDetection(category="mug", score=0.75, object_id=7),
        ),
        intrinsics=INTRINSICS,
        world_from_camera=pose,
        joint_positions_rad=JOINTS_RAD,
        tracked=tracked,
    )


def recording(**change: Any) -> Recording:
    """Two views of a mug that is seen from the first and tracked from the second on.

    Four test points of the box and two completed ones. The metric model puts the box's first two
    on the mug, of which the first lies on it, as does the third; both completed ones are right.
    """
    confidence = np.array([1.0, 0.75, 0.25, 0.0, 1.0, 0.5])
    answers = ModelAnswers(
        classes=np.array([6, 6, 0, 0, 6, 6], dtype=np.uint8),
        probability=confidence / 2,
        recalibrated=confidence,
        confidence=confidence,
        score=confidence,
        variance=np.zeros(6),
    )
    points = np.linspace(LOW, HIGH, 6).astype(np.float32)
    state = TrackedState(id=7, category="mug", score=0.75, centroid_world=CENTROID)
    whole: dict[str, Any] = {
        "scene_id": "mug-0000",
        "category": "mug",
        "seed": 5,
        "segmenter": "oracle",
        "completer": "cloud",
        "views": (view(EYES[0], tracked=()), view(EYES[1], tracked=(state,))),
        "objects": (block(),),
        "tracked": (
            MappedCloud(
                id=7,
                category="mug",
                score=0.75,
                centroid_world=CENTROID,
                observed_world=points[:3],
                completed_world=points,
                spread_m=np.zeros(6, dtype=np.float32),
            ),
        ),
        "target_id": 7,
        "voxels": RecordedVoxels(
            size_m=0.005,
            centres_world=((np.array([[80, 0, 0], [81, -1, 2], [99, 3, 1]]) + 0.5) * 0.005).astype(
                np.float32
            ),
            rgb=np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], dtype=np.uint8),
            classes=np.array([0, 6, 6], dtype=np.uint8),
            object_ids=np.array([0, 7, 7], dtype=np.uint32),
            confidence=np.array([np.nan, 1.0, 0.0], dtype=np.float32),
            first_view=np.array([0, 1, 0], dtype=np.uint8),
        ),
        "training_world": points[:5],
        "training_classes": np.array([6, 6, 0, 0, 0], dtype=np.uint8),
        "test_world": points,
        "test_sets": (
            TestSetPart(completion="none", part=slice(0, 4)),
            TestSetPart(completion="cloud", part=slice(4, 6)),
        ),
        "distances_m": np.array([[0.004, 0.006, 0.002, 0.009, 0.001, 0.005]]),
        "data_distance_m": np.ones(6),
        "completer_confidence": np.ones(6),
        "answers": {"metric": answers, "classic": answers},
    }
    return Recording(**(whole | change))


def missed() -> Recording:
    """The same scene where the map holds nothing."""
    views = tuple(view(eye, tracked=()) for eye in EYES)
    none = np.zeros((0, 3), dtype=np.float32)
    part = slice(0, 4)
    whole = recording()
    return recording(
        views=views,
        tracked=(),
        target_id=None,
        training_world=none,
        training_classes=np.zeros(0, dtype=np.uint8),
        test_world=whole.test_world[part],
        test_sets=(TestSetPart(completion="none", part=part),),
        distances_m=whole.distances_m[:, part],
        data_distance_m=np.full(4, np.inf),
        completer_confidence=np.ones(4),
        answers={
            "metric": ModelAnswers(
                classes=np.zeros(4, dtype=np.uint8),
                probability=np.zeros(4),
                recalibrated=np.full(4, np.nan),
                confidence=np.zeros(4),
                score=np.zeros(4),
                variance=np.zeros(4),
            )
        },
    )


def record(**change: Any) -> Record:
    """Record of the metric model about the box's points."""
    whole: dict[str, Any] = {
        "scene_id": "mug-0000",
        "category": "mug",
        "object_name": "mug one",
        "seed": 5,
        "model": "metric",
        "completion": "none",
        "segmenter": "oracle",
        "views": 2,
        "tolerance_m": 0.005,
        "test_points": 4,
        "tp": 1,
        "tn": 1,
        "fp": 1,
        "fn": 1,
        "base_rate": 0.5,
        "precision": 0.5,
        "recall": 0.5,
        "accuracy": 0.5,
    }
    return Record(**(whole | change))


@dataclass(frozen=True)
class Row:
    """A row of an entity: its step, None where it holds for all times, and its values."""

    step: int | None
    values: dict[str, Any]


def read_rows(file: Path) -> dict[str, list[Row]]:
    """All rows of a file's recording by entity, static ones first, then by step."""
    found: dict[str, list[Row]] = {}
    for chunk in RrdReader(file).stream().to_chunks():
        columns = chunk.to_record_batch().to_pydict()
        steps = columns.pop("view", [None] * chunk.num_rows)
        del columns["rerun.controls.RowId"]
        for place, step in enumerate(steps):
            values = {name: column[place] for name, column in columns.items()}
            found.setdefault(chunk.entity_path, []).append(Row(step, values))
    order = {True: -1}
    return {
        entity: sorted(rows, key=lambda row: order.get(row.step is None, row.step or 0))
        for entity, rows in sorted(found.items())
    }


def value(row: Row, name: str) -> npt.NDArray[Any]:
    """Read a component of a row as an array."""
    return np.array(row.values[name])


def rgba(packed: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Colours (n, 4) of Rerun's numbers (n,)."""
    numbers = np.asarray(packed, dtype=np.int64)
    return np.stack([numbers >> shift & 255 for shift in (24, 16, 8, 0)], axis=-1)
