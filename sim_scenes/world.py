"""The simulated room: a table, a floor, and the objects on the table.

The table's top is the plane z = 0, on which the Panda's base stands at the origin.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sim_scenes.bullet import fresh_client
from sim_scenes.geometry import (
    Floats,
    apply,
    quaternion_from_rotation,
    rigid,
    rotation_from_quaternion,
)
from sim_scenes.scratch import mesh_file, texture_file

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sim_scenes.solid import Solid
    from sim_scenes.textures import Picture

TABLE_CENTRE_M = (0.45, 0.0, -0.02)
TABLE_HALF_M = (0.65, 0.75, 0.02)
FLOOR_CENTRE_M = (0.45, 0.0, -0.76)
FLOOR_HALF_M = (6.0, 6.0, 0.01)

# Bullet keeps hulls apart by a margin, 1 mm as it comes; this one leaves objects 0.1 mm above the
# table instead of floating visibly.
COLLISION_MARGIN_M = 1e-4
DENSITY_KG_M3 = 400.0


@dataclass(frozen=True, eq=False)
class Body:
    """An object in the simulator."""

    number: int
    solid: Solid


class World:
    """One scene's simulation; making one empties the process's client.

    Attributes
    ----------
    bullet
        The PyBullet module.
    client
        The client's number.
    table, floor
        Body numbers.
    """

    def __init__(self) -> None:
        self.bullet, self.client = fresh_client()
        self.table = self._slab(half_m=TABLE_HALF_M, centre_m=TABLE_CENTRE_M)
        self.floor = self._slab(half_m=FLOOR_HALF_M, centre_m=FLOOR_CENTRE_M)
        self.bullet.changeDynamics(self.table, -1, lateralFriction=0.8, physicsClientId=self.client)

    def call(self, name: str, *args: Any, **kwargs: Any) -> Any:
        """Call a PyBullet function on this world's client."""
        return getattr(self.bullet, name)(*args, **kwargs, physicsClientId=self.client)

    def _slab(
        self, *, half_m: tuple[float, float, float], centre_m: tuple[float, float, float]
    ) -> int:
        """Add a box that stays put; its top is drawn, with one copy of its texture."""
        # PyBullet's own box stretches a small part of the texture over each side.
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float64)
        top = np.column_stack([corners, np.ones(4)]) * half_m
        drawn = mesh_file(
            top,
            np.array([[0, 1, 2], [0, 2, 3]]),
            normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
            uv=(corners + 1) / 2,
        )
        number: int = self.call(
            "createMultiBody",
            0,
            self.call("createCollisionShape", self.bullet.GEOM_BOX, halfExtents=half_m),
            self.call("createVisualShape", self.bullet.GEOM_MESH, fileName=str(drawn)),
            basePosition=centre_m,
        )
        return number

    def add(self, solid: Solid, *, world_from_object: Floats) -> Body:
        """Put an object into the world.

        It collides as its convex hull. On a plane that is exact: only hull vertices can touch it.
        Between objects it keeps them further apart than need be; none stands inside another.
        """
        mesh = self.bullet.GEOM_MESH
        drawn = mesh_file(solid.vertices, solid.faces, normals=solid.normals, uv=solid.uv)
        hull = mesh_file(solid.hull, solid.hull_faces)
        volume_m3 = float(np.prod(solid.bounds[1] - solid.bounds[0]))
        number: int = self.call(
            "createMultiBody",
            max(0.02, 0.3 * DENSITY_KG_M3 * volume_m3),
            self.call("createCollisionShape", mesh, fileName=str(hull)),
            self.call("createVisualShape", mesh, fileName=str(drawn)),
            baseInertialFramePosition=solid.centre_of_mass.tolist(),
        )
        self.call(
            "changeDynamics",
            number,
            -1,
            collisionMargin=COLLISION_MARGIN_M,
            lateralFriction=0.8,
            # A length: resistance shifts the support by at most this much.
            rollingFriction=5e-4,
            spinningFriction=0.01,
            linearDamping=0.5,
            angularDamping=0.5,
        )
        if not solid.closed:
            self.call(
                "changeVisualShape",
                number,
                -1,
                flags=self.bullet.VISUAL_SHAPE_DOUBLE_SIDED,
            )
        body = Body(number, solid)
        self.place(body, world_from_object=world_from_object)
        return body

    def place(self, body: Body, *, world_from_object: Floats) -> None:
        """Put an object, at rest, where the pose (4, 4) of its mesh frame says."""
        # PyBullet poses a body by its centre of mass, which is not the mesh's origin.
        centre = apply(world_from_object, body.solid.centre_of_mass[None])[0]
        self.put(body.number, rigid(rotation=world_from_object[:3, :3], translation=centre))
        self.call("resetBaseVelocity", body.number, [0.0] * 3, [0.0] * 3)

    def put(self, number: int, pose: Floats) -> None:
        """Put a body's centre of mass, and its axes, at a pose (4, 4)."""
        self.call(
            "resetBasePositionAndOrientation",
            number,
            pose[:3, 3].tolist(),
            quaternion_from_rotation(pose[:3, :3]).tolist(),
        )

    def pose(self, body: Body) -> Floats:
        """Pose `world_from_object` (4, 4) of an object's mesh frame."""
        centre, quaternion = self.call("getBasePositionAndOrientation", body.number)
        rotation = rotation_from_quaternion(quaternion)
        return rigid(
            rotation=rotation,
            translation=np.array(centre) - rotation @ body.solid.centre_of_mass,
        )

    def cover(self, number: int, picture: Picture) -> None:
        """Cover a body with a picture (h, w, 3)."""
        self.wrap(number, self.load_texture(picture))

    def load_texture(self, picture: Picture) -> int:
        """Load a picture (h, w, 3); return its number, which holds until the world is emptied."""
        path = texture_file(picture)
        with self.uncached():
            loaded: int = self.call("loadTexture", str(path))
        path.unlink()
        return loaded

    def wrap(
        self, number: int, texture: int, *, tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ) -> None:
        """Cover a body with a loaded texture, its colours multiplied by a tint."""
        self.call("changeVisualShape", number, -1, textureUniqueId=texture, rgbaColor=[*tint, 1.0])

    def recolour(self, number: int, rgba: tuple[float, float, float, float]) -> None:
        """Multiply a body's colours; the renderer skips what is wholly transparent."""
        self.call("changeVisualShape", number, -1, rgbaColor=rgba)

    @contextmanager
    def uncached(self) -> Iterator[None]:
        """Read files without keeping them: PyBullet otherwise does so for ever.

        Right for meshes that come again and again, a leak for textures.
        """
        self.call("setPhysicsEngineParameter", enableFileCaching=0)
        try:
            yield
        finally:
            self.call("setPhysicsEngineParameter", enableFileCaching=1)

    def step(self, count: int) -> None:
        """Advance the simulation by `count` time steps."""
        for _ in range(count):
            self.call("stepSimulation")

    def within(self, first: int, second: int, *, limit_m: float, **links: int) -> bool:
        """Whether two bodies (or links of them) come closer than `limit_m`."""
        return bool(self.call("getClosestPoints", first, second, limit_m, **links))
