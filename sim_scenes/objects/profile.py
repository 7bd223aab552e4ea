"""Plane curves and cross-sections: rounding, insetting, and the half-profiles that lofts take.

A cross-section is the cut of a body by a vertical plane, symmetric about the z axis, as a
`manifold3d.CrossSection` in MILLIMETRES (its clipping engine works in decimal places).
Half-profiles come back in metres as (r, z).
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import manifold3d  # type: ignore[import-not-found]
import numpy as np

from sim_scenes.objects.part import ShapeError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_scenes.objects.part import Floats

MM = 1e-3
ARC_SEGMENTS = 40
CLEAN_MM = 2e-3
# Offsets of nearly touching edges leave specks below this area.
SPECK_MM2 = 0.05
# Points this near the lowest one belong to the base.
LEVEL_M = 2e-6
# Simplification keeps profiles this close to the drawn curve, and their edges this short.
PROFILE_TOLERANCE_M = 0.13e-3
PROFILE_EDGE_M = 16e-3


def section_from_curve(curve: Floats) -> manifold3d.CrossSection:
    """Fill a curve (n, 2) of (r, z) in metres, from bottom to top, and its mirror image."""
    mirrored = curve[::-1] * np.array([-1.0, 1.0])
    return manifold3d.CrossSection(
        [np.concatenate([curve, mirrored]) / MM], manifold3d.FillRule.NonZero
    )


def box_section(*, radius_m: float, z0_m: float, z1_m: float) -> manifold3d.CrossSection:
    """Cut of a cylinder of this radius between two heights."""
    return section_from_curve(np.array([[radius_m, z0_m], [radius_m, z1_m]]))


def disc_section(*, radius_m: float, at_m: tuple[float, float]) -> manifold3d.CrossSection:
    """Cut of a torus: a disc at (r, z) and its mirror image."""
    circle = manifold3d.CrossSection.circle(radius_m / MM, ARC_SEGMENTS)
    r, z = at_m[0] / MM, at_m[1] / MM
    return circle.translate((r, z)) + circle.translate((-r, z))


def inset(section: manifold3d.CrossSection, distance_m: float) -> manifold3d.CrossSection:
    """Shrink by a distance, measured square to the outline."""
    moved = section.offset(-distance_m / MM, manifold3d.JoinType.Round, 2.0, ARC_SEGMENTS)
    # Offsetting leaves vertices nanometres apart, which the next one would multiply.
    return moved.simplify(CLEAN_MM)


def round_convex(section: manifold3d.CrossSection, radius_m: float) -> manifold3d.CrossSection:
    """Round outward corners (morphological opening); what is thinner than 2 radii vanishes."""
    return inset(inset(section, radius_m), -radius_m)


def round_concave(section: manifold3d.CrossSection, radius_m: float) -> manifold3d.CrossSection:
    """Round inward corners (morphological closing); gaps narrower than 2 radii are filled."""
    return inset(inset(section, -radius_m), radius_m)


def half_profiles(section: manifold3d.CrossSection) -> list[Floats]:
    """Cut the section at the axis: curves (n, 2) of (r, z) in metres that start and end on it.

    Each runs with the body on its left, so the outer one goes from the bottom up.
    """
    _, z0, _, z1 = section.bounds()
    reach = 2.0 * (abs(z0) + abs(z1)) + max(abs(v) for v in section.bounds())
    right = manifold3d.CrossSection.square((reach, 2 * reach)).translate((0.0, -reach))
    curves = []
    for contour in (section ^ right).to_polygons():
        if abs(_area(np.asarray(contour, dtype=float))) < SPECK_MM2:
            continue
        points = np.asarray(contour, dtype=float) * MM
        points[np.abs(points[:, 0]) < 1e-6, 0] = 0.0
        curves += _split_at_axis(points)
    return [_resample(curve) for curve in curves]


def _area(contour: Floats) -> float:
    """Signed area of a closed contour (n, 2), by the shoelace formula."""
    x, y = contour.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _split_at_axis(contour: Floats) -> list[Floats]:
    """Drop the edges that lie on the axis."""
    on_axis = contour[:, 0] == 0.0
    ends = np.flatnonzero(on_axis & np.roll(on_axis, -1))
    if len(ends) == 0:
        raise ShapeError("a cross-section must reach the axis")
    turned = np.roll(contour, -int(ends[0]) - 1, axis=0)
    on_axis = turned[:, 0] == 0.0
    stops = np.flatnonzero(on_axis)
    return [turned[a : b + 1] for a, b in pairwise(stops) if b > a + 1]


def _resample(curve: Floats) -> Floats:
    """Drop points that add nothing, cut long edges; the ends and what the body stands on stay."""
    curve, anchors = _level_base(curve)
    pieces = [
        simplify(curve[a : b + 1], tolerance_m=PROFILE_TOLERANCE_M)[:-1]
        for a, b in pairwise(anchors)
    ]
    kept = np.concatenate([*pieces, curve[-1:]])
    # A ring next to the axis would collapse on the grid.
    kept = np.concatenate([kept[:1], kept[1:-1][kept[1:-1, 0] > 0.1e-3], kept[-1:]])
    return subdivide(kept, edge_m=PROFILE_EDGE_M)


def _level_base(curve: Floats) -> tuple[Floats, list[int]]:
    """Level the lowest points, and list the points that thinning must keep.

    Without the outer end of a flat base, a body would stand on the tip of a shallow cone.
    """
    low = curve[:, 1] - curve[:, 1].min() < LEVEL_M
    levelled = curve.copy()
    levelled[low, 1] = curve[:, 1].min()
    # The flat floor inside ends at the axis.
    floor = np.abs(curve[:, 1] - curve[-1, 1]) < LEVEL_M
    starts = [np.flatnonzero(run & ~np.roll(run, 1)) for run in (low, floor)]
    stops = [np.flatnonzero(run & ~np.roll(run, -1)) for run in (low, floor)]
    anchors = np.unique(np.concatenate([[0, len(curve) - 1], *starts, *stops]))
    return levelled, [int(anchor) for anchor in anchors]


def simplify(curve: Floats, *, tolerance_m: float) -> Floats:
    """Thin out an open curve (n, 2) so that no dropped point is farther than the tolerance.

    Ramer-Douglas-Peucker with an explicit stack.
    """
    keep = np.zeros(len(curve), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(curve) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        inner = curve[first + 1 : last]
        chord = curve[last] - curve[first]
        share = np.clip((inner - curve[first]) @ chord / max(float(chord @ chord), 1e-18), 0, 1)
        gaps = np.linalg.norm(inner - curve[first] - share[:, None] * chord, axis=1)
        worst = int(np.argmax(gaps))
        if gaps[worst] > tolerance_m:
            middle = first + 1 + worst
            keep[middle] = True
            spans += [(first, middle), (middle, last)]
    return curve[keep]


def subdivide(curve: Floats, *, edge_m: float) -> Floats:
    """Cut edges longer than `edge_m` into equal pieces, except those square to the axis (caps)."""
    pieces = [curve[:1]]
    for start, stop in pairwise(curve):
        length = float(np.linalg.norm(stop - start))
        cap = abs(stop[1] - start[1]) < 1e-9 and min(start[0], stop[0]) == 0.0
        count = 1 if cap else max(1, int(np.ceil(length / edge_m)))
        share = np.arange(1, count + 1)[:, None] / count
        pieces.append(start + share * (stop - start))
    return np.concatenate(pieces)


def bezier(control: Sequence[tuple[float, float]], *, count: int) -> Floats:
    """Sample a Bezier curve of these control points (k, 2) at `count` equal parameter steps."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    points = [np.tile(np.asarray(p, dtype=float), (count, 1)) for p in control]
    while len(points) > 1:  # de Casteljau
        points = [(1 - t) * a + t * b for a, b in pairwise(points)]
    return points[0]


