"""The protocol's test points and their truth."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from harness.protocol import box_test_points, true_categories
from sim_scenes import SceneObject

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
