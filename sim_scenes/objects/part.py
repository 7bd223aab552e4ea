"""A closed surface with texture coordinates, and its boolean operations.

Shapes are composed from parts. Positions lie on a grid of 2**-20 m (0.95 um): every one is exact
in float32, and last-bit differences between mathematical libraries vanish before booleans see them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import manifold3d  # type: ignore[import-not-found]
import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from collections.abc import Iterable

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]

GRID_PER_M = 2.0**20


class ShapeError(RuntimeError):
    """A generated shape is not a closed solid: a defect of the generator, never of its caller."""


def snap(points: Floats) -> Floats:
    """Round coordinates (metres) to the grid."""
    return np.round(points * GRID_PER_M) / GRID_PER_M


@dataclass(frozen=True)
class Rect:
    """A rectangle of the texture's unit square."""

    u0: float
    v0: float
    u1: float
    v1: float

    def place(self, uv: Floats) -> Floats:
        """Map coordinates (..., 2) of the unit square into the rectangle."""
        size = np.array([self.u1 - self.u0, self.v1 - self.v0])
        placed: Floats = np.array([self.u0, self.v0]) + uv * size
        return placed

    def within(self, outer: Rect) -> Rect:
        """Read this rectangle as relative to `outer`."""
        (u0, v0), (u1, v1) = outer.place(np.array([[self.u0, self.v0], [self.u1, self.v1]]))
        return Rect(float(u0), float(v0), float(u1), float(v1))


def strips(*heights: float) -> list[Rect]:
    """Share the texture's unit square among parts, as horizontal strips of relative heights."""
    margin = 0.004
    edges = np.concatenate([[0.0], np.cumsum(heights)]) / sum(heights)
    return [Rect(0.0, float(lo) + margin, 1.0, float(hi) - margin) for lo, hi in pairwise(edges)]


@dataclass(frozen=True)
class Part:
    """A closed surface: vertices (n, 3) metres, uv (n, 2), faces (m, 3), outward winding.

    Vertices that differ only in their uv stand for one point of the surface.
    """

    vertices: Floats
    uv: Floats
    faces: Ints

    def moved(self, *, rotation: Floats | None = None, offset: Iterable[float] = (0, 0, 0)) -> Part:
        """Rotate by a matrix (3, 3), then translate (metres)."""
        points = self.vertices
        if rotation is not None:
            # Column by column: a matrix product may round equal rows differently.
            x, y, z = points.T
            points = np.stack([row[0] * x + row[1] * y + row[2] * z for row in rotation], axis=1)
        return Part(snap(points + np.array(list(offset), dtype=float)), self.uv, self.faces)

    def solid(self) -> manifold3d.Manifold:
        """Hand the surface to the boolean engine."""
        _, first, inverse = np.unique(self.vertices, axis=0, return_index=True, return_inverse=True)
        target = first[inverse.reshape(-1)]
        moved = np.flatnonzero(target != np.arange(len(target)))
        solid = manifold3d.Manifold(
            manifold3d.Mesh64(
                vert_properties=np.ascontiguousarray(np.hstack([self.vertices, self.uv])),
                tri_verts=self.faces.astype(np.uint64),
                merge_from_vert=moved.astype(np.uint64),
                merge_to_vert=target[moved].astype(np.uint64),
            )
        )
        if solid.status() != manifold3d.Error.NoError or solid.volume() <= 0:
            raise ShapeError(f"part is not a closed solid: {solid.status()}, {solid.volume()} m3")
        return solid


def union(parts: Iterable[Part]) -> manifold3d.Manifold:
    """Merge parts into one solid; inner walls vanish."""
    return reduce(lambda a, b: a + b, (part.solid() for part in parts))