def fillet(corners: Sequence[tuple[float, float]], *, radius_m: float, steps: int) -> Floats:
    """Polyline (k, 2) with its inner corners rounded by arcs of `steps` edges.

    A radius too large for the edges beside a corner is reduced there.
    """
    points = np.asarray(corners, dtype=float)
    pieces = [points[:1]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        back, ahead = before - corner, after - corner
        room = 0.49 * min(float(np.linalg.norm(back)), float(np.linalg.norm(ahead)))
        back, ahead = back / np.linalg.norm(back), ahead / np.linalg.norm(ahead)
        half = 0.5 * np.arccos(np.clip(back @ ahead, -1.0, 1.0))
        if np.pi / 2 - half < 1e-3:
            pieces.append(corner[None])
            continue
        setback = min(radius_m / np.tan(half), room)
        radius = setback * np.tan(half)
        bisector = (back + ahead) / np.linalg.norm(back + ahead)
        centre = corner + bisector * radius / np.sin(half)
        start = corner + back * setback - centre
        turn = np.sign(
            start[0] * (ahead * setback + corner - centre)[1]
            - start[1] * (ahead * setback + corner - centre)[0]
        )
        angle = turn * np.linspace(0.0, np.pi - 2 * half, steps + 1)
        c, s = np.cos(angle), np.sin(angle)
        pieces.append(
            centre + np.stack([c * start[0] - s * start[1], s * start[0] + c * start[1]], axis=1)
        )
    pieces.append(points[-1:])
    return np.concatenate(pieces)
