from __future__ import annotations

import math

import numpy as np
import pytest

from sim_scenes.camera import (
    FAR_M,
    HAND_FROM_CAMERA,
    NEAR_M,
    Intrinsics,
    d435_intrinsics,
    depth_from_buffer,
    projection_matrix,
)
from sim_scenes.geometry import apply, inverse


def test_d435_at_vga_has_the_focal_length_such_cameras_report() -> None:
    camera = d435_intrinsics(width=640, height=480)
    assert camera.fx == camera.fy == pytest.approx(616.0, abs=0.2)
    assert (camera.cx, camera.cy) == (319.5, 239.5)
    # At 16:9 the whole sensor is used: the field of view reaches to the outer pixels' borders.
    wide = d435_intrinsics(width=1920, height=1080)
    assert math.degrees(2 * math.atan(960 / wide.fx)) == pytest.approx(69.4)


def test_the_first_pixel_centre_is_at_zero() -> None:
    camera = Intrinsics(4, 2, 2.0, 2.0, 1.5, 0.5)
    x, y = camera.ray_slopes()
    assert x.tolist() == [[-0.75, -0.25, 0.25, 0.75]]
    assert y.tolist() == [[-0.25], [0.25]]
    points = np.array([[-0.75, -0.25, 1.0], [1.5, 0.5, 2.0]])
    assert camera.project(points).tolist() == [[0.0, 0.0], [3.0, 1.0]]


def test_projection_puts_pixel_centres_where_the_renderer_samples() -> None:
    camera = Intrinsics(640, 480, 600.0, 610.0, 300.0, 250.0)
    matrix = np.array(projection_matrix(camera)).reshape(4, 4).T
    for u, v in ((0, 0), (639, 479), (300, 250)):
        ray = np.array([(u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy, -1.0])
        clip = matrix @ np.append(0.5 * ray, 1.0)
        ndc = clip / clip[3]
        # TinyRenderer samples column u at u and row v, counted from below, at its lower edge.
        assert (ndc[0] + 1) / 2 * 640 == pytest.approx(u, abs=1e-9)
        assert (ndc[1] + 1) / 2 * 480 == pytest.approx(480 - 1 - v, abs=1e-9)


@pytest.mark.parametrize(("depth_m", "ndc"), [(NEAR_M, -1.0), (FAR_M, 1.0)])
def test_projection_spans_near_to_far(depth_m: float, ndc: float) -> None:
    matrix = np.array(projection_matrix(d435_intrinsics(width=64, height=48))).reshape(4, 4).T
    clip = matrix @ np.array([0, 0, -depth_m, 1.0])
    assert clip[2] / clip[3] == pytest.approx(ndc)


def test_the_depth_buffer_resolves_a_micrometre_at_half_a_metre() -> None:
    depth_m = np.linspace(0.2, 0.6, 1001)
    buffer = (FAR_M * (depth_m - NEAR_M) / (depth_m * (FAR_M - NEAR_M))).astype(np.float32)
    restored = depth_from_buffer(buffer)
    assert restored.dtype == np.float32
    assert np.abs(restored - depth_m).max() < 1e-6
    assert np.isnan(depth_from_buffer(np.ones(1, dtype=np.float32)))


def test_the_camera_looks_along_the_fingers_which_stay_out_of_view() -> None:
    np.testing.assert_array_equal(HAND_FROM_CAMERA[:3, 2], [0, 0, 1])
    assert np.linalg.det(HAND_FROM_CAMERA[:3, :3]) == 1
    # Corners of the open fingers' boxes in the hand: 2 cm wide, 5 cm aside, to 11.5 cm ahead.
    fingers = np.array(
        [[x, y, z] for x in (-0.01, 0.01) for y in (-0.06, 0.06) for z in (0.05, 0.115)]
    )
    ahead = apply(inverse(HAND_FROM_CAMERA), fingers)
    camera = d435_intrinsics(width=640, height=480)
    pixels = camera.project(ahead)
    outside = (pixels < 0) | (pixels > [639, 479])
    assert outside.any(axis=1).all()
    # All on one side, so nothing between them is in view either.
    assert (pixels[:, 1] < 0).all() or (pixels[:, 1] > 479).all()
