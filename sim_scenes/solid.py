"""A model prepared for the simulator: what is drawn, what collides, what is true."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from PIL import Image

from sim_scenes.objects import ObjectError

if TYPE_CHECKING:
    from pathlib import Path

    from sim_scenes.geometry import Floats, Ints
    from sim_scenes.objects import ObjectModel
    from sim_scenes.textures import Picture

TEXTURE_SIDE_PX = 512


@dataclass(frozen=True, eq=False)
class Solid:
    """A mesh and its convex hull, metres, in the object's own frame.

    Attributes
    ----------
    name, category
        Of the model.
    vertices : (n, 3) float64
        Exact in float32, as the renderer stores them: what is drawn is what is true.
    faces : (m, 3) int64
    normals : (n, 3) float64
        For shading.
    uv : (n, 2) float64 or None
    texture : (h, w, 3) uint8 or None
        The model's own picture.
    closed
        Whether the surface is closed and faces outwards; others are drawn from both sides.
    hull : (k, 3) float64
        Corners of the convex hull.
    hull_faces : (l, 3) int64
    centre_of_mass : (3,) float64
        Of the hull, evenly filled.
    """

    name: str
    category: str
    vertices: Floats
    faces: Ints
    normals: Floats
    uv: Floats | None
    texture: Picture | None
    closed: bool
    hull: Floats
    hull_faces: Ints
    centre_of_mass: Floats

    @property
    def bounds(self) -> Floats:
        """Lower and upper corner (2, 3)."""
        return np.array([self.hull.min(axis=0), self.hull.max(axis=0)])


@lru_cache(maxsize=64)
def solid_from_model(model: ObjectModel) -> Solid:
    """Load a model; the same one is loaded once per process."""
    mesh = model.load_mesh()
    vertices = np.asarray(mesh.vertices, dtype=np.float32).astype(np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    uv = getattr(mesh.visual, "uv", None)
    # Vertices that differ in texture or normal alone are one: closed is a matter of positions.
    points, index = np.unique(vertices, axis=0, return_inverse=True)
    merged = trimesh.Trimesh(points, index.reshape(-1)[faces], process=False)
    hull = merged.convex_hull
    return Solid(
        name=model.name,
        category=model.category,
        vertices=vertices,
        faces=faces,
        normals=np.asarray(mesh.vertex_normals, dtype=np.float64),
        uv=None if uv is None else np.asarray(uv, dtype=np.float64)[:, :2],
        texture=_texture(model.texture_path) if uv is not None else None,
        closed=bool(merged.is_volume),
        hull=np.asarray(hull.vertices, dtype=np.float64),
        hull_faces=np.asarray(hull.faces, dtype=np.int64),
        centre_of_mass=np.asarray(hull.center_mass, dtype=np.float64),
    )


def _texture(path: Path | None) -> Picture | None:
    if path is None:
        return None
    try:
        with Image.open(path) as image:
            picture = image.convert("RGB")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise ObjectError(
            f"{path}: is not a readable picture ({error}); "
            "restore it, or take it out of the manifest"
        ) from error
    # Beyond this the renderer, which takes the nearest texel, only shimmers.
    picture.thumbnail((TEXTURE_SIDE_PX, TEXTURE_SIDE_PX))
    return np.asarray(picture, dtype=np.uint8)
