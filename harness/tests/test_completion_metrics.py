"""Distances, shares and spreads worked out by hand on a square and on a few points."""

from __future__ import annotations

import numpy as np
import pytest

from harness.completion.clouds import nearest_m, observed_points, spread_evenly
from harness.completion.metrics import CloudScore, Surface, measure_cloud, score_distances
from harness.completion.spread import auroc, score_spread
from sim_scenes import Frame, Intrinsics, SceneObject

SIDE_M = 0.1
EMPTY = np.zeros(0)


def square(*, world_from_object: np.ndarray | None = None) -> SceneObject:
    """A square of 0.1 m in the plane z = 0, its corner at the origin."""
    corners = SIDE_M * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    pose = np.eye(4) if world_from_object is None else world_from_object
    return SceneObject(1, "a square", "bowl", corners, np.array([[0, 1, 2], [0, 2, 3]]), pose)


def test_two_points_and_three_samples_by_hand() -> None:
    score = score_distances(np.array([0.0, 0.010]), np.array([0.004, 0.004, 0.012]))
    assert score.points == 2
    assert score.accuracy_mm == pytest.approx(5.0)
    assert score.completeness_mm == pytest.approx(20 / 3)
    assert score.chamfer_mm == pytest.approx((5 + 20 / 3) / 2)
    assert score.within_5mm == 0.5
    # Within 5 mm one of two and two of three, within 10 mm all and two of three.
    assert score.f_5mm == pytest.approx(2 * (1 / 2) * (2 / 3) / (1 / 2 + 2 / 3))
    assert score.f_10mm == pytest.approx(2 * (2 / 3) / (1 + 2 / 3))


def test_what_is_not_there_has_no_score() -> None:
    assert score_distances(EMPTY, EMPTY) == CloudScore(0, None, None, None, None, None, None)
    alone = score_distances(np.array([0.001]), EMPTY)
    assert alone.accuracy_mm == pytest.approx(1.0)
    assert (alone.within_5mm, alone.chamfer_mm) == (1.0, None)
    missed = score_distances(EMPTY, np.array([0.002]))
    assert missed.completeness_mm == pytest.approx(2.0)
    assert (missed.f_5mm, missed.within_5mm) == (None, None)
    far = score_distances(np.array([1.0]), np.array([1.0]))
    assert (far.f_5mm, far.within_5mm) == (0.0, 0.0)


def test_points_over_a_square_are_as_far_as_they_stand() -> None:
    surface = Surface.of(square(), observed_world=np.zeros((1, 3)), seed=3)
    assert surface.samples_world.shape == (4096, 3)
    grid = np.linspace(0.0005, SIDE_M - 0.0005, 100)
    points = np.stack(np.meshgrid(grid, grid, [0.003]), axis=-1).reshape(-1, 3)
    whole = measure_cloud(points, surface).scores["all"]
    assert whole.accuracy_mm == pytest.approx(3.0)
    # No sample is farther than half a cell's diagonal of 1 mm from the point over it.
    assert whole.completeness_mm is not None
    assert 3.0 <= whole.completeness_mm <= np.hypot(3.0, np.sqrt(0.5))
    assert (whole.within_5mm, whole.f_5mm) == (1.0, 1.0)


def test_a_part_is_what_lies_near_an_observed_point() -> None:
    grid = np.linspace(0.0, SIDE_M, 201)
    left = np.stack(np.meshgrid(grid[grid <= 0.03], grid, [0.0]), axis=-1).reshape(-1, 3)
    surface = Surface.of(square(), observed_world=left, seed=3)
    # Seen is what lies left of 0.03 + 0.005; points 2 and 8 mm over the square, at both sides.
    np.testing.assert_array_equal(surface.seen, nearest_m(surface.samples_world, left) <= 0.005)
    assert surface.seen.mean() == pytest.approx(0.35, abs=0.02)
    points = np.array([[0.01, 0.05, 0.002], [0.09, 0.05, 0.008], [0.08, 0.05, -0.008]])
    scores = measure_cloud(points, surface).scores
    assert [scores[part].points for part in ("all", "seen", "unseen")] == [3, 1, 2]
    assert scores["seen"].accuracy_mm == pytest.approx(2.0)
    assert scores["unseen"].accuracy_mm == pytest.approx(8.0)
    assert scores["all"].accuracy_mm == pytest.approx(6.0)
    assert scores["all"].within_5mm == pytest.approx(1 / 3)
    assert scores["unseen"].within_5mm == 0.0
    # What lies nowhere near an unseen sample has no accuracy there.
    assert measure_cloud(points[:1], surface).scores["unseen"].accuracy_mm is None


