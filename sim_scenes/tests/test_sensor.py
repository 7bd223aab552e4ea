from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_scenes import DepthNoise, Intrinsics, SpecError
from sim_scenes.sensor import (
    at_edges,
    incidence_angle,
    metres_from_raw,
    on_depth_grid,
    raw_from_metres,
)

OFF = DepthNoise.off()
# Depth noise focal length of 320 px, as at VGA; only the width counts for it.
WIDE = Intrinsics(640, 200, 616.0, 616.0, 319.5, 99.5)


def flat(depth_m: float, camera: Intrinsics = WIDE) -> np.ndarray:
    return np.full((camera.height, camera.width), depth_m, dtype=np.float32)


def run(
    noise: DepthNoise, depth_m: np.ndarray, camera: Intrinsics = WIDE, seed: int = 0
) -> np.ndarray:
    return noise.apply(depth_m, intrinsics=camera, random=np.random.default_rng(seed))


def test_all_off_is_the_exact_depth_bit_for_bit() -> None:
    depth_m = np.random.default_rng(0).uniform(0.05, 4, (200, 640)).astype(np.float32)
    depth_m[3, 5] = np.nan
    assert run(OFF, depth_m).tobytes() == depth_m.tobytes()


@pytest.mark.parametrize(("depth_m", "sigma_mm"), [(0.3, 0.5625), (0.5, 1.5625), (1.0, 6.25)])
def test_axial_noise_has_the_stated_deviation(depth_m: float, sigma_mm: float) -> None:
    # sigma = z^2 s / (f B) with s = 0.1 px, f = 320 px, B = 0.05 m.
    error_mm = 1e3 * (run(replace(OFF, axial=True), flat(depth_m)) - depth_m)
    assert error_mm.std() == pytest.approx(sigma_mm, rel=0.01)
    # Noise of the disparity shifts the mean depth only in second order, z (s/d)^2.
    assert (
        abs(error_mm.mean())
        < 4 * sigma_mm / np.sqrt(error_mm.size) + 1e3 * depth_m * (0.1 * depth_m / 16) ** 2
    )


def test_quantised_depths_are_whole_steps_of_disparity() -> None:
    depth_m = np.linspace(0.3, 0.6, 640 * 200, dtype=np.float32).reshape(200, 640)
    steps = 320 * 0.05 * 32 / run(replace(OFF, quantisation=True), depth_m).astype(np.float64)
    np.testing.assert_allclose(steps, np.round(steps), atol=2e-4)
    # Each depth goes to the nearest step: half a step is z^2 / (f B) / 64 = 0.24 mm at 0.5 m.
    error = np.abs(run(replace(OFF, quantisation=True), depth_m) - depth_m)
    assert (error <= depth_m**2 / 16 / 64 * 1.01).all()


def test_minimum_range() -> None:
    depth_m = np.array([[0.1999, 0.2, 0.2001, np.nan]], dtype=np.float32)
    kept = run(replace(OFF, min_range=True), depth_m, Intrinsics(4, 1, 4, 4, 1.5, 0))
    # 0.2 rounds up in float32, so it is not below the limit.
    np.testing.assert_array_equal(np.isnan(kept), [[True, False, False, True]])


def test_edges_are_both_sides_of_a_step_and_no_slope() -> None:
    depth_m = flat(0.5)
    depth_m[:, 320:] = 0.6
    edge = at_edges(depth_m, jump=0.02)
    np.testing.assert_array_equal(np.flatnonzero(edge.any(axis=0)), [319, 320])
    assert edge[:, 319:321].all()
    slope = np.tile(np.linspace(0.4, 0.8, 640, dtype=np.float32), (200, 1))
    assert not at_edges(slope, jump=0.02).any()


def test_an_outline_against_the_void_is_an_edge() -> None:
    depth_m = np.full((5, 5), np.nan, dtype=np.float32)
    depth_m[1:4, 1:4] = 0.5
    edge = at_edges(depth_m, jump=0.02)
    assert edge[1:4, 1:4].sum() == 8
    assert not edge[2, 2]


