from __future__ import annotations

import itertools
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_scenes import (
    HAND_FROM_CAMERA,
    Appearance,
    Arc,
    DepthNoise,
    Frame,
    ObjectModel,
    ObjectSet,
    Scene,
    SceneError,
    SceneObject,
    SceneSpec,
    SpecError,
    simulate,
)
from sim_scenes.arm import LOWER_RAD, UPPER_RAD, Arm
from sim_scenes.geometry import apply, inverse, look_at
from sim_scenes.simulation import choose_models
from sim_scenes.tests.support import BOX_HALF_M, BOX_MIDDLE_M, ids
from sim_scenes.world import World

EXACT = SceneSpec(models=("box",), views=2, image_size=(320, 240), depth_noise=DepthNoise.off())


@pytest.fixture(scope="module")
def box_scene(object_set: ObjectSet) -> Scene:
    return simulate(EXACT, 0, object_set)


@pytest.fixture(scope="module")
def crowd(object_set: ObjectSet) -> Scene:
    spec = SceneSpec.clutter("mug", objects=(4, 4), views=2, image_size=(160, 120))
    return simulate(spec, 1, object_set)


def world_rays(frame: Frame, *, shift_px: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Origin (3,) and directions (h, w, 3) with z = 1 in the camera, through pixel centres."""
    x, y = frame.intrinsics.ray_slopes()
    x, y = np.broadcast_arrays(
        x + shift_px / frame.intrinsics.fx, y + shift_px / frame.intrinsics.fy
    )
    directions = np.stack([x, y, np.ones_like(x)], axis=-1)
    return frame.world_from_camera[:3, 3], directions @ frame.world_from_camera[:3, :3].T


def box_depth(frame: Frame, item: SceneObject, *, shift_px: float = 0.0) -> np.ndarray:
    """Exact depth (h, w) of the box by intersecting slabs; inf where the ray misses."""
    origin, directions = world_rays(frame, shift_px=shift_px)
    object_from_world = inverse(item.world_from_object)
    start = apply(object_from_world, origin[None])[0] - BOX_MIDDLE_M
    along = directions @ object_from_world[:3, :3].T
    with np.errstate(divide="ignore"):
        crossings = np.stack([(-BOX_HALF_M - start) / along, (BOX_HALF_M - start) / along])
    enter, leave = crossings.min(axis=0).max(axis=-1), crossings.max(axis=0).min(axis=-1)
    return np.where(enter < leave, enter, np.inf)


def test_rendered_depth_is_that_of_the_true_box_at_pixel_centres(box_scene: Scene) -> None:
    (box,) = box_scene.objects
    for frame in box_scene.frames:
        mask = ids(frame) == 1
        truth = box_depth(frame, box)
        error_m = np.abs(frame.depth_m - truth)[mask]
        assert np.median(error_m) < 1e-6
        assert error_m.max() < 1e-4
        # The mask is the box's silhouette, but for float32 at its very edge.
        assert (np.isfinite(truth) != mask).sum() <= 3
        # The convention matters: half a pixel off, the error is two orders above.
        shifted = np.abs(frame.depth_m - box_depth(frame, box, shift_px=0.5))[mask]
        assert np.median(shifted) > 1e-4


def test_rendered_table_is_the_plane_z_0(box_scene: Scene) -> None:
    for frame in box_scene.frames:
        origin, directions = world_rays(frame)
        truth = -origin[2] / directions[..., 2]
        at = origin + truth[..., None] * directions
        table = (np.abs(at[..., 0] - 0.45) < 0.64) & (np.abs(at[..., 1]) < 0.74)
        # The arm may stand before the table: it only ever brings depth nearer.
        seen = table & (ids(frame) == 0) & (frame.depth_m > truth - 0.002)
        assert seen.sum() > 0.5 * seen.size
        assert np.abs(frame.depth_m - truth)[seen].max() < 1e-5


def test_objects_rest_on_the_table(box_scene: Scene, crowd: Scene) -> None:
    for item in (*box_scene.objects, *crowd.objects):
        vertices, faces = item.mesh_world()
        assert faces is item.faces
        # The collision margin is 0.1 mm; the rest is the solver's give.
        assert abs(vertices[:, 2].min()) < 3e-4


def test_the_joints_give_the_camera_pose(box_scene: Scene) -> None:
    world = World()
    arm = Arm(world)
    for frame in box_scene.frames:
        joints = frame.joint_positions_rad
        assert joints is not None
        assert ((joints > LOWER_RAD) & (joints < UPPER_RAD)).all()
        np.testing.assert_allclose(forward_kinematics(joints), frame.world_from_camera, atol=1e-6)
    assert arm.joint_positions_rad().shape == (7,)


def forward_kinematics(joints: np.ndarray) -> np.ndarray:
    """Camera pose by the Panda's modified Denavit-Hartenberg table (a, alpha, d)."""
    half = np.pi / 2
    table = [
        (0, 0, 0.333),
        (0, -half, 0),
        (0, half, 0.316),
        (0.0825, half, 0),
        (-0.0825, -half, 0.384),
        (0, half, 0),
        (0.088, half, 0.107),
    ]
    pose = np.eye(4)
    # The hand is turned by -45 degrees on the flange.
    for (a, alpha, d), theta in zip(table, joints - [0, 0, 0, 0, 0, 0, np.pi / 4], strict=True):
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        pose = pose @ np.array(
            [
                [c, -s, 0, a],
                [s * ca, c * ca, -sa, -d * sa],
                [s * sa, c * sa, ca, d * ca],
                [0, 0, 0, 1],
            ]
        )
    return pose @ HAND_FROM_CAMERA


def test_views_lie_on_the_arc_and_hold_the_target(box_scene: Scene) -> None:
    hull = box_scene.objects[0].mesh_world()[0]
    middle = (hull.min(axis=0) + hull.max(axis=0)) / 2
    arc = EXACT.arc
    azimuths = []
    for frame in box_scene.frames:
        offset = frame.world_from_camera[:3, 3] - middle
        distance_m = np.linalg.norm(offset)
        assert arc.distance_m[0] - 0.002 <= distance_m <= arc.distance_m[1] + 0.002
        elevation = np.degrees(np.arcsin(offset[2] / distance_m))
        assert arc.elevation_deg[0] - 0.5 <= elevation <= arc.elevation_deg[1] + 0.5
        azimuths.append(np.arctan2(offset[1], offset[0]))
        pixels = frame.intrinsics.project(apply(inverse(frame.world_from_camera), hull))
        assert (pixels >= 3).all()
        assert (pixels <= [315, 235]).all()
    span = abs(np.angle(np.exp(1j * (azimuths[1] - azimuths[0]))))
    assert 0 < np.degrees(span) <= arc.azimuth_span_deg + 1


def test_shapes_and_types(box_scene: Scene) -> None:
    frame = box_scene.frames[0]
    assert len(box_scene.frames) == 2
    kinds = [(a.shape, a.dtype.name) for a in (frame.rgb, frame.depth_m, ids(frame))]
    assert kinds == [((240, 320, 3), "uint8"), ((240, 320), "float32"), ((240, 320), "uint16")]
    assert frame.world_from_camera.dtype.name == "float64"
    assert frame.rgb.flags.c_contiguous
    rotation = frame.world_from_camera[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert (frame.rgb[ids(frame) == 1].std(axis=0) > 0).any()


def test_clutter_is_mixed_apart_and_seen(crowd: Scene) -> None:
    assert len(crowd.objects) == 4
    assert len({item.category for item in crowd.objects}) == 4
    assert crowd.objects[0].category == "mug"
    assert [item.instance_id for item in crowd.objects] == [1, 2, 3, 4]
    for frame in crowd.frames:
        assert np.count_nonzero(ids(frame) == 1) > 20
    # Footprints are disjoint: along some direction of the plane, the two hulls are apart.
    directions = np.stack([np.cos(t := np.linspace(0, np.pi, 181)), np.sin(t)])
    for first, second in itertools.combinations(crowd.objects, 2):
        a = first.mesh_world()[0][:, :2] @ directions
        b = second.mesh_world()[0][:, :2] @ directions
        gap = np.maximum(b.min(axis=0) - a.max(axis=0), a.min(axis=0) - b.max(axis=0))
        assert gap.max() > -1e-3


SCRIPT = """
import pickle, sys
from sim_scenes import simulate
object_set, spec, seeds = pickle.loads(sys.stdin.buffer.read())
print(*(simulate(spec, seed, object_set).digest() for seed in seeds))
"""


def test_a_scene_is_a_pure_function_of_spec_and_seed(
    object_set: ObjectSet, small: SceneSpec
) -> None:
    import pickle

    def digests_elsewhere(seeds: list[int]) -> list[str]:
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT],
            input=pickle.dumps((object_set, small, seeds)),
            capture_output=True,
            check=True,
        )
        return done.stdout.decode().split()

    # In another process, in another order, after other scenes: the same bits.
    here = [simulate(small, seed, object_set).digest() for seed in (0, 1)]
    assert digests_elsewhere([1, 0]) == here[::-1]
    assert simulate(small, 0, object_set).digest() == here[0]
    assert here[0] != here[1]


