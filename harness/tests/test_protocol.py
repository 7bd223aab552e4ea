"""The protocol's test points and their truth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from harness.drawn_points import box_test_points, draw_test_points, perturbed_test_points
from harness.protocol import COMPLETIONS, completion_name, test_set_of as set_of, true_categories
from harness.tests.fake_completer import FakeCompletions
from sim_scenes import SceneObject
from sim_scenes.streams import stream

LOW, HIGH = np.array([0.01, -0.04, 0.0]), np.array([0.05, 0.04, 0.1])


def item(category: str = "mug", *, world_from_object: np.ndarray | None = None) -> SceneObject:
    corners = np.array([LOW, HIGH, [0.02, 0.0, 0.05]])
    return SceneObject(
        instance_id=1,
        name=f"a {category}",
        category=category,
        vertices=corners,
        faces=np.array([[0, 1, 2]]),
        world_from_object=np.eye(4) if world_from_object is None else world_from_object,
    )


def turned() -> np.ndarray:
    """Leaning by 30 degrees about the world's y axis after a turn of 45 about its own z."""
    (c, s), (a, b) = (np.cos(np.pi / 4), np.sin(np.pi / 4)), (np.cos(np.pi / 6), 0.5)
    pose = np.eye(4)
    about_y = np.array([[a, 0, b], [0, 1, 0], [-b, 0, a]])
    pose[:3, :3] = about_y @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    pose[:3, 3] = [0.5, -0.2, 0.3]
    return pose


def test_points_fill_the_objects_own_box_wherever_it_stands() -> None:
    pose = turned()
    points = box_test_points(item(world_from_object=pose), count=4000, seed=5)
    assert points.shape == (4000, 3)
    assert points.dtype == np.float64
    assert points.flags.c_contiguous
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    assert (local >= LOW - 1e-12).all()
    assert (local <= HIGH + 1e-12).all()
    # Of 4000 even draws the outermost lies within 1 % of a side's end, and the mean within four
    # standard errors (a side over sqrt(12 n)) of its middle.
    assert_allclose(local.min(axis=0), LOW, atol=0.01 * (HIGH - LOW).max())
    assert_allclose(local.max(axis=0), HIGH, atol=0.01 * (HIGH - LOW).max())
    assert (np.abs(local.mean(axis=0) - (LOW + HIGH) / 2) < 4 * (HIGH - LOW) / 219).all()


def test_a_seed_fixes_the_points_and_they_move_with_the_object() -> None:
    still = box_test_points(item(), count=50, seed=5)
    assert_array_equal(still, box_test_points(item(), count=50, seed=5))
    assert (still != box_test_points(item(), count=50, seed=6)).all()
    assert_array_equal(still[:20], box_test_points(item(), count=20, seed=5))
    pose = turned()
    moved = box_test_points(item(world_from_object=pose), count=50, seed=5)
    assert_allclose(moved, still @ pose[:3, :3].T + pose[:3, 3], atol=1e-15)


def square(side_m: float, *, z: float) -> tuple[np.ndarray, np.ndarray]:
    """A flat square about the z axis, as a triangle of half its area and two of a quarter."""
    h = side_m / 2
    corners = [[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z], [0, 0, z]]
    return np.array(corners), np.array([[0, 1, 2], [2, 3, 4], [3, 0, 4]])


def plate(*, world_from_object: np.ndarray | None = None) -> SceneObject:
    """Two squares of 0.2 m, 0.1 m apart: the middle of their box is (0, 0, 0.05)."""
    (low, faces), (high, _) = square(0.2, z=0.0), square(0.2, z=0.1)
    return SceneObject(
        instance_id=1,
        name="a plate",
        category="bowl",
        vertices=np.concatenate([low, high]),
        faces=np.concatenate([faces, faces + len(low)]),
        world_from_object=np.eye(4) if world_from_object is None else world_from_object,
    )


