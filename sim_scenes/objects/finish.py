"""From a solid to the mesh that is written: float32-exact, closed, shaded, in a canonical order."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import trimesh

from sim_scenes.objects.part import ShapeError

if TYPE_CHECKING:
    import manifold3d  # type: ignore[import-not-found]

    from sim_scenes.objects.part import Floats, Ints

# Neighbouring faces that meet at less than this are shaded as one smooth surface.
CREASE_COS = float(np.cos(np.radians(38.0)))
# Normals and texture coordinates are rounded, so that nearly equal corners share a vertex.
NORMAL_STEPS = 2.0**10
UV_STEPS = 2.0**16


def finish(solid: manifold3d.Manifold) -> trimesh.Trimesh:
    """Turn a solid into a mesh with texture coordinates and normals.

    A vertex is stored once per distinct texture coordinate and normal, so the mesh is closed in its
    positions: see `position_merged`. The solid is not simplified: that would stretch the texture
    over what it merges.
    """
    mesh = _grounded(solid).to_mesh64()
    corners = np.asarray(mesh.tri_verts).astype(np.int64)
    properties = np.asarray(mesh.vert_properties)
    exact = properties[:, :3].astype(np.float32).astype(np.float64) + 0.0
    points, point_of = np.unique(exact, axis=0, return_inverse=True)
    faces = point_of.reshape(-1)[corners]
    # Corners that the rounding has made one leave faces without an area.
    proper = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    faces, corners = faces[proper], corners[proper]
    uv = np.round(properties[:, 3:5] * UV_STEPS) / UV_STEPS

    normals = corner_normals(points, faces)
    table = np.column_stack([faces.reshape(-1), uv[corners.reshape(-1)], normals.reshape(-1, 3)])
    rows, row_of = np.unique(table + 0.0, axis=0, return_inverse=True)
    result = trimesh.Trimesh(
        vertices=points[rows[:, 0].astype(np.int64)],
        faces=_canonical(row_of.reshape(-1, 3)),
        vertex_normals=rows[:, 3:6],
        visual=trimesh.visual.TextureVisuals(uv=rows[:, 1:3]),  # type: ignore[no-untyped-call]
        process=False,
    )
    check_solid(result)
    return result


def _grounded(solid: manifold3d.Manifold) -> manifold3d.Manifold:
    """Lower the solid onto z = 0, which a base rounded all over may miss by a sagitta."""
    low = solid.bounding_box()[2]
    if abs(low) > 0.2e-3:
        raise ShapeError(f"the base stands at z = {low} m, not 0")
    return solid.translate((0.0, 0.0, -low))


def position_merged(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Geometry alone: vertices that share a position become one."""
    points, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return trimesh.Trimesh(points, index.reshape(-1)[mesh.faces], process=False)


def check_solid(mesh: trimesh.Trimesh) -> None:
    """Raise `ShapeError` unless the mesh is one closed, outward solid that rests on z = 0."""
    merged = position_merged(mesh)
    if not (merged.is_watertight and merged.is_winding_consistent and merged.volume > 0):
        raise ShapeError(
            f"not a solid: watertight {merged.is_watertight}, "
            f"consistent {merged.is_winding_consistent}, volume {merged.volume} m3"
        )
    if merged.bounds[0, 2] != 0.0:
        raise ShapeError(f"the base stands at z = {merged.bounds[0, 2]} m, not 0")


def corner_normals(points: Floats, faces: Ints) -> Floats:
    """Compute normals (m, 3, 3) of the faces' corners: area-weighted over smooth neighbours."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    unit = _unit(area)
    flat = np.linalg.norm(unit, axis=1) == 0.0

    # All pairs of corners that share a point.
    owner = faces.reshape(-1)
    order = np.argsort(owner, kind="stable")
    valence = np.bincount(owner, minlength=len(points))
    start = np.concatenate([[0], np.cumsum(valence)[:-1]])
    count = valence[owner]
    mine = np.repeat(np.arange(len(owner)), count)
    place = np.arange(len(mine)) - np.repeat(np.cumsum(count) - count, count)
    other = order[np.repeat(start[owner], count) + place]

    mine_face, other_face = mine // 3, other // 3
    smooth = np.einsum("ij,ij->i", unit[mine_face], unit[other_face]) >= CREASE_COS
    # A sliver without a direction follows all its neighbours.
    smooth |= flat[mine_face]
    total = np.zeros((len(owner), 3))
    for axis in range(3):
        total[:, axis] = np.bincount(
            mine[smooth], weights=area[other_face[smooth], axis], minlength=len(owner)
        )
    rounded = np.round(_unit(total) * NORMAL_STEPS) / NORMAL_STEPS
    return rounded.reshape(-1, 3, 3)


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: Floats = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 1e-14)
    return unit


def _canonical(faces: Ints) -> Ints:
    """Order independent of the boolean engine: smallest vertex first, faces sorted."""
    lead = np.argmin(faces, axis=1)
    turned = np.take_along_axis(faces, (lead[:, None] + np.arange(3)) % 3, axis=1)
    return turned[np.lexsort(turned.T[::-1])]
