"""Depth as a RealSense D435 would report it, each effect on its own switch.

The effects run in this order:

1. what the stereo matcher loses: depth edges, grazing surfaces, the minimum range;
2. Gaussian noise of the disparity, whose first-order effect on depth is
   sigma(z) = z^2 s / (f B) (Keselman et al. 2017, "Intel RealSense Stereoscopic Depth Cameras");
3. quantisation of the disparity to 1/32 px (Grunnet-Jepsen et al., "Subpixel linearity improvement
   for Intel RealSense depth cameras"): 0.5 mm at 0.5 m, below the noise of 1.6 mm;
4. rounding to the 16-bit output's unit.

With everything off, depth passes through bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from sim_scenes.errors import SpecError

if TYPE_CHECKING:
    from sim_scenes.camera import Intrinsics
    from sim_scenes.geometry import Floats

DepthImage = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class DepthNoise:
    """Switches and constants of the depth sensor.

    Attributes
    ----------
    axial, quantisation, edge_dropout, grazing_dropout, min_range, z16
        The switches.
    subpixel_px
        Standard deviation s of the disparity.
    baseline_m
        Baseline B.
    depth_hfov_deg
        Horizontal field of view of the infrared pair; with the image's width it gives f.
    disparity_step_px
        Quantum of the disparity.
    edge_jump
        A pixel lies at an edge when depth changes by more than this share of itself towards one
        of its 8 neighbours.
    edge_loss
        Probability that a pixel at an edge is lost.
    grazing_deg
        Angles between normal and ray at which loss begins and is complete; linear in between.
    min_range_m
        Nearer surfaces are lost.
    depth_unit_m
        Unit of the 16-bit output: 0.1 mm, the device's high-accuracy setting.
    """

    axial: bool = True
    quantisation: bool = True
    edge_dropout: bool = True
    grazing_dropout: bool = True
    min_range: bool = True
    z16: bool = True
    subpixel_px: float = 0.1
    baseline_m: float = 0.05
    depth_hfov_deg: float = 90.0
    disparity_step_px: float = 1 / 32
    edge_jump: float = 0.02
    edge_loss: float = 0.5
    grazing_deg: tuple[float, float] = (70.0, 85.0)
    min_range_m: float = 0.2
    depth_unit_m: float = 1e-4

    def __post_init__(self) -> None:
        positive = {
            name: getattr(self, name)
            for name in ("baseline_m", "disparity_step_px", "edge_jump", "depth_unit_m")
        }
        for name, value in positive.items():
            if not (math.isfinite(value) and value > 0):
                raise SpecError(f"{name} is {value}; it must be positive and finite")
        for name in ("subpixel_px", "min_range_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise SpecError(f"{name} is {value}; it must be finite and at least 0")
        if not 0 < self.depth_hfov_deg < 180:
            raise SpecError(f"depth_hfov_deg is {self.depth_hfov_deg}; it must lie in (0, 180)")
        if not 0 <= self.edge_loss <= 1:
            raise SpecError(f"edge_loss is {self.edge_loss}; it must lie in [0, 1]")
        begin, end = self.grazing_deg
        if not 0 <= begin < end <= 90:
            raise SpecError(f"grazing_deg is {self.grazing_deg}; give (begin, end) in [0, 90]")

    @classmethod
    def off(cls) -> DepthNoise:
        """No effect at all: the renderer's exact depth."""
        return replace(
            cls(),
            axial=False,
            quantisation=False,
            edge_dropout=False,
            grazing_dropout=False,
            min_range=False,
            z16=False,
        )

    def disparity_scale(self, width: int) -> float:
        """Product f B of an image of this width, px m: disparity is this over depth."""
        return width / 2 / math.tan(math.radians(self.depth_hfov_deg / 2)) * self.baseline_m

    def apply(
        self, depth_m: DepthImage, *, intrinsics: Intrinsics, random: np.random.Generator
    ) -> DepthImage:
        """Degrade exact depth (h, w) in metres, NaN where nothing is seen."""
        # Every effect's draws are made whatever its switch, so that switching one moves no other.
        edge_draw, grazing_draw = random.random((2, *depth_m.shape))
        normal_draw = random.standard_normal(depth_m.shape)
        lost = np.zeros(depth_m.shape, dtype=bool)
        if self.edge_dropout:
            lost |= at_edges(depth_m, jump=self.edge_jump) & (edge_draw < self.edge_loss)
        if self.grazing_dropout:
            begin, end = np.radians(self.grazing_deg)
            angle = incidence_angle(depth_m, intrinsics)
            lost |= grazing_draw < (angle - begin) / (end - begin)
        if self.min_range:
            lost |= depth_m < self.min_range_m
        if self.axial or self.quantisation:
            depth_m = self._through_disparity(depth_m, normal_draw)
        if self.z16:
            depth_m = on_depth_grid(depth_m, unit_m=self.depth_unit_m)
        return np.where(lost, np.float32(np.nan), depth_m) if lost.any() else depth_m

    def _through_disparity(self, depth_m: DepthImage, normal_draw: Floats) -> DepthImage:
        scale = self.disparity_scale(depth_m.shape[1])
        disparity_px = scale / depth_m.astype(np.float64)
        if self.axial:
            disparity_px += self.subpixel_px * normal_draw
        if self.quantisation:
            disparity_px = np.round(disparity_px / self.disparity_step_px) * self.disparity_step_px
        # A disparity of zero is infinitely far: no measurement.
        positive = np.where(disparity_px > 0, disparity_px, np.nan)
        return (scale / positive).astype(np.float32)


