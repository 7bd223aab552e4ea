"""Closures of bottles: caps, corks, pumps and nozzles."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.objects import profile as section
from sim_scenes.objects.draws import uniform
from sim_scenes.objects.loft import sweep
from sim_scenes.objects.outline import circle
from sim_scenes.objects.primitives import revolved

if TYPE_CHECKING:
    from collections.abc import Sequence

    import manifold3d  # type: ignore[import-not-found]

    from sim_scenes.objects.part import Part, Rect

# Solid sunk into the neck, so that the two always overlap.
SUNK_M = 0.001


class Closure(StrEnum):
    """How a bottle is closed."""

    SCREW = "screw"
    LONG_SCREW = "long screw"
    SPORT = "sport"
    CORK = "cork"
    CROWN = "crown"
    FLIP = "flip"
    PUMP = "pump"
    NOZZLE = "nozzle"


@dataclass(frozen=True)
class ClosureParams:
    """Shape of a closure, metres: `tip_m` is the radius of its top, spout or foil's end.

    `flange_m` is how far a ring below the closure stands out from the neck, 0 for none; `reach_m`
    the length of a pump's spout from the axis.
    """

    kind: Closure
    radius_m: float
    height_m: float
    tip_m: float
    reach_m: float
    flange_m: float

    @classmethod
    def draw(
        cls,
        rng: np.random.Generator,
        *,
        kind: Closure,
        neck_radius_m: float,
        shoulder_radius_m: float,
    ) -> ClosureParams:
        """Draw a closure that fits the neck and stays within the shoulder's lesser radius."""
        grip, tall, slim, ahead = (rng.random() for _ in range(4))

        def between(low: float, high: float, share: float) -> float:
            return low + (high - low) * share

        room = max(shoulder_radius_m - 0.001, neck_radius_m + 0.002)
        radius = {
            Closure.LONG_SCREW: neck_radius_m + between(0.0005, 0.001, grip),
            Closure.CORK: neck_radius_m + between(0.0005, 0.001, grip),
            Closure.CROWN: neck_radius_m + between(0.0022, 0.0032, grip),
            Closure.FLIP: between(max(neck_radius_m + 0.003, 0.55 * shoulder_radius_m), room, grip),
            Closure.NOZZLE: between(neck_radius_m + 0.002, min(neck_radius_m + 0.010, room), grip),
        }.get(kind, neck_radius_m + between(0.0015, 0.0028, grip))
        height = between(
            *{
                Closure.SCREW: (0.011, 0.021),
                Closure.LONG_SCREW: (0.045, 0.060),
                Closure.SPORT: (0.026, 0.038),
                Closure.CORK: (0.045, 0.075),
                Closure.CROWN: (0.0058, 0.0066),
                Closure.FLIP: (0.016, 0.034),
                Closure.PUMP: (0.046, 0.062),
                Closure.NOZZLE: (0.032, 0.058),
            }[kind],
            tall,
        )
        tip = {
            Closure.SPORT: between(0.0065, 0.0090, slim),
            Closure.CORK: radius + between(0.0008, 0.0020, slim),
            Closure.CROWN: radius - 0.0028,
            Closure.FLIP: radius * between(0.78, 1.0, slim),
            Closure.PUMP: between(0.010, 0.0145, slim),
            Closure.NOZZLE: between(0.0022, 0.0036, slim),
        }.get(kind, radius * between(0.94, 1.0, slim))
        flanged = (
            kind in {Closure.SCREW, Closure.SPORT} and shoulder_radius_m > neck_radius_m + 0.006
        )
        return cls(
            kind=kind,
            radius_m=radius,
            height_m=height,
            tip_m=tip,
            reach_m=between(0.026, 0.040, ahead) if kind is Closure.PUMP else 0.0,
            flange_m=uniform(rng, 0.002, 0.0034) if flanged else 0.0,
        )


def closure_solid(params: ClosureParams, *, z_m: float, rect: Rect) -> manifold3d.Manifold:
    """Build the closure with its lower edge at height `z_m`."""
    cut = section.round_convex(_cut(params, z_m), 0.0006)
    solid = revolved(cut, circle(max(params.radius_m, params.tip_m)), rect=rect)
    if params.kind is Closure.PUMP:
        solid += _spout(params, z_m=z_m, rect=rect).solid()
    return solid


def _spout(params: ClosureParams, *, z_m: float, rect: Rect) -> Part:
    """Sweep a pump's spout from its head along +x, the mouth bent down."""
    depth = 0.0034
    z = z_m + params.height_m - depth - 0.0008
    path = section.fillet(
        [(0.0, z), (params.reach_m, z), (params.reach_m + 0.002, z - 0.009)],
        radius_m=0.006,
        steps=6,
    )
    size = np.linspace(1.0, 0.8, len(path))
    return sweep(
        path,
        half_width=0.0046 * size,
        half_depth=depth * size,
        exponent=2.6,
        sections=16,
        rect=rect,
    )


def _cut(params: ClosureParams, z_m: float) -> manifold3d.CrossSection:
    """Cut of the part that is round."""
    r, h, tip = params.radius_m, params.height_m, params.tip_m
    if params.kind is Closure.SPORT:
        return _filled(
            z_m,
            [
                (r, 0.0),
                (r, 0.40 * h),
                (tip, 0.58 * h),
                (0.72 * tip, 0.62 * h),
                (0.72 * tip, 0.80 * h),
                (tip, 0.85 * h),
                (0.8 * tip, h),
            ],
        )
    if params.kind is Closure.CORK:
        # Foil over the neck, with the lip's ring near the top.
        return _filled(
            z_m,
            [
                (r, -SUNK_M),
                (r, h - 0.014),
                (tip, h - 0.012),
                (tip, h - 0.004),
                (r, h - 0.003),
                (r, h),
            ],
        )
    if params.kind is Closure.CROWN:
        return _filled(z_m, [(r, 0.0), (r, 0.001), (tip + 0.001, h - 0.0012), (tip, h)])
    if params.kind is Closure.FLIP:
        seam = section.disc_section(radius_m=0.0008, at_m=(r + 0.0002, z_m + 0.62 * h))
        return _filled(z_m, [(r, 0.0), (r, 0.62 * h), (tip, h)]) - seam
    if params.kind is Closure.PUMP:
        stem, head = 0.0042, h - 0.010
        return _filled(
            z_m,
            [
                (r, 0.0),
                (r, 0.36 * h),
                (0.5 * r, 0.42 * h),
                (stem, 0.44 * h),
                (stem, head),
                (tip, head + 0.001),
                (tip, h - 0.001),
                (0.8 * tip, h),
            ],
        )
    if params.kind is Closure.NOZZLE:
        return _filled(
            z_m,
            [(r, 0.0), (r, 0.3 * h), (0.42 * r + 0.002, 0.42 * h), (1.5 * tip, 0.85 * h), (tip, h)],
        )
    # Screw caps: the tamper-evident band is set off by a groove.
    groove = section.disc_section(radius_m=0.0007, at_m=(r + 0.0002, z_m + 0.003))
    return _filled(z_m, [(r, 0.0), (r, 0.7 * h), (tip, h)]) - groove


def _filled(z_m: float, corners: Sequence[tuple[float, float]]) -> manifold3d.CrossSection:
    """Fill a side view given from the closure's lower edge."""
    return section.section_from_curve(np.asarray(corners) + np.array([0.0, z_m]))
