"""Rounded slabs and turned bodies: the blocks of cameras, laptops and caps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.objects.loft import loft
from sim_scenes.objects.outline import circle, rounded_rectangle
from sim_scenes.objects.part import Part, Rect, union
from sim_scenes.objects.profile import half_profiles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from manifold3d import CrossSection, Manifold  # type: ignore[import-not-found]

    from sim_scenes.objects.loft import Ring
    from sim_scenes.objects.part import Floats

EDGE_STEPS = 4

# Rotations that lay the z axis of a part along another axis.
Z_TO_FRONT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # z -> -y
Z_TO_RIGHT = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # z -> x


def edge_profile(*, reach_m: float, height_m: float, edge_m: float) -> Floats:
    """Profile of a block whose upper and lower edges are rounded, from the axis to the axis."""
    angle = 0.5 * np.pi * np.linspace(0.0, 1.0, EDGE_STEPS + 1)
    inner = reach_m - edge_m
    lower = np.column_stack([inner + edge_m * np.sin(angle), edge_m * (1 - np.cos(angle))])
    upper = np.column_stack([lower[::-1, 0], height_m - lower[::-1, 1]])
    return np.concatenate([[[0.0, 0.0]], lower, upper, [[0.0, height_m]]])


def slab(
    *, half_x_m: float, half_y_m: float, height_m: float, corner_m: float, edge_m: float, rect: Rect
) -> Part:
    """Block on z = 0 with vertical corners of radius `corner_m` and edges of radius `edge_m`."""
    ring, reach = rounded_rectangle(half_x_m=half_x_m, half_y_m=half_y_m, corner_m=corner_m)
    return loft(edge_profile(reach_m=reach, height_m=height_m, edge_m=edge_m), ring, rect=rect)


def disc(*, radius_m: float, height_m: float, edge_m: float, rect: Rect) -> Part:
    """Cylinder on z = 0 with rounded edges."""
    profile = edge_profile(reach_m=radius_m, height_m=height_m, edge_m=edge_m)
    return loft(profile, circle(radius_m), rect=rect)


def turned(profile: Sequence[tuple[float, float]], *, rect: Rect) -> Part:
    """Body of revolution of a polygonal profile (r, z), metres, from the axis to the axis."""
    points = np.asarray(profile, dtype=float)
    return loft(points, circle(float(points[:, 0].max())), rect=rect)


def revolved(section: CrossSection, ring: Ring, *, rect: Rect) -> Manifold:
    """Solid whose half-profiles are those of a cross-section, its voids included."""
    curves = half_profiles(section)
    body = union(loft(c, ring, rect=rect) for c in curves if c[0, 1] < c[-1, 1])
    for void in (c for c in curves if c[0, 1] > c[-1, 1]):
        body -= loft(void[::-1], ring, rect=rect).solid()
    return body