def test_surface_points_are_spread_by_area(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.drawn_points.SCALE_ERROR", (0.0, 0.0))
    monkeypatch.setattr("harness.drawn_points.SHIFT_M", 0.0)
    monkeypatch.setattr("harness.drawn_points.NOISE_M", (0.0, 0.0))
    points = perturbed_test_points(plate(), count=8000, seed=1)
    assert points.shape == (8000, 3)
    assert points.flags.c_contiguous
    assert set(np.round(points[:, 2], 12)) == {0.0, 0.1}
    # Each of 2 x 4 x 4 tiles of equal area holds 250 points, give or take four deviations.
    tiles, _ = np.histogramdd(points, bins=(4, 4, 2), range=[(-0.1, 0.1), (-0.1, 0.1), (0, 0.1)])
    assert np.abs(tiles - 250).max() < 4 * np.sqrt(250)


@pytest.mark.parametrize("seed", range(8))
def test_a_perturbed_instance_is_scaled_shifted_and_noisy(seed: int) -> None:
    points = perturbed_test_points(plate(), count=20_000, seed=seed)
    # By hand: a plate at z in {0, 0.1} becomes one at 0.05 -+ 0.05 s + shift, s the scale.
    upper = points[:, 2] > 0.05
    low, high = points[~upper].mean(axis=0), points[upper].mean(axis=0)
    scale = (high[2] - low[2]) / 0.1
    assert 0.05 - 0.002 < abs(scale - 1) < 0.10 + 0.002
    shift = (high + low) / 2 - [0, 0, 0.05]
    # The middle of 20,000 points even over 0.2 m is good to 0.4 mm in x and y: six deviations.
    assert abs(np.linalg.norm(shift) - 0.004) < 0.0024
    for part in (points[upper], points[~upper]):
        assert 0.0019 < part[:, 2].std() < 0.0031


def test_perturbations_differ_between_scenes() -> None:
    clouds = [perturbed_test_points(plate(), count=4000, seed=seed) for seed in range(40)]
    heights = [np.ptp([c[c[:, 2] > 0.05, 2].mean(), c[c[:, 2] < 0.05, 2].mean()]) for c in clouds]
    scales = np.array(heights) / 0.1
    assert (scales < 0.96).any()
    assert (scales > 1.04).any()
    assert len(set(np.round(scales, 6))) == 40


def test_a_perturbed_set_stands_where_the_object_does() -> None:
    pose = turned()
    still = perturbed_test_points(plate(), count=60, seed=3)
    moved = perturbed_test_points(plate(world_from_object=pose), count=60, seed=3)
    # Shift and noise are the world's: what is left of them after turning back is the same.
    random = stream(3, "perturbed instance")
    random.choice((-1.0, 1.0))
    random.uniform(0.05, 0.10)
    direction = random.normal(size=3)
    noise_m = random.uniform(0.002, 0.003)
    error = 0.004 * direction / np.linalg.norm(direction) + stream(3, "perturbed noise").normal(
        scale=noise_m, size=(60, 3)
    )
    assert_allclose(moved - error, (still - error) @ pose[:3, :3].T + pose[:3, 3], atol=1e-15)
    assert_array_equal(perturbed_test_points(plate(), count=20, seed=3), still[:20])


def test_every_test_set_has_a_completion_of_its_own() -> None:
    assert COMPLETIONS == {"box": "none", "perturbed": "perturbed"}
    for test_set, draw in (("box", box_test_points), ("perturbed", perturbed_test_points)):
        points = draw_test_points(plate(), test_set=test_set, count=5, seed=7)
        assert_array_equal(points, draw(plate(), count=5, seed=7))


@pytest.mark.parametrize(
    ("completer", "name"),
    [
        ("cloud", "cloud"),
        ("centersnap", "centersnap"),
        ("python:my.tools.complete", "complete"),
        ("python:my.tools.perturbed", "my.tools.perturbed"),
    ],
)
def test_a_completed_set_has_the_name_of_its_completer(completer: str, name: str) -> None:
    pipeline = FakeCompletions(completer=completer)
    assert completion_name("completed", pipeline) == name
    assert set_of(name) == "completed"
    for test_set, drawn in COMPLETIONS.items():
        assert completion_name(test_set, pipeline) == drawn
        assert set_of(drawn) == test_set


def test_a_face_without_area_is_no_problem() -> None:
    flat = plate()
    faces = np.concatenate([flat.faces, [[0, 0, 1], [2, 2, 2]]])
    thin = SceneObject(1, "thin", "bowl", flat.vertices, faces, np.eye(4))
    assert np.isfinite(perturbed_test_points(thin, count=500, seed=0)).all()


def test_a_point_belongs_to_the_nearest_mesh_within_the_tolerance() -> None:
    distances_m = np.array(
        [
            [0.001, 0.004, 0.0050, 0.006, 0.0],
            [0.002, 0.003, 0.0200, 0.007, 0.0],
        ]
    )
    objects = [item("mug"), item("bowl")]
    found = true_categories(distances_m, objects, tolerance_m=0.005)
    assert found.tolist() == ["mug", "bowl", "mug", "free", "mug"]
    found = true_categories(distances_m, objects, tolerance_m=0.0025)
    assert found.tolist() == ["mug", "free", "free", "free", "mug"]


@pytest.mark.parametrize("categories", [["mug"], ["can", "laptop"]])
def test_a_tolerance_of_none_leaves_only_what_touches(categories: list[str]) -> None:
    distances_m = np.full((len(categories), 2), 0.1)
    distances_m[-1, 1] = 0.0
    objects = [item(category) for category in categories]
    found = true_categories(distances_m, objects, tolerance_m=0.0)
    assert found.tolist() == ["free", categories[-1]]
