"""Training pictures: what they hold, and that nothing but their arguments decides it."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from sim_scenes import ObjectModel, ObjectSet, SimulatorMissing, d435_intrinsics
from sim_scenes.geometry import apply, inverse, look_at
from sim_scenes.pictures import GROUP, TrainingPicture, draw_group, picture, picture_intrinsics
from sim_scenes.pictures.hand import Hand
from sim_scenes.pictures.picture import DEPTH_NOISE, number_shown
from sim_scenes.pictures.stage import Stage, Thing, shape_of
from sim_scenes.render import Light, render
from sim_scenes.sensor import DepthNoise

if TYPE_CHECKING:
    from pathlib import Path

CAMERA = look_at(eye=np.array([0.2, -0.3, 0.3]), target=np.array([0.45, 0.0, 0.03]))


@pytest.fixture(scope="module")
def group(object_set: ObjectSet) -> list[TrainingPicture]:
    return draw_group(object_set, 3, 1)


def arrays(item: TrainingPicture) -> tuple[np.ndarray, ...]:
    return item.rgb, item.depth, item.instances, item.classes


def model(objects: ObjectSet, name: str) -> ObjectModel:
    return next(item for item in objects.models if item.name == name)


def load(stage: Stage, objects: ObjectSet, name: str) -> Thing:
    return stage.load(shape_of(model(objects, name), scale=1.0))


def show(stage: Stage, thing: Thing, x: float = 0.45) -> None:
    pose = np.eye(4)
    pose[0, 3] = x
    texture = stage.load_texture(np.full((4, 4, 3), 128, dtype=np.uint8))
    stage.show(thing.number, pose, texture=texture)


def test_a_picture_holds_what_its_documentation_says(group: list[TrainingPicture]) -> None:
    assert len(group) == GROUP
    for item in group:
        assert [a.shape for a in arrays(item)] == [(240, 320, 3), (240, 320), (240, 320), (16,)]
        assert [a.dtype for a in arrays(item)] == [np.uint8, np.uint16, np.uint8, np.uint8]
        count = int((item.classes > 0).sum())
        assert set(np.unique(item.instances)) - {0} == set(range(1, count + 1))
        assert (item.classes[:count] > 0).all()
        # The set has no bottle, 1, and no laptop, 5.
        assert set(item.classes[:count]) <= {2, 3, 4, 6}
    assert any((item.classes > 0).sum() > 1 for item in group)
    assert len({item.rgb.tobytes() for item in group}) == GROUP


def test_a_group_depends_on_nothing_that_was_drawn_before(
    object_set: ObjectSet, group: list[TrainingPicture]
) -> None:
    other = draw_group(object_set, 4, 1)
    again = draw_group(object_set, 3, 1)
    for one, two in zip(group, again, strict=True):
        for a, b in zip(arrays(one), arrays(two), strict=True):
            np.testing.assert_array_equal(a, b)
    assert not np.array_equal(other[0].rgb, group[0].rgb)


def test_it_is_every_second_pixel_of_the_simulated_camera(object_set: ObjectSet) -> None:
    stage = Stage()
    cup = load(stage, object_set, "cup")
    show(stage, cup)
    small = picture_intrinsics()
    assert (small.cx, small.cy, small.width, small.height) == (159.75, 119.75, 320, 240)
    assert small.fx == pytest.approx(308.09, abs=0.01)
    pictures = [
        render(stage.world, bodies=[cup], world_from_camera=CAMERA, intrinsics=item, light=Light())
        for item in (small, d435_intrinsics(width=640, height=480))
    ]
    thinned = pictures[1].instance_ids[::2, ::2]
    assert (thinned == 1).sum() > 1000
    # Both sample the same rays; rounding may decide differently on an outline.
    assert (pictures[0].instance_ids != thinned).mean() < 1e-4
    apart = np.abs(pictures[0].depth_m - pictures[1].depth_m[::2, ::2])
    # Half a pixel would be 1 mm of the table.
    assert np.quantile(apart, 0.999) < 1e-4


def test_objects_that_do_not_show_are_left_out() -> None:
    ids = np.array([[0, 3, 3], [5, 1, 4]], dtype=np.uint16)
    instances, classes = number_shown(ids, ["mug", "can", "bottle", "laptop"])
    # The second one is hidden; 5 is beyond the objects, the hand.
    assert instances.tolist() == [[0, 2, 2], [0, 1, 3]]
    assert classes.tolist() == [6, 1, 5] + [0] * 13


def test_nothing_shows_of_an_empty_table() -> None:
    instances, classes = number_shown(np.zeros((2, 2), dtype=np.uint16), [])
    assert not instances.any()
    assert not classes.any()


def test_depth_is_as_noisy_as_that_of_the_whole_image() -> None:
    def spread_m(noise: DepthNoise, width: int) -> float:
        camera = d435_intrinsics(width=width, height=width * 3 // 4)
        plane = np.full((camera.height, camera.width), 0.5, dtype=np.float32)
        random = np.random.default_rng(0)
        return float(np.nanstd(noise.apply(plane, intrinsics=camera, random=random)))

    # sigma = z^2 s / (f B) = 0.25 * 0.1 / (320 * 0.05) = 1.56 mm; the quantum adds 0.14 mm^2 / 12.
    assert spread_m(DepthNoise(), 640) == pytest.approx(1.57e-3, rel=0.02)
    assert spread_m(DEPTH_NOISE, 320) == pytest.approx(1.57e-3, rel=0.02)


def test_what_is_hidden_shows_no_pixel(object_set: ObjectSet) -> None:
    stage = Stage()
    cup, tin = load(stage, object_set, "cup"), load(stage, object_set, "tin")

    def pixels() -> list[int]:
        ids = render(
            stage.world,
            bodies=[cup, tin],
            world_from_camera=CAMERA,
            intrinsics=picture_intrinsics(),
            light=Light(),
        ).instance_ids
        return [int((ids == k).sum()) for k in (1, 2)]

    assert pixels() == [0, 0]
    show(stage, cup)
    show(stage, tin, 0.55)
    both = pixels()
    assert min(both) > 100
    stage.hide(cup.number)
    hidden = pixels()
    assert hidden[0] == 0
    assert hidden[1] >= both[1]


def test_a_shape_stands_on_the_table_at_its_scale(object_set: ObjectSet) -> None:
    # The box's own frame has its middle far from the origin.
    shape = shape_of(model(object_set, "box"), scale=1.1)
    np.testing.assert_allclose(shape.vertices.min(axis=0), [-0.044, -0.033, 0], atol=1e-6)
    np.testing.assert_allclose(shape.vertices.max(axis=0), [0.044, 0.033, 0.11], atol=1e-6)
    assert shape.radius_m == pytest.approx(np.hypot(0.044, 0.033), abs=1e-6)
    assert shape.height_m == pytest.approx(0.11, abs=1e-6)
    assert shape.closed


def test_an_open_mesh_is_drawn_from_both_sides(tmp_path: Path) -> None:
    box = trimesh.creation.box(extents=[0.1, 0.1, 0.1])
    # Without its lid, face normals up; the inner sides face away from the camera.
    box.update_faces(box.face_normals[:, 2] < 0.5)
    box.export(tmp_path / "open.ply")
    shape = shape_of(ObjectModel("open", "bowl", tmp_path / "open.ply"), scale=1.0)
    assert not shape.closed
    stage = Stage()
    thing = stage.load(shape)
    show(stage, thing)
    above = look_at(eye=np.array([0.3, 0.0, 0.4]), target=np.array([0.45, 0.0, 0.0]))
    picture_ = render(
        stage.world,
        bodies=[thing],
        world_from_camera=above,
        intrinsics=picture_intrinsics(),
        light=Light(),
    )
    # Half way up the far wall, whose inner side its faces do not face.
    inner = apply(inverse(above), np.array([[0.5, 0.0, 0.05]]))
    u, v = np.round(picture_intrinsics().project(inner)[0]).astype(int)
    assert picture_.instance_ids[v, u] == 1


def test_the_hand_is_often_in_view_and_never_an_object(object_set: ObjectSet) -> None:
    stage = Stage()
    hand = Hand(stage.world)
    random = np.random.default_rng(0)
    shares = []
    for _ in range(12):
        hand.mount(world_from_camera=CAMERA, random=random)
        ids = render(
            stage.world,
            bodies=hand.parts,
            world_from_camera=CAMERA,
            intrinsics=picture_intrinsics(),
            light=Light(),
        ).instance_ids
        shares.append(float((ids > 0).mean()))
    assert np.mean([0 < share <= picture.HAND_HIDES for share in shares]) > 0.4
    assert max(shares) < 0.9


def test_the_hand_is_background_and_too_near_for_the_sensor(
    object_set: ObjectSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    without = draw_group(object_set, 3, 2)
    monkeypatch.setattr(picture, "HAND_GROUPS", 1.0)
    monkeypatch.setattr(picture, "HAND_PICTURES", 1.0)
    hands = draw_group(object_set, 3, 2)
    changed = [(a.rgb != b.rgb).any(axis=2) for a, b in zip(hands, without, strict=True)]
    assert np.mean([mask.any() for mask in changed]) >= 0.5
    for item, mask in zip(hands, changed, strict=True):
        assert mask.mean() <= picture.HAND_HIDES
        assert not item.instances[mask].any()
        assert (item.depth[mask] < 2500).all()


def test_without_pybullet_it_says_what_is_missing(
    object_set: ObjectSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(SimulatorMissing, match="pip install pybullet"):
        draw_group(object_set, 0, 0)