def test_a_surface_stands_where_its_object_does() -> None:
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    pose[:3, 3] = [0.5, 0, 0]
    surface = Surface.of(square(world_from_object=pose), observed_world=np.zeros((1, 3)), seed=0)
    np.testing.assert_allclose(surface.samples_world[:, 0], 0.5)
    assert measure_cloud(np.array([[0.507, 0.05, 0.05]]), surface).distances_m == pytest.approx(
        [0.007]
    )


def test_observed_points_are_the_mask_s_valid_pixels() -> None:
    depth = np.array([[0.5, np.nan], [0.4, 0.3]], dtype=np.float32)
    pose = np.eye(4)
    pose[:3, 3] = [1.0, 0.0, 0.0]
    frame = Frame(
        rgb=np.zeros((2, 2, 3), dtype=np.uint8),
        depth_m=depth,
        instance_ids=np.array([[2, 2], [1, 2]], dtype=np.uint16),
        intrinsics=Intrinsics(2, 2, 10.0, 20.0, 0.0, 1.0),
        world_from_camera=pose,
    )
    # (u, v) = (0, 0) at 0.5 m: y = (0 - 1) / 20 * 0.5; (1, 1) at 0.3 m: x = 1 / 10 * 0.3.
    expected = [[1.0, -0.025, 0.5], [1.03, 0.0, 0.3]]
    np.testing.assert_allclose(observed_points(frame, instance_id=2), expected, atol=1e-7)
    assert observed_points(frame, instance_id=3).shape == (0, 3)


def test_an_even_choice_takes_the_farthest_next() -> None:
    line = np.array([[x, 0.0, 0.0] for x in (0.0, 1.0, 2.0, 3.0, 10.0)])
    # The mean is at 3.2: 10 is the farthest, then 0, then 3, halfway; then 2 or 1 by order.
    assert spread_evenly(line, count=4)[:, 0].tolist() == [10.0, 0.0, 3.0, 1.0]
    assert spread_evenly(line, count=9).tolist() == line.tolist()
    many = np.random.default_rng(0).random((20_000, 3))
    assert spread_evenly(many, count=50).shape == (50, 3)


@pytest.mark.parametrize(
    ("values", "positive", "expected"),
    [
        ([1, 2, 3, 4], [0, 0, 1, 1], 1.0),
        ([1, 2, 3, 4], [1, 0, 0, 1], 0.5),
        ([5, 5, 5], [0, 1, 1], 0.5),
        ([1, 2, 2, 3], [0, 1, 0, 1], 0.875),
        ([1, 2], [1, 1], None),
        ([1, 2], [0, 0], None),
    ],
)
def test_auroc_counts_pairs(
    values: list[float], positive: list[int], expected: float | None
) -> None:
    assert auroc(np.array(values, float), np.array(positive, bool)) == expected


def test_a_spread_is_held_against_the_distance() -> None:
    spread, distance = np.array([0.001, 0.002, 0.009]), np.array([0.0, 0.005, 0.010])
    score = score_spread(spread, np.array([0.9, 0.8, 0.4]), distance)
    assert score.spread_mm == pytest.approx(4.0)
    assert score.distance_mm == pytest.approx(5.0)
    assert score.right_mm == pytest.approx(1.5)
    assert score.wrong_mm == pytest.approx(9.0)
    assert score.auroc == 1.0
    assert score.within_5mm_claimed == pytest.approx(0.7)
    assert score_spread(spread, spread, np.zeros(3)).wrong_mm is None
