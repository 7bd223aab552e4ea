"""The room in which a group of pictures is taken: things are loaded once and shown or hidden."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from sim_scenes.pictures.distractors import Shape, standing, unwrap
from sim_scenes.pictures.hand import HIDDEN
from sim_scenes.pictures.layout import Footprint
from sim_scenes.scratch import mesh_file
from sim_scenes.world import World

if TYPE_CHECKING:
    from sim_scenes.geometry import Floats
    from sim_scenes.objects import ObjectModel
    from sim_scenes.textures import Picture

Tint = tuple[float, float, float]
WHITE: Tint = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Thing:
    """A thing that is loaded: its body's number, and the room it takes."""

    number: int
    footprint: Footprint


class Stage:
    """A world without physics."""

    def __init__(self) -> None:
        self.world = World()

    def load(self, shape: Shape) -> Thing:
        """Load a shape, hidden."""
        if not shape.closed:
            shape = two_sided(shape)
        drawn = mesh_file(shape.vertices, shape.faces, normals=shape.normals, uv=shape.uv)
        bullet = self.world.bullet
        # A file that is loaded once is not worth keeping, neither by PyBullet nor on the disk.
        with self.world.uncached():
            visual = self.world.call("createVisualShape", bullet.GEOM_MESH, fileName=str(drawn))
            number: int = self.world.call("createMultiBody", 0, -1, visual)
        drawn.unlink()
        self.hide(number)
        return Thing(number, Footprint(shape.radius_m, shape.height_m))

    def show(self, number: int, pose: Floats, *, texture: int, tint: Tint = WHITE) -> None:
        """Put a body where its pose (4, 4) says, covered with a texture."""
        self.world.put(number, pose)
        self.world.wrap(number, texture, tint=tint)

    def hide(self, number: int) -> None:
        """Take a body out of the picture."""
        self.world.recolour(number, HIDDEN)

    def load_texture(self, picture: Picture) -> int:
        """Load a surface (h, w, 3)."""
        return self.world.load_texture(picture)


def two_sided(shape: Shape) -> Shape:
    """Add the faces' other sides: TinyRenderer ignores PyBullet's flag for that."""
    return Shape(
        vertices=np.vstack([shape.vertices, shape.vertices]),
        faces=np.vstack([shape.faces, shape.faces[:, ::-1] + len(shape.vertices)]),
        normals=np.vstack([shape.normals, -shape.normals]),
        uv=np.vstack([shape.uv, shape.uv]),
        closed=True,
    )


def shape_of(model: ObjectModel, *, scale: float) -> Shape:
    """Load a model at a scale; its own texture is left out, for surfaces are drawn."""
    mesh = model.load_mesh()
    vertices = standing(scale * np.asarray(mesh.vertices, dtype=np.float64))
    faces = np.asarray(mesh.faces, dtype=np.int64)
    uv = getattr(mesh.visual, "uv", None)
    # Vertices that differ in texture or normal alone are one: closed is a matter of positions.
    points, index = np.unique(vertices, axis=0, return_inverse=True)
    merged = trimesh.Trimesh(points, index.reshape(-1)[faces], process=False)
    if uv is None:
        unwrapped = unwrap(merged.vertices, merged.faces)
        return Shape(
            unwrapped.vertices,
            unwrapped.faces,
            unwrapped.normals,
            unwrapped.uv,
            closed=bool(merged.is_volume),
        )
    return Shape(
        vertices=vertices,
        faces=faces,
        normals=np.asarray(mesh.vertex_normals, dtype=np.float64),
        uv=np.asarray(uv, dtype=np.float64)[:, :2],
        closed=bool(merged.is_volume),
    )
