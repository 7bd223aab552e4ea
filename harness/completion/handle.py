"""The mug's handle: where it is on a mesh, and what a completion made of one that no view saw.

1. The body is a surface of revolution about a vertical axis: a circle through the outermost points
   in every direction, but for those that stick out.
2. The handle lies in the sector in which points stick out. Outside of it the 95 % quantile of the
   points' distances from the axis is the body's radius, by height.
3. Points in the sector beyond `BEYOND` body radii are the handle's.

A completion made a handle if enough of its points lie clear of the body, and put it right if they
lie on the side of the true one.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]
    Flags = npt.NDArray[np.bool_]

BEYOND = 1.08
DIRECTIONS = 72
FIT_STEPS = 20
# In a direction where the outermost point is this much farther than in most, something sticks out.
STICKS_OUT = 1.15
STICKS_OUT_M = 0.008
SECTOR_RAD = np.deg2rad(60.0)
SLICES = 24
BODY_QUANTILE = 0.95

UNSEEN_SHARE = 0.10
"""A handle is unseen when less than this share of its surface was seen."""
CLEAR_M = 0.005
MADE_SHARE = 0.01
PLACED_RAD = np.deg2rad(30.0)


class Outcome(StrEnum):
    """What a completion made of a handle."""

    RIGHT = "right"
    WRONG = "wrong place"
    LEFT_OUT = "left out"


@dataclass(frozen=True, eq=False)
class Mug:
    """A mug's body and the side of its handle, in the mug's own frame, metres.

    Attributes
    ----------
    axis : (2,) float64
        Where the body's axis stands.
    heights, radii : (k,) float64
        The body's radius by height.
    direction_rad
        Where the handle points to, about the axis.
    """

    axis: Floats
    heights: Floats
    radii: Floats
    direction_rad: float

    def is_handle(self, points: Floats) -> Flags:
        """Whether points (n, 3) of the true surface are the handle's."""
        radius, angle = _polar(points, self.axis)
        inside = np.abs(_wrapped(angle - self.direction_rad)) <= SECTOR_RAD
        return np.asarray(inside & (radius > BEYOND * self._body_radius(points)))

    def outcome(self, points: Floats) -> tuple[Outcome, Flags]:
        """Say what a completed cloud (n, 3) made of the handle, and which points (n,) it made."""
        radius, angle = _polar(points, self.axis)
        clear = radius > BEYOND * self._body_radius(points) + CLEAR_M
        if clear.mean() < MADE_SHARE:
            return Outcome.LEFT_OUT, np.asarray(clear)
        turn = float(np.angle(np.exp(1j * angle[clear]).mean()))
        placed = abs(float(_wrapped(np.array(turn - self.direction_rad)))) <= PLACED_RAD
        return (Outcome.RIGHT if placed else Outcome.WRONG), np.asarray(clear)

    def _body_radius(self, points: Floats) -> Floats:
        return np.interp(points[:, 2], self.heights, self.radii)


def find_handle(points: Floats) -> Mug | None:
    """Find body and handle in points (n, 3) spread evenly over a mug; None without a handle."""
    axis, radius_m = _fit_axis(points)
    distance, angle = _polar(points, axis)
    out = (distance > STICKS_OUT * radius_m) & (distance > radius_m + STICKS_OUT_M)
    if not out.any():
        return None
    direction = float(np.angle(np.exp(1j * angle[out]).mean()))
    body = np.abs(_wrapped(angle - direction)) > SECTOR_RAD
    edges = np.linspace(points[:, 2].min(), points[:, 2].max(), SLICES + 1)
    heights, radii = [], []
    for low, high in itertools.pairwise(edges):
        ring = body & (points[:, 2] >= low) & (points[:, 2] <= high)
        if ring.any():
            heights.append((low + high) / 2)
            radii.append(float(np.quantile(distance[ring], BODY_QUANTILE)))
    return Mug(axis, np.array(heights), np.array(radii), direction)


def _fit_axis(points: Floats) -> tuple[Floats, float]:
    """Axis (2,) and largest radius of the body, whatever sticks out of it."""
    axis = np.median(points[:, :2], axis=0)
    radius_m = 0.0
    for _ in range(FIT_STEPS):
        distance, angle = _polar(points, axis)
        sector = ((angle + np.pi) / (2 * np.pi) * DIRECTIONS).astype(int) % DIRECTIONS
        order = np.argsort(distance, kind="stable")
        outermost = np.full(DIRECTIONS, -1)
        # The last write to a sector is that of its farthest point.
        outermost[sector[order]] = order
        outermost = outermost[outermost >= 0]
        radius_m = float(np.median(distance[outermost]))
        ring = points[outermost[distance[outermost] <= STICKS_OUT * radius_m], :2]
        # Kasa's circle: x^2 + y^2 = 2 a x + 2 b y + c is linear in centre (a, b) and c.
        system = np.column_stack([2 * ring, np.ones(len(ring))])
        solution, *_ = np.linalg.lstsq(system, (ring**2).sum(axis=1), rcond=None)
        axis = solution[:2]
    return np.asarray(axis), radius_m


def _polar(points: Floats, axis: Floats) -> tuple[Floats, Floats]:
    """Distance (n,) from an axis and angle (n,) about it."""
    offsets = points[:, :2] - axis
    return np.hypot(offsets[:, 0], offsets[:, 1]), np.arctan2(offsets[:, 1], offsets[:, 0])


def _wrapped(angle_rad: Floats) -> Floats:
    """Angles brought to [-pi, pi)."""
    return np.asarray((angle_rad + np.pi) % (2 * np.pi) - np.pi)
