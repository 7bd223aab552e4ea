"""Handles of mugs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.objects.draws import choose, uniform
from sim_scenes.objects.loft import sweep
from sim_scenes.objects.profile import bezier, fillet

if TYPE_CHECKING:
    from sim_scenes.objects.part import Floats, Part, Rect

SECTIONS = 16


class Handle(StrEnum):
    """Side view of a handle."""

    ROUND = "round"
    SQUARE = "square"
    EAR = "ear"
    NONE = "none"


@dataclass(frozen=True)
class HandleParams:
    """Shape of a handle: lengths in metres, heights as shares of the mug's.

    `half_width_m` is along the mug's circumference, `half_depth_m` in the handle's plane, `taper`
    the lower end's size relative to the upper end's, `exponent` the section's superellipse's.
    `bend` is the roundness of a round or square handle and the sag of an ear.
    """

    kind: Handle
    reach_m: float
    low: float
    high: float
    half_width_m: float
    half_depth_m: float
    taper: float
    exponent: float
    bend: float

    @classmethod
    def draw(
        cls, rng: np.random.Generator, *, height_m: float, diameter_m: float, wall_m: float
    ) -> HandleParams:
        """Draw a handle that fits a mug of this size, or none."""
        kind = choose(
            rng, {Handle.ROUND: 3.0, Handle.SQUARE: 2.0, Handle.EAR: 2.5, Handle.NONE: 1.2}
        )
        depth = uniform(rng, 0.003, 0.0052)
        # Clear of the table below and of the rounded rim above.
        rim = (depth + 0.003 + 0.5 * wall_m) / height_m
        foot = (depth + 0.011) / height_m
        return cls(
            kind=kind,
            reach_m=min(uniform(rng, 0.022, 0.036), 0.42 * diameter_m),
            low=max(foot, uniform(rng, 0.12, 0.28)),
            high=min(1.0 - rim, uniform(rng, 0.76, 0.95)),
            half_width_m=depth * uniform(rng, 1.1, 2.3),
            half_depth_m=depth,
            taper=uniform(rng, 0.7, 1.0) if kind is Handle.EAR else uniform(rng, 0.92, 1.0),
            exponent=uniform(rng, 2.0, 4.0),
            bend=uniform(rng, 0.0, 1.0),
        )


def handle_part(params: HandleParams, *, side: Floats, rect: Rect) -> Part:
    """Sweep the handle in the xz plane; both ends run on into the mug's middle.

    `side` is the mug's side view (n, 2) of (r, z), metres.
    """
    path = _path(params, side)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    size = 1.0 + (params.taper - 1.0) * length / length[-1]
    return sweep(
        path,
        half_width=params.half_width_m * size,
        half_depth=params.half_depth_m * size,
        exponent=params.exponent,
        sections=SECTIONS,
        rect=rect,
    )


def _path(params: HandleParams, side: Floats) -> Floats:
    """Centre line (k, 2) of (x, z), metres, from the upper to the lower end."""
    height = float(side[-1, 1])
    low, high = params.low * height, params.high * height
    x_high, x_low = (float(np.interp(z, side[:, 1], side[:, 0])) for z in (high, low))
    between = (side[:, 1] >= low) & (side[:, 1] <= high)
    tip = float(side[between, 0].max()) + params.reach_m
    span = high - low

    if params.kind is Handle.SQUARE:
        lower_tip = tip - 0.25 * params.reach_m * (1.0 - params.bend)
        radius = params.half_depth_m + 0.003 + 0.008 * params.bend
        outside = fillet(
            [(x_high, high), (tip, high), (lower_tip, low), (x_low, low)],
            radius_m=radius,
            steps=7,
        )
    elif params.kind is Handle.EAR:
        # Rises from the rim, bulges at the top, and runs down to a low, slanting end.
        reach = tip - x_high
        sag = 0.55 + 0.3 * params.bend
        lift = min(0.1 * span, height - high - params.half_depth_m) if height > high else 0.0
        outside = bezier(
            [
                (x_high, high),
                (x_high + 0.9 * reach, high + max(lift, 0.0)),
                (x_high + 1.75 * reach, high - 0.05 * span),
                (x_high + 1.1 * reach, low + (1.0 - sag) * span),
                (x_low + 0.45 * reach, low),
                (x_low, low),
            ],
            count=22,
        )
    else:
        # Half a superellipse of exponent 2 / power on the line between the two ends.
        power = 0.7 + 0.3 * params.bend
        angle = np.pi * np.linspace(0.0, 1.0, 22)
        share = 0.5 * (1.0 + np.cos(angle))
        base = x_low + (x_high - x_low) * share
        bulge = tip - 0.5 * (x_low + x_high)
        outside = np.column_stack([base + bulge * np.sin(angle) ** power, low + span * share])

    inward = [0.5 * x_high, 0.5 * x_low]
    return np.concatenate([[[inward[0], high]], outside, [[inward[1], low]]])
