"""The file of a scene, read back: what is in it, where it stands, and at which step."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from harness.tests.fake_view import (
    CENTROID,
    EYES,
    HEIGHT,
    INTRINSICS,
    WIDTH,
    Row,
    block,
    look_at,
    missed,
    read_rows,
    recording,
    rgba,
    see,
    value,
    view,
)
from harness.view.pictures import mask_box
from harness.view.stream import encode

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy.typing as npt

    from harness.recordings.recording import Recording

    Rows = dict[str, list[Row]]

MUG, BOWL, FREE = (213, 94, 0, 255), (86, 180, 233, 255), (153, 153, 153, 255)
LINKS = ("hand", "leftfinger", "rightfinger", *(f"link{number}" for number in range(8)))


def rows_of(item: Recording, folder: Path) -> Rows:
    file = folder / "scene.rrd"
    file.write_bytes(encode(item, name="run", model="metric", tolerance_m=0.005, about="# mug"))
    return read_rows(file)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> Rows:
    return rows_of(recording(), tmp_path_factory.mktemp("view"))


def test_every_entity_has_its_steps(rows: Rows) -> None:
    assert {entity: [row.step for row in found] for entity, found in rows.items()} == {
        "/__properties": [None],
        "/about": [None],
        "/legend": [None],
        "/world": [None],
        **{f"/world/arm/panda_{link}": [None, 0, 1] for link in LINKS},
        "/world/camera": [0, 1],
        "/world/camera/depth": [0, 1],
        "/world/camera/found": [0, 1],
        "/world/camera/found/boxes": [0, 1],
        "/world/camera/rgb": [0, 1],
        "/world/camera/true": [None, 0, 1],
        "/world/completed/7": [2],
        "/world/confidence/box": [2],
        "/world/confidence/completed": [2],
        "/world/judged": [None],
        "/world/judged/box": [2],
        "/world/judged/completed": [2],
        "/world/map/by_class/view_0": [0],
        "/world/map/by_class/view_1": [1],
        "/world/map/by_colour/view_0": [0],
        "/world/map/by_colour/view_1": [1],
        "/world/map/by_confidence": [2],
        "/world/observed/7": [2],
        "/world/tracker": [0, 1, 2],
        "/world/tracker/names": [0, 1, 2],
        "/world/training/free": [2],
        "/world/training/object": [2],
        "/world/true/3_mug\\ one": [None],
    }


def test_the_same_scene_gives_the_same_rows(rows: Rows, tmp_path: Path) -> None:
    assert rows_of(recording(), tmp_path) == rows


def test_a_missed_target_has_its_box_and_no_shape(tmp_path: Path) -> None:
    found = rows_of(missed(), tmp_path)
    made = ("completed", "observed", "training", "confidence", "judged")
    assert {entity for entity in found for name in made if f"/world/{name}" in entity} == {
        "/world/confidence/box",
        "/world/judged",
        "/world/judged/box",
    }
    assert [row.values["Points3D:positions"] for row in found["/world/tracker"]] == [[], [], []]


def test_a_scene_without_an_arm_has_none(tmp_path: Path) -> None:
    views = tuple(replace(item, joint_positions_rad=None) for item in recording().views)
    found = rows_of(recording(views=views), tmp_path)
    assert not [entity for entity in found if entity.startswith("/world/arm")]


def logged_pose(row: Row) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Rotation (3, 3) and translation (3,) of a row; Rerun keeps matrices by columns."""
    rotation = value(row, "Transform3D:mat3x3").reshape(3, 3).T
    return rotation.astype(np.float64), value(row, "Transform3D:translation")[0].astype(np.float64)


def logged_pinhole(row: Row) -> npt.NDArray[np.float64]:
    return value(row, "Pinhole:image_from_camera").reshape(3, 3).T.astype(np.float64)


