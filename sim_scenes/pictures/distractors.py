"""Shapes that belong to no category, 2 to 18 cm large."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from sim_scenes.geometry import Floats, Ints, rigid, rotation_from_quaternion, turn

if TYPE_CHECKING:
    from collections.abc import Callable

LARGEST_M = 0.18
# Edges that turn by less than this are shaded round.
ROUND_RAD = math.radians(35)
# Share of shapes that stand on an edge or a corner, as if they leant on something.
TILTED = 0.25


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh that stands on z = 0, its box's middle above the origin; metres.

    Attributes
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    normals : (n, 3) float64
    uv : (n, 2) float64
        In [0, 1].
    closed
        Whether the surface is closed and faces outwards; others are drawn from both sides.
    """

    vertices: Floats
    faces: Ints
    normals: Floats
    uv: Floats
    closed: bool

    @property
    def radius_m(self) -> float:
        """Of the circle about the origin that holds it, seen from above."""
        return float(np.hypot(self.vertices[:, 0], self.vertices[:, 1]).max())

    @property
    def height_m(self) -> float:
        """Of its top above z = 0."""
        return float(self.vertices[:, 2].max())


def standing(vertices: Floats) -> Floats:
    """Move points (n, 3) so that they stand on z = 0, their box's middle above the origin."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    foot: Floats = np.array([*(low + high)[:2] / 2, low[2]])
    return vertices - foot


def distractor(random: np.random.Generator) -> Shape:
    """Draw a shape of any kind."""
    make = KINDS[int(random.integers(len(KINDS)))]
    mesh = make(random)
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    if random.uniform() < TILTED:
        vertices = vertices @ rotation_from_quaternion(random.standard_normal(4)).T
    return unwrap(standing(vertices), np.asarray(mesh.faces, dtype=np.int64))


def unwrap(vertices: Floats, faces: Ints) -> Shape:
    """Give a closed mesh texture coordinates, seen along each face's main axis, and normals."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    flat = np.repeat(mesh.face_normals, 3, axis=0)
    smooth = np.asarray(mesh.vertex_normals)[faces.reshape(-1)]
    is_round = (flat * smooth).sum(axis=1) > math.cos(ROUND_RAD)
    corners = vertices[faces.reshape(-1)]
    low = corners.min(axis=0)
    placed = (corners - low) / np.ptp(corners, axis=0).max()
    main = np.abs(flat).argmax(axis=1)
    columns = np.array([[1, 2], [0, 2], [0, 1]])[main]
    return Shape(
        vertices=corners,
        faces=np.arange(len(corners), dtype=np.int64).reshape(-1, 3),
        normals=np.where(is_round[:, None], smooth, flat),
        uv=np.take_along_axis(placed, columns, axis=1),
        closed=True,
    )


def _size(random: np.random.Generator, low_m: float = 0.02, high_m: float = LARGEST_M) -> float:
    return float(random.uniform(low_m, high_m))


def _turned(axis: int, angle_rad: float) -> Floats:
    return rigid(rotation=turn(axis, angle_rad), translation=np.zeros(3))


def _lying(mesh: Any) -> Any:
    mesh.apply_transform(_turned(0, math.pi / 2))
    return mesh


def _box(random: np.random.Generator) -> Any:
    return trimesh.creation.box(extents=random.uniform(0.02, 0.15, size=3))


def _plate(random: np.random.Generator) -> Any:
    """Book, telephone, board; lying or upright."""
    extents = [_size(random, 0.08), _size(random, 0.06, 0.14), _size(random, 0.006, 0.035)]
    return trimesh.creation.box(extents=random.permutation(extents) if _half(random) else extents)


def _ball(random: np.random.Generator) -> Any:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=_size(random, 0.015, 0.06))
    if _half(random):  # an egg
        mesh.apply_scale(random.uniform(0.5, 1.3, size=3))
    return mesh


def _cone(random: np.random.Generator) -> Any:
    return trimesh.creation.cone(
        radius=_size(random, 0.015, 0.06), height=_size(random, 0.03), sections=32
    )


def _ring(random: np.random.Generator) -> Any:
    minor = _size(random, 0.005, 0.018)
    return trimesh.creation.torus(
        major_radius=minor + _size(random, 0.01, 0.05),
        minor_radius=minor,
        major_sections=32,
        minor_sections=14,
    )


def _prism(random: np.random.Generator) -> Any:
    mesh = trimesh.creation.cylinder(
        radius=_size(random, 0.015, 0.06),
        height=_size(random),
        sections=int(random.integers(3, 9)),
    )
    return _lying(mesh) if _half(random) else mesh


def _wedge(random: np.random.Generator) -> Any:
    x, y, z = random.uniform(0.03, 0.15, size=3)
    ridge = random.uniform(0, x)
    points = [[0, 0, 0], [x, 0, 0], [0, y, 0], [x, y, 0], [ridge, 0, z], [ridge, y, z]]
    return trimesh.Trimesh(points).convex_hull


def _stone(random: np.random.Generator) -> Any:
    """Hull of random points in a ball that is stretched."""
    points = random.standard_normal((int(random.integers(6, 40)), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return trimesh.convex.convex_hull(points * random.uniform(0.015, 0.08, size=3))


def _rod(random: np.random.Generator) -> Any:
    """Pen, spoon handle, cable."""
    return _lying(
        trimesh.creation.capsule(
            radius=_size(random, 0.003, 0.012), height=_size(random, 0.07, 0.16), count=[12, 16]
        )
    )


def _stack(random: np.random.Generator) -> Any:
    """Blocks on top of each other."""
    parts, top = [], 0.0
    for _ in range(int(random.integers(2, 5))):
        extents = random.uniform([0.02, 0.02, 0.01], [0.09, 0.09, 0.045])
        part = trimesh.creation.box(extents=extents)
        part.apply_transform(_turned(2, random.uniform(0, math.pi)))
        part.apply_translation([*random.uniform(-0.01, 0.01, size=2), top + extents[2] / 2])
        top += extents[2]
        parts.append(part)
    return trimesh.util.concatenate(parts)


def _bracket(random: np.random.Generator) -> Any:
    """Two or three bars that meet in a corner."""
    width = _size(random, 0.01, 0.04)
    parts = []
    for axis in range(int(random.integers(2, 4))):
        extents = np.full(3, width)
        extents[axis] = _size(random, 0.05, 0.15)
        part = trimesh.creation.box(extents=extents)
        shift = np.zeros(3)
        shift[axis] = (extents[axis] - width) / 2
        part.apply_translation(shift)
        parts.append(part)
    return trimesh.util.concatenate(parts)


def _half(random: np.random.Generator) -> bool:
    return bool(random.uniform() < 0.5)


KINDS: tuple[Callable[[np.random.Generator], Any], ...] = (
    _box,
    _plate,
    _ball,
    _cone,
    _ring,
    _prism,
    _wedge,
    _stone,
    _rod,
    _stack,
    _bracket,
)
