"""The mesh file that the generator writes: binary PLY, the same bytes for the same mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

if TYPE_CHECKING:
    import trimesh
    from trimesh.visual import TextureVisuals

# `s t` are texture coordinates, as Blender and MeshLab write them.
VERTEX_FIELDS = ("x", "y", "z", "nx", "ny", "nz", "s", "t")


def ply_bytes(mesh: trimesh.Trimesh) -> bytes:
    """Encode positions, normals and texture coordinates as float32, and triangles."""
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(mesh.vertices)}",
        *(f"property float {name}" for name in VERTEX_FIELDS),
        f"element face {len(mesh.faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    uv = cast("TextureVisuals", mesh.visual).uv
    vertices = np.hstack([mesh.vertices, mesh.vertex_normals, uv]).astype("<f4")
    faces = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    faces["corners"] = mesh.faces
    return "\n".join([*header, ""]).encode("ascii") + vertices.tobytes() + faces.tobytes()
