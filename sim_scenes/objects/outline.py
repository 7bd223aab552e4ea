"""Outlines seen from above: circle, superellipse, lobed, rounded rectangle.

Each is a function from a profile point (r, z) to the horizontal ring there. A ring scales with r at
a fixed z, or shrinks in parallel: in both cases rings of different r never cross, so that lofted
walls cannot intersect themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_scenes.objects.loft import Ring
    from sim_scenes.objects.part import Floats

# Largest distance between a round outline and its polygon.
CHORD_M = 0.12e-3


def sections_for(radius_m: float) -> int:
    """Count a polygon's corners so that its sagitta r (1 - cos(pi / n)) stays in `CHORD_M`."""
    count = np.pi / np.arccos(1.0 - CHORD_M / max(radius_m, 2 * CHORD_M))
    return max(16, 4 * int(np.ceil(count / 4)))


def full(_z: float) -> float:
    """Keep the outline's character at every height."""
    return 1.0


def circle(radius_m: float) -> Ring:
    """Outline of a body of revolution whose largest radius is given."""
    return polar(np.ones(sections_for(radius_m)))


def superellipse(
    radius_m: float,
    *,
    exponent: float,
    strength: Callable[[float], float] = full,
    aspect: float = 1.0,
) -> Ring:
    """Make a rounded square |x|^p + |y|^p = r^p; y shrinks to `aspect`.

    `strength` in [0, 1] says how far the outline is from the circle at each height.
    """
    count = sections_for(2.2 * radius_m)
    angle = _angles(count)
    shape = (np.abs(np.cos(angle)) ** exponent + np.abs(np.sin(angle)) ** exponent) ** (
        -1.0 / exponent
    )
    return polar(shape, strength=strength, aspect=aspect)


def lobed(
    radius_m: float, *, lobes: int, depth: float, strength: Callable[[float], float] = full
) -> Ring:
    """Scalloped outline r (1 - depth (1 - cos(n angle)) / 2): its lobes touch the circle."""
    per_lobe = max(8, 2 * int(np.ceil(sections_for(2 * radius_m) / (2 * lobes))))
    angle = _angles(lobes * per_lobe)
    return polar(1.0 - 0.5 * depth * (1.0 - np.cos(lobes * angle)), strength=strength)


def polar(shape: Floats, *, strength: Callable[[float], float] = full, aspect: float = 1.0) -> Ring:
    """Outline r shape(angle)^strength(z), with `shape` (n,) sampled at equal angles."""
    angle = _angles(len(shape))
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def ring(r: float, z: float) -> Floats:
        s = strength(z)
        scale = np.array([1.0, 1.0 + s * (aspect - 1.0)])
        points: Floats = r * (shape**s)[:, None] * unit * scale
        return points

    return ring


def rounded_rectangle(*, half_x_m: float, half_y_m: float, corner_m: float) -> tuple[Ring, float]:
    """Rectangle with rounded corners, and the r of its full size.

    Smaller r gives the outline shrunk in parallel by the difference, which has to stay below the
    corner's radius.
    """
    reach = min(half_x_m, half_y_m)
    per_corner = max(4, sections_for(corner_m) // 4)
    angle = 0.5 * np.pi * np.linspace(0.0, 1.0, per_corner + 1)
    turn = np.concatenate([angle + 0.5 * np.pi * quarter for quarter in range(4)])
    signs = np.repeat([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]], per_corner + 1, axis=0)
    centre = signs * np.array([half_x_m - corner_m, half_y_m - corner_m])
    unit = np.stack([np.cos(turn), np.sin(turn)], axis=1)

    def ring(r: float, _z: float) -> Floats:
        points: Floats = centre + (corner_m - (reach - r)) * unit
        return points

    return ring, reach


def _angles(count: int) -> Floats:
    return 2 * np.pi * np.arange(count) / count