def overlap(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    """Intersection over union of two boxes ((left, top), (right, bottom))."""
    a, b = np.asarray(first), np.asarray(second)
    sides = np.minimum(a[1], b[1]) - np.maximum(a[0], b[0])
    shared = float(np.prod(np.maximum(sides, 0.0)))
    return shared / float(np.prod(a[1] - a[0]) + np.prod(b[1] - b[0]) - shared)


def projected_box(
    rotation: npt.NDArray[np.float64],
    translation: npt.NDArray[np.float64],
    pinhole: npt.NDArray[np.float64],
    vertices: npt.NDArray[np.float64],
) -> npt.NDArray[np.float64]:
    pixels = (vertices - translation) @ rotation @ pinhole.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    return np.array([pixels.min(axis=0), pixels.max(axis=0)])


@pytest.mark.parametrize("step", [0, 1])
def test_the_true_mesh_falls_on_its_mask_through_the_camera(rows: Rows, step: int) -> None:
    """A wrong frame, sign or axis in pose or pinhole moves the mesh off its mask."""
    camera = rows["/world/camera"][step]
    rotation, translation = logged_pose(camera)
    pinhole = logged_pinhole(camera)
    mesh = value(rows["/world/true/3_mug\\ one"][0], "Mesh3D:vertex_positions")
    buffer = value(rows["/world/camera/true"][1 + step], "SegmentationImage:buffer")
    ids = np.frombuffer(buffer.astype(np.uint8).tobytes(), dtype=np.uint16)
    box = mask_box(ids.reshape(HEIGHT, WIDTH) == 3)
    assert box is not None
    assert overlap(projected_box(rotation, translation, pinhole, mesh), box) > 0.93
    assert overlap(projected_box(rotation.T, translation, pinhole, mesh), box) < 0.5
    assert value(camera, "Pinhole:camera_xyz").tolist() == [[3, 2, 5]]  # right, down, forward
    assert value(camera, "Pinhole:resolution").tolist() == [[WIDTH, HEIGHT]]


@pytest.mark.parametrize("step", [0, 1])
def test_depth_falls_on_the_true_faces_through_the_camera(rows: Rows, step: int) -> None:
    """Half a pixel is 1.3 mm here; the faces are met to a depth's step, 0.1 mm."""
    camera = rows["/world/camera"][step]
    rotation, translation = logged_pose(camera)
    image = rows["/world/camera/depth"][step]
    blob = bytes(value(image, "EncodedDepthImage:blob")[0].astype(np.uint8))
    counts = np.asarray(Image.open(io.BytesIO(blob)))
    assert counts.dtype == np.uint16
    v, u = np.nonzero(counts)
    # Rerun's pixels reach from a corner to the next; what was measured is at their middles.
    corner = np.stack([u + 0.5, v + 0.5, np.ones(len(u))], axis=-1)
    rays = corner @ np.linalg.inv(logged_pinhole(camera)).T
    depth = counts[v, u] / value(image, "EncodedDepthImage:meter")[0]
    points = (rays * depth[:, None]) @ rotation.T + translation
    faces = block().vertices_world
    gaps = np.abs(points[:, None, :] - np.stack([faces.min(axis=0), faces.max(axis=0)]))
    assert len(points) > 500
    assert gaps.min(axis=(1, 2)).max() < 1.5e-4


def test_the_pinhole_counts_from_the_corner(rows: Rows) -> None:
    fx, fy, cx, cy = INTRINSICS
    assert logged_pinhole(rows["/world/camera"][0]).tolist() == [
        [fx, 0, cx + 0.5],
        [0, fy, cy + 0.5],
        [0, 0, 1],
    ]


def named_classes(row: Row) -> list[dict[str, Any]]:
    """Id, label and colour of each class of a row's annotation context."""
    (classes,) = row.values["AnnotationContext:context"]
    for item in classes:
        assert item["class_id"] == item["class_description"]["info"]["id"]
    return [item["class_description"]["info"] for item in classes]


def test_masks_have_names_and_colours(rows: Rows) -> None:
    found = rows["/world/camera/found"][1]
    described = named_classes(found)
    assert [(item["id"], item["label"]) for item in described] == [
        (0, "background"),
        (1, "bowl 0.62 not mapped"),
        (2, "mug 0.75 #7"),
    ]
    assert rgba([item["color"] for item in described]).tolist() == [
        [0, 0, 0, 0],
        list(BOWL),
        list(MUG),
    ]
    mask, _ = see(look_at(EYES[1]))
    buffer = value(found, "SegmentationImage:buffer").reshape(HEIGHT, WIDTH)
    assert np.array_equal(buffer, np.where(mask, 2, 0))
    true = named_classes(rows["/world/camera/true"][0])
    assert [(item["id"], item["label"]) for item in true] == [(0, "background"), (3, "mug one")]


def test_a_mask_that_is_covered_has_no_box(rows: Rows) -> None:
    boxes = rows["/world/camera/found/boxes"][0]
    assert boxes.values["Boxes2D:labels"] == ["mug 0.75 #7"]
    left, top = value(boxes, "Boxes2D:centers")[0] - value(boxes, "Boxes2D:half_sizes")[0]
    v, u = np.nonzero(see(look_at(EYES[0]))[0])
    assert (left, top) == (u.min(), v.min())


def test_images_are_kept_without_loss(rows: Rows) -> None:
    blob = bytes(value(rows["/world/camera/rgb"][1], "EncodedImage:blob")[0].astype(np.uint8))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(blob))), recording().views[1].rgb)