def test_noise_moves_no_geometry(object_set: ObjectSet, small: SceneSpec) -> None:
    noisy = simulate(small, 3, object_set)
    exact = simulate(replace(small, depth_noise=DepthNoise.off()), 3, object_set)
    for a, b in zip(noisy.frames, exact.frames, strict=True):
        np.testing.assert_array_equal(a.rgb, b.rgb)
        np.testing.assert_array_equal(ids(a), ids(b))
        np.testing.assert_array_equal(a.world_from_camera, b.world_from_camera)
        assert not np.array_equal(a.depth_m, b.depth_m, equal_nan=True)
        assert not np.isnan(b.depth_m[ids(b) > 0]).any()


def test_looks_vary_with_the_seed_unless_switched_off(
    object_set: ObjectSet, small: SceneSpec
) -> None:
    def colours(spec: SceneSpec) -> list[np.ndarray]:
        frames = [simulate(spec, seed, object_set).frames[0] for seed in (0, 1)]
        return [frame.rgb[ids(frame) == 0].mean(axis=0) for frame in frames]

    small = replace(small, views=1)
    varied = colours(small)
    assert np.abs(varied[0] - varied[1]).max() > 10
    plain = colours(replace(small, appearance=Appearance(textures=False, light=False)))
    assert np.abs(plain[0] - plain[1]).max() < 10


