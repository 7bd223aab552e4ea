"""Baselines on boxes whose completion is known, and the handle of a generated mug."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from harness.completion.baselines import CLOUD_POINTS, mirrored, observed_only, scaled_mean_shape
from harness.completion.clouds import nearest_m
from harness.completion.handle import BEYOND, Outcome, find_handle
from harness.completion.mean_shape import MeanShape, mean_shape, medoid
from harness.drawn_points import surface_points
from sim_scenes.objects.draws import Split, stream
from sim_scenes.objects.handle import Handle
from sim_scenes.objects.mug import MugParams, build

# A box of 8 x 6 x 10 cm on the table z = 0, about (0.5, 0.1).
LOW, HIGH = np.array([0.46, 0.07, 0.0]), np.array([0.54, 0.13, 0.1])


def faces(*, of: str, count: int = 41) -> np.ndarray:
    """Points on faces of the unit box: a side's axis and end, such as ``x0``."""
    grid = np.linspace(0.0, 1.0, count)
    parts = []
    for name in of.split():
        axis, end = "xyz".index(name[0]), float(name[1])
        side = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
        parts.append(np.insert(side, axis, end, axis=1))
    return np.concatenate(parts)


def boxed(points: np.ndarray) -> np.ndarray:
    return np.asarray(LOW + points * (HIGH - LOW))


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    """About the vertical through the box's middle."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    middle = np.append((LOW + HIGH)[:2] / 2, 0.0)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return np.asarray((points - middle) @ turn.T + middle)


def test_what_was_observed_is_thinned_and_nothing_added() -> None:
    observed = boxed(faces(of="x0 z1", count=61))
    cloud = observed_only(observed)
    assert cloud.shape == (CLOUD_POINTS, 3)
    assert nearest_m(cloud, observed).max() == 0.0
    assert nearest_m(observed, cloud).max() < 0.004


def test_a_box_s_face_is_mirrored_to_the_face_behind() -> None:
    # The camera stands at smaller x and sees the near face and the top.
    observed = boxed(faces(of="x0 z1"))
    cloud = mirrored(observed, camera_world=np.array([0.1, 0.1, 0.4]))
    whole = boxed(faces(of="x0 x1 z1"))
    assert nearest_m(cloud, whole).max() < 1e-3
    assert nearest_m(whole, cloud).max() < 5e-3


def test_a_camera_straight_above_mirrors_nothing() -> None:
    observed = boxed(faces(of="z1"))
    camera = np.append(observed.mean(axis=0)[:2], 1.0)
    assert nearest_m(mirrored(observed, camera_world=camera), observed).max() < 1e-12


@pytest.mark.parametrize("yaw", [0.0, 30.0, 70.0])
def test_the_mean_shape_takes_the_observed_size_place_and_yaw(yaw: float) -> None:
    shape = MeanShape("bowl", 0, faces(of="x0 x1 y0 y1 z0 z1", count=31))
    # The upper part of two sides and the top: the table gives the rest of the height.
    corner = faces(of="x0 y0 z1")
    observed = turned(boxed(corner[corner[:, 2] > 0.4]), yaw)
    cloud = scaled_mean_shape(shape, observed, table_height_m=0.0)
    whole = turned(boxed(shape.points_unit), yaw)
    assert nearest_m(cloud, whole).max() < 3e-3
    assert nearest_m(whole, cloud).max() < 3e-3


def test_the_medoid_is_in_the_middle() -> None:
    # Sums of distances to the others: 3.5, 2.5 and 4.
    assert medoid([np.array([[x, 0.0, 0.0]]) for x in (0.0, 1.0, 2.5)]) == 1


def test_a_mean_shape_is_a_training_shape_in_the_unit_box() -> None:
    shape = mean_shape("bowl", shapes=3)
    assert shape.index in range(3)
    assert shape.points_unit.shape == (2048, 3)
    assert (shape.points_unit >= -1e-9).all()
    assert (shape.points_unit <= 1 + 1e-9).all()
    assert np.ptp(shape.points_unit, axis=0) == pytest.approx([1, 1, 1], abs=0.03)


# --- the handle ---


def mug_params(kind: Handle) -> MugParams:
    for index in range(100):
        random = stream(split=Split.VALIDATION, category="mug", index=index, seed=0)
        params = MugParams.draw(random)
        if params.handle.kind is kind:
            return params
    raise AssertionError(kind)


def mug_points(params: MugParams, *, count: int = 4096) -> np.ndarray:
    mesh = build(params)
    return surface_points(
        np.asarray(mesh.vertices),
        np.asarray(mesh.faces),
        count=count,
        random=np.random.default_rng(0),
    )


@pytest.mark.parametrize("kind", [Handle.ROUND, Handle.SQUARE, Handle.EAR])
def test_the_handle_of_a_generated_mug_is_found(kind: Handle) -> None:
    params = mug_params(kind)
    # Wherever it stands and whichever way it faces.
    points = mug_points(params)
    c, s = np.cos(2.0), np.sin(2.0)
    moved = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [0.3, -0.2, 0.1]
    mug = find_handle(moved)
    assert mug is not None
    assert mug.axis == pytest.approx([0.3, -0.2], abs=1e-3)
    assert mug.direction_rad == pytest.approx(2.0, abs=0.05)
    # The generator knows the body's radius by height.
    side = params.outer()
    radius = np.interp(points[:, 2], side[:, 1], side[:, 0])
    expected = np.hypot(points[:, 0], points[:, 1]) > BEYOND * radius
    assert (mug.is_handle(moved) == expected).mean() > 0.995
    assert expected.sum() > 50


def test_a_mug_without_a_handle_has_none() -> None:
    assert find_handle(mug_points(mug_params(Handle.NONE))) is None


def test_a_completed_handle_is_right_elsewhere_or_missing() -> None:
    params = mug_params(Handle.ROUND)
    points = mug_points(params)
    mug = find_handle(points)
    assert mug is not None
    outcome, made = mug.outcome(points)
    assert outcome is Outcome.RIGHT
    assert (made <= mug.is_handle(points)).all()
    for degrees, expected in ((20, Outcome.RIGHT), (45, Outcome.WRONG), (180, Outcome.WRONG)):
        c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        moved = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        assert mug.outcome(moved)[0] is expected
    bare = replace(params, handle=replace(params.handle, kind=Handle.NONE))
    outcome, made = mug.outcome(mug_points(bare))
    assert (outcome, made.sum()) == (Outcome.LEFT_OUT, 0)
    # A body 3 mm too wide is no handle.
    wide = points[~mug.is_handle(points)] * (1 + 0.003 / params.diameter_m * 2, 1.0, 1.0)
    assert mug.outcome(wide)[0] is Outcome.LEFT_OUT