def test_edge_loss_has_the_stated_share() -> None:
    depth_m = flat(0.5)
    depth_m[:, ::4] = 0.6
    edge = at_edges(depth_m, jump=0.02)
    lost = np.isnan(run(replace(OFF, edge_dropout=True, edge_loss=0.3), depth_m))
    assert not lost[~edge].any()
    assert lost[edge].mean() == pytest.approx(0.3, abs=0.01)


def plane(camera: Intrinsics, angle_rad: float) -> np.ndarray:
    """Depth of a plane through (0, 0, 0.5) whose normal leans by an angle from the axis."""
    x, _ = camera.ray_slopes()
    depth = 0.5 * np.cos(angle_rad) / (np.cos(angle_rad) + x * np.sin(angle_rad))
    return np.tile(depth, (camera.height, 1)).astype(np.float32)


@pytest.mark.parametrize("degrees", [0, 30, 60, 75])
def test_incidence_angle_of_a_tilted_plane(degrees: float) -> None:
    camera = Intrinsics(101, 3, 600.0, 600.0, 50.0, 1.0)
    angle = incidence_angle(plane(camera, np.radians(degrees)), camera)
    x, y = camera.ray_slopes()
    normal = np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
    expected = np.arccos((x * normal[0] + normal[2]) / np.sqrt(x**2 + y**2 + 1))
    # One-sided differences of float32 depth: a tenth of a degree.
    np.testing.assert_allclose(np.degrees(angle), np.degrees(expected), atol=0.25)


def test_a_depth_edge_is_not_grazing() -> None:
    depth_m = flat(0.5)
    depth_m[:, 320:] = 0.6
    assert np.degrees(incidence_angle(depth_m, WIDE)).max() < 35


def test_grazing_loss_grows_from_begin_to_end() -> None:
    camera = Intrinsics(101, 401, 6000.0, 6000.0, 50.0, 200.0)
    noise = replace(OFF, grazing_dropout=True)
    shares = [
        np.isnan(run(noise, plane(camera, np.radians(degrees)), camera)).mean()
        for degrees in (60, 77.5, 87)
    ]
    assert shares[0] == 0
    assert shares[1] == pytest.approx(0.5, abs=0.03)
    assert shares[2] > 0.98


def test_switching_one_effect_moves_no_other() -> None:
    depth_m = np.random.default_rng(1).uniform(0.3, 0.5, (200, 640)).astype(np.float32)
    axial = run(replace(OFF, axial=True), depth_m)
    both = run(replace(OFF, axial=True, edge_dropout=True, grazing_dropout=True), depth_m)
    kept = ~np.isnan(both)
    np.testing.assert_array_equal(both[kept], axial[kept])


def test_every_16_bit_depth_survives_its_grid() -> None:
    raw = np.arange(65536, dtype=np.uint16)
    depth_m = metres_from_raw(raw, unit_m=1e-4)
    assert np.isnan(depth_m[0])
    np.testing.assert_array_equal(raw_from_metres(depth_m, unit_m=1e-4), raw)
    # The reader's unit, from BOP's millimetres, is the same number.
    assert 0.1 / 1000.0 == 1e-4
    beyond = np.array([0.00001, 6.6, np.nan, np.inf], dtype=np.float32)
    assert raw_from_metres(beyond, unit_m=1e-4).tolist() == [0, 0, 0, 0]


def test_z16_rounds_to_a_tenth_of_a_millimetre() -> None:
    depth_m = np.array([[0.50004, 0.50006]], dtype=np.float32)
    assert on_depth_grid(depth_m, unit_m=1e-4).tolist() == [[np.float32(0.5), np.float32(0.5001)]]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("baseline_m", 0.0),
        ("disparity_step_px", float("nan")),
        ("subpixel_px", -1.0),
        ("depth_hfov_deg", 180.0),
        ("edge_loss", 1.5),
        ("grazing_deg", (80.0, 70.0)),
        ("depth_unit_m", float("inf")),
    ],
)
def test_impossible_constants_are_named(name: str, value: Any) -> None:
    with pytest.raises(SpecError, match=f"{name} is "):
        DepthNoise(**{name: value})