def test_redraws_are_counted_with_their_reasons(object_set: ObjectSet, small: SceneSpec) -> None:
    # A steep, narrow elevation range far off is reached from few places only.
    hard = replace(
        small,
        arc=Arc(elevation_deg=(30, 32), distance_m=(0.55, 0.6), azimuth_centre_deg=(60, 180)),
        max_redraws=40,
    )
    scenes = [simulate(hard, seed, object_set) for seed in range(3)]
    redraws = [reason for scene in scenes for reason in scene.redraws]
    assert redraws
    assert all("view" in reason and "out of reach" in reason for reason in redraws)
    assert [scene.redraw_count for scene in scenes] == [len(scene.redraws) for scene in scenes]


def test_a_scene_that_cannot_be_reached_names_its_spec(
    object_set: ObjectSet, small: SceneSpec
) -> None:
    behind = Arc(azimuth_centre_deg=(0, 0), azimuth_span_deg=0, distance_m=(0.9, 0.9))
    spec = replace(small, arc=behind, max_redraws=1)
    with pytest.raises(
        SceneError, match=r"no scene of 'mug, 2 views' from seed 5 \(cup\) within 1"
    ) as caught:
        simulate(spec, 5, object_set)
    # What it names is what a benchmark's configuration lets a person change.
    remedy = str(caught.value).rpartition(". ")[2]
    assert re.findall("views|width|height|seed|objects", remedy) == [
        "views",
        "width",
        "height",
        "seed",
        "objects",
    ]


