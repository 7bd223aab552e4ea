"""From the simulated room to images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from sim_scenes.camera import Intrinsics, depth_from_buffer, projection_matrix, view_matrix

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_scenes.geometry import Floats
    from sim_scenes.world import World


@dataclass(frozen=True)
class Light:
    """One distant lamp and the ambient light.

    Attributes
    ----------
    direction
        Towards the lamp, world axes.
    colour
        (3,) in [0, 1].
    ambient, diffuse, specular
        Weights of the shading's three terms.
    """

    direction: tuple[float, float, float] = (0.4, -0.5, 1.0)
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    ambient: float = 0.55
    diffuse: float = 0.45
    specular: float = 0.05

    @classmethod
    def draw(cls, random: np.random.Generator) -> Light:
        """Draw a lamp 25 to 80 degrees high, warm to cool, in a bright or a dim room."""
        bearing = random.uniform(-np.pi, np.pi)
        height = np.radians(random.uniform(25, 80))
        warmth = random.uniform(-0.12, 0.12)
        ambient = random.uniform(0.4, 0.65)
        return cls(
            direction=(
                float(np.cos(height) * np.cos(bearing)),
                float(np.cos(height) * np.sin(bearing)),
                float(np.sin(height)),
            ),
            colour=(float(min(1, 1 + warmth)), 1 - abs(warmth) / 3, float(min(1, 1 - warmth))),
            ambient=ambient,
            diffuse=random.uniform(0.85, 1.1) - ambient,
            specular=random.uniform(0.0, 0.25),
        )

    def arguments(self) -> dict[str, Any]:
        """As `getCameraImage` takes it."""
        return {
            "lightDirection": self.direction,
            "lightColor": self.colour,
            "lightAmbientCoeff": self.ambient,
            "lightDiffuseCoeff": self.diffuse,
            "lightSpecularCoeff": self.specular,
        }


class Numbered(Protocol):
    """What stands in a world."""

    @property
    def number(self) -> int:
        """Of its body, which has no links."""
        ...


@dataclass(frozen=True, eq=False)
class Picture:
    """What the renderer gives: exact depth, no sensor yet.

    Attributes
    ----------
    rgb : (h, w, 3) uint8
    depth_m : (h, w) float32
        NaN where nothing is.
    instance_ids : (h, w) uint16
    arm_in_view
        Whether a pixel shows the arm.
    """

    rgb: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    instance_ids: npt.NDArray[np.uint16]
    arm_in_view: bool


def render(
    world: World,
    *,
    bodies: Sequence[Numbered],
    world_from_camera: Floats,
    intrinsics: Intrinsics,
    light: Light,
) -> Picture:
    """Render the room with TinyRenderer, without shadows; the k-th body is instance k + 1."""
    bullet = world.bullet
    height, width = intrinsics.height, intrinsics.width
    _, _, rgba, buffer, segments = world.call(
        "getCameraImage",
        width,
        height,
        view_matrix(world_from_camera),
        projection_matrix(intrinsics),
        shadow=0,
        renderer=bullet.ER_TINY_RENDERER,
        flags=bullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
        **light.arguments(),
    )
    # A segment is the body in its lower 24 bits, the link above them; -1 is the void. Objects have
    # no links, so links of the arm match none.
    labels = np.asarray(segments).reshape(height, width)
    instance_ids = np.zeros((height, width), dtype=np.uint16)
    for instance, body in enumerate(bodies, start=1):
        instance_ids[labels == body.number] = instance
    return Picture(
        rgb=np.ascontiguousarray(
            np.asarray(rgba).reshape(height, width, 4)[..., :3], dtype=np.uint8
        ),
        depth_m=depth_from_buffer(np.asarray(buffer).reshape(height, width)),
        instance_ids=instance_ids,
        # Bodies without links leave the upper bits empty; the arm's base link does too, but where
        # the base is in view, so is the shoulder on it.
        arm_in_view=bool((labels >= 1 << 24).any()),
    )