def metres_from_raw(raw: npt.NDArray[np.uint16], *, unit_m: float) -> DepthImage:
    """Depth of the 16-bit output: 0 means no measurement."""
    return np.where(raw > 0, raw * np.float64(unit_m), np.nan).astype(np.float32)


def raw_from_metres(depth_m: DepthImage, *, unit_m: float) -> npt.NDArray[np.uint16]:
    """Round depth to the 16-bit output; what does not fit becomes 0, no measurement."""
    units = np.round(depth_m.astype(np.float64) / unit_m)
    return np.where((units >= 1) & (units <= 65535), units, 0).astype(np.uint16)


def on_depth_grid(depth_m: DepthImage, *, unit_m: float) -> DepthImage:
    """Depth after a trip through the 16-bit output."""
    return metres_from_raw(raw_from_metres(depth_m, unit_m=unit_m), unit_m=unit_m)


def at_edges(depth_m: DepthImage, *, jump: float) -> Mask:
    """Pixels (h, w) whose depth changes by more than `jump` times itself towards a neighbour."""
    # The void is far away, so that an outline against it is an edge too.
    far = np.nan_to_num(depth_m.astype(np.float64), nan=1e6)
    nearest, farthest = far, far
    for axis in (0, 1):
        nearest = _over_three(nearest, np.minimum, axis=axis)
        farthest = _over_three(farthest, np.maximum, axis=axis)
    return (farthest - far > jump * far) | (far - nearest > jump * nearest)


def _over_three(image: Floats, choose: np.ufunc, *, axis: int) -> Floats:
    """Extremum of each pixel and its two neighbours along an axis."""
    padding = [(0, 0), (0, 0)]
    padding[axis] = (1, 1)
    padded = np.pad(image, padding, mode="edge")
    size = image.shape[axis]
    before, after = (np.take(padded, range(k, k + size), axis=axis) for k in (0, 2))
    extremum: Floats = choose(choose(before, image), after)
    return extremum


def incidence_angle(depth_m: DepthImage, intrinsics: Intrinsics) -> Floats:
    """Angle (h, w) between surface normal and viewing ray, radians; 0 where it is unknown.

    Of the two one-sided differences along an axis the smaller is taken, so that a pixel beside a
    depth edge keeps the slope of its own surface.
    """
    depth = depth_m.astype(np.float64)
    slope_u, slope_v = _slope(depth, axis=1), _slope(depth, axis=0)
    x, y = intrinsics.ray_slopes()
    # Surface z(u, v) along rays (x, y, 1): the cross product of its two tangents.
    normal_x = -intrinsics.fx * slope_u
    normal_y = -intrinsics.fy * slope_v
    normal_z = depth - normal_x * x - normal_y * y
    # normal . ray = depth, by construction.
    cosine = depth / (np.sqrt(normal_x**2 + normal_y**2 + normal_z**2) * np.sqrt(x**2 + y**2 + 1))
    angle: Floats = np.nan_to_num(np.arccos(np.clip(cosine, -1, 1)), nan=0.0)
    return angle


def _slope(depth: Floats, *, axis: int) -> Floats:
    step = np.diff(depth, axis=axis)
    gap = np.full_like(np.take(depth, [0], axis=axis), np.nan)
    forward = np.concatenate([step, gap], axis=axis)
    backward = np.concatenate([gap, step], axis=axis)
    backward_wins = np.isnan(forward) | (np.abs(backward) < np.abs(forward))
    slope: Floats = np.where(backward_wins, backward, forward)
    return slope
