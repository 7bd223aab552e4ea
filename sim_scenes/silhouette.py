"""The outline that a mesh would have if nothing stood before it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from sim_scenes.camera import Intrinsics
    from sim_scenes.geometry import Floats, Ints

# Triangles are filled in groups of at most this many box pixels, to bound memory.
GROUP_PX = 2_000_000


def silhouette(
    vertices_camera: Floats, faces: Ints, *, intrinsics: Intrinsics
) -> npt.NDArray[np.bool_]:
    """Pixels (h, w) whose centre lies in the projection of a triangle.

    Parameters
    ----------
    vertices_camera : (n, 3) float64
        Metres, camera axes. Triangles with a vertex at or behind the camera are left out.
    faces : (m, 3) int64
    intrinsics
        The camera.
    """
    covered = np.zeros((intrinsics.height, intrinsics.width), dtype=bool)
    seen = faces[(vertices_camera[faces, 2] > 0).all(axis=1)]
    if not len(seen):
        return covered
    used, index = np.unique(seen, return_inverse=True)
    corners = intrinsics.project(vertices_camera[used])[index.reshape(-1, 3)]

    low = np.maximum(np.ceil(corners.min(axis=1)), 0).astype(np.int64)
    limit = np.array([intrinsics.width - 1, intrinsics.height - 1])
    high = np.minimum(np.floor(corners.max(axis=1)), limit).astype(np.int64)
    size = np.maximum(high - low + 1, 0)
    count = size.prod(axis=1)
    corners, low, size, count = (a[count > 0] for a in (corners, low, size, count))

    group = np.cumsum(count) // GROUP_PX
    for number in np.unique(group):
        mine = group == number
        _fill(covered, corners[mine], low[mine], size[mine])
    return covered


def _fill(covered: npt.NDArray[np.bool_], corners: Floats, low: Ints, size: Ints) -> None:
    """Mark the pixels of each triangle's box (low, size) whose centre the triangle holds."""
    count = size.prod(axis=1)
    triangle = np.repeat(np.arange(len(count)), count)
    place = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)
    row, column = np.divmod(place, size[triangle, 0])
    u, v = low[triangle, 0] + column, low[triangle, 1] + row

    inside_left = np.ones(len(u), dtype=bool)
    inside_right = np.ones(len(u), dtype=bool)
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        edge = b - a
        side = edge[triangle, 0] * (v - a[triangle, 1]) - edge[triangle, 1] * (u - a[triangle, 0])
        inside_left &= side >= 0
        inside_right &= side <= 0
    held = inside_left | inside_right
    covered[v[held], u[held]] = True