def test_what_cannot_stand_is_an_error_too(object_set: ObjectSet, tmp_path: Path) -> None:
    import trimesh

    path = tmp_path / "pin.ply"
    trimesh.creation.cone(radius=0.002, height=0.15, sections=8).apply_transform(
        np.diag([1.0, -1, -1, 1])
    ).export(path)
    pin = ObjectSet(tmp_path, (ObjectModel("pin", "bottle", path),))
    with pytest.raises(
        SceneError, match=r"\(pin\) within 1 redraws; the last draw: pin (toppled|did not come)"
    ):
        simulate(SceneSpec.single("bottle", views=1, max_redraws=1), 0, pin)


def test_models_are_chosen_by_name_category_and_count(object_set: ObjectSet) -> None:
    named = SceneSpec(models=("tin", "dish"))
    assert [m.name for m in choose_models(named, 0, object_set)] == ["tin", "dish"]
    around = SceneSpec.clutter(models=("dish",), objects=(3, 3))
    names = [m.name for m in choose_models(around, 0, object_set)]
    assert names[0] == "dish"
    assert len(set(names)) == 3
    counts = set()
    for seed in range(30):
        chosen = choose_models(SceneSpec.clutter("can", objects=(2, 4)), seed, object_set)
        assert chosen[0].name == "tin"
        assert len({m.name for m in chosen}) == len(chosen)
        counts.add(len(chosen))
    assert counts == {2, 3, 4}
    with pytest.raises(
        SpecError, match=r"no model is a laptop; the set has bowl, camera, can, mug"
    ):
        choose_models(SceneSpec.single("laptop"), 0, object_set)
    with pytest.raises(
        SpecError, match=r"no model is named 'jug'; the set has box, cup, dish, tin"
    ):
        choose_models(SceneSpec(models=("jug",)), 0, object_set)
    with pytest.raises(SpecError, match=r"objects is \(5, 5\) but the set has 4 models"):
        choose_models(SceneSpec.clutter("mug", objects=(5, 5)), 0, object_set)


def test_the_arm_knows_what_it_touches(object_set: ObjectSet) -> None:
    world = World()
    arm = Arm(world)
    pose = look_at(eye=np.array([0.45, -0.3, 0.35]), target=np.array([0.5, 0.0, 0.0]))
    ready = [(0.0, -0.3, 0.0, -2.2, 0.0, 2.0, 0.785)]
    assert arm.reach(pose, starts=ready)
    np.testing.assert_allclose(arm.world_from_camera(), pose, atol=4e-3)
    before = arm.joint_positions_rad()
    arm.hold()
    # Gravity and the controller leave the arm within a millimetre, not exactly there.
    assert 0 < np.abs(arm.joint_positions_rad() - before).max() < 5e-3
    assert arm.touches([]) is None
    low = look_at(eye=np.array([0.45, -0.3, 0.02]), target=np.array([0.5, 0.0, 0.0]))
    if arm.reach(low, starts=ready):
        assert arm.touches([]) == "the table"
    assert not arm.reach(
        look_at(eye=np.array([1.4, 0.0, 0.3]), target=np.array([0.5, 0.0, 0.0])), starts=ready
    )


def test_no_file_is_left_behind(tmp_path: Path, object_set: ObjectSet, small: SceneSpec) -> None:
    import pickle

    subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=pickle.dumps((object_set, small, [0])),
        env={"TMPDIR": str(tmp_path), "PATH": "", "PYTHONPATH": ":".join(sys.path)},
        capture_output=True,
        check=True,
        cwd=Path(__file__).parents[2],
    )
    assert not list(tmp_path.iterdir())