def test_voxels_appear_with_the_view_that_occupied_them(rows: Rows) -> None:
    def voxels(entity: str) -> tuple[Sequence[Sequence[int]], Sequence[Sequence[int]]]:
        (row,) = rows[f"/world/map/{entity}"]
        assert value(row, "VoxelGridMap:voxel_size").tolist() == [[np.float32(0.005)] * 3]
        keys = value(row, "VoxelGridMap:voxel_indices")
        return keys.tolist(), rgba(value(row, "VoxelGridMap:colors")).tolist()

    assert voxels("by_class/view_0") == ([[80, 0, 0], [99, 3, 1]], [list(FREE), list(MUG)])
    assert voxels("by_class/view_1") == ([[81, -1, 2]], [list(MUG)])
    assert voxels("by_colour/view_0")[1] == [[1, 2, 3, 255], [7, 8, 9, 255]]
    assert voxels("by_colour/view_1")[1] == [[4, 5, 6, 255]]
    keys, colours = voxels("by_confidence")
    assert keys == [[81, -1, 2], [99, 3, 1]]
    assert colours == [[240, 176, 48, 255], [0, 54, 107, 255]]


def test_the_tracker_shows_ids_at_centroids(rows: Rows) -> None:
    before, after, _ = rows["/world/tracker"]
    names = [row.values["Points3D:labels"] for row in rows["/world/tracker/names"]]
    assert names == [[], ["#7 mug 0.75"], ["#7 mug 0.75, the target"]]
    assert before.values["Points3D:positions"] == []
    assert value(after, "Points3D:positions") == pytest.approx(CENTROID[None, :], abs=1e-7)
    assert rgba(after.values["Points3D:colors"]).tolist() == [list(MUG)]


def test_points_have_the_confidence_of_the_model(rows: Rows) -> None:
    (box,) = rows["/world/confidence/box"]
    assert box.values["confidence"] == [1.0, 0.75, 0.25, 0.0]
    assert box.values["probability"] == [0.5, 0.375, 0.125, 0.0]
    assert box.values["distance_from_target_m"] == [0.004, 0.006, 0.002, 0.009]
    whole = recording()
    assert np.array_equal(value(box, "Points3D:positions"), whole.test_world[:4])
    colours = rgba(box.values["Points3D:colors"])
    assert colours[0].tolist() == [240, 176, 48, 255]
    assert colours[3].tolist() == [0, 54, 107, 255]
    lightness = colours[:, :3] @ np.array([0.299, 0.587, 0.114])
    assert (np.diff(lightness) < 0).all()
    (completed,) = rows["/world/confidence/completed"]
    assert np.array_equal(value(completed, "Points3D:positions"), whole.test_world[4:])


def test_points_are_judged_against_the_truth(rows: Rows) -> None:
    """At 5 mm the first and third lie on the mug; the first two are put on it."""
    names = {item["id"]: item["label"] for item in named_classes(rows["/world/judged"][0])}

    def outcomes(test_set: str) -> list[str]:
        (row,) = rows[f"/world/judged/{test_set}"]
        return [names[number] for number in row.values["Points3D:class_ids"]]

    assert outcomes("box") == [
        "true positive",
        "false positive",
        "false negative",
        "true negative",
    ]
    assert outcomes("completed") == ["true positive", "true positive"]


def test_training_points_are_apart_from_free_space(rows: Rows) -> None:
    whole = recording()
    for name, part, colour in (("object", slice(2), MUG), ("free", slice(2, None), FREE)):
        (row,) = rows[f"/world/training/{name}"]
        assert np.array_equal(value(row, "Points3D:positions"), whole.training_world[part])
        assert {tuple(item) for item in rgba(row.values["Points3D:colors"]).tolist()} == {colour}


def test_a_view_without_detections_clears_the_boxes(tmp_path: Path) -> None:
    empty = replace(
        view(EYES[0], tracked=()), detections=(), found=np.zeros((HEIGHT, WIDTH), np.uint8)
    )
    found = rows_of(recording(views=(recording().views[0], empty)), tmp_path)
    labels = [row.values["Boxes2D:labels"] for row in found["/world/camera/found/boxes"]]
    assert labels == [["mug 0.75 #7"], []]
