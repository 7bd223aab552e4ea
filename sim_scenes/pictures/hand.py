"""The Panda's own hand before its camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.camera import HAND_FROM_CAMERA
from sim_scenes.geometry import Floats, inverse, rigid, turn

if TYPE_CHECKING:
    from sim_scenes.world import World

# Joint `panda_finger_joint1` of the Panda's URDF: where the fingers sit in the link `panda_hand`,
# and how far each opens.
FINGER_ORIGIN_M = (0.0, 0.0, 0.0584)
FINGER_OPEN_M = 0.04
# At its true mount the camera does not see the fingers. Mounts that do: nearer to them, turned
# towards them, and looking on from any side.
CLOSER_M = (0.0, 0.035)
FORWARD_M = (-0.05, 0.02)
TILT_RAD = (0.0, math.radians(22))
WOBBLE_RAD = math.radians(4)
SHOWN, HIDDEN = (1.0, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 0.0)


@dataclass(frozen=True)
class Part:
    """The hand or a finger: its body's number."""

    number: int


class Hand:
    """Hand and fingers in a world, as bodies that stay where they are put."""

    def __init__(self, world: World) -> None:
        import pybullet_data

        self._world = world
        meshes = Path(pybullet_data.getDataPath()) / "franka_panda" / "meshes" / "visual"
        self.parts = tuple(
            self._load(meshes / name) for name in ("hand.obj", "finger.obj", "finger.obj")
        )
        self.hide()

    def _load(self, mesh: Path) -> Part:
        world = self._world
        shape = world.call("createVisualShape", world.bullet.GEOM_MESH, fileName=str(mesh))
        return Part(world.call("createMultiBody", 0, -1, shape))

    def hide(self) -> None:
        """Take it out of the picture."""
        for part in self.parts:
            self._world.recolour(part.number, HIDDEN)

    def mount(self, *, world_from_camera: Floats, random: np.random.Generator) -> None:
        """Put the hand where a camera at a pose (4, 4) is likely to see it at its border."""
        world_from_hand = world_from_camera @ _mount(random)
        for part in self.parts:
            self._world.recolour(part.number, SHOWN)
        opening_m = random.uniform(0, FINGER_OPEN_M)
        hand, *fingers = self.parts
        self._world.put(hand.number, world_from_hand)
        # The second finger is the first, turned by half a turn about z.
        for finger, side in zip(fingers, (1.0, -1.0), strict=True):
            facing = np.diag([side, side, 1.0])
            offset = np.add(FINGER_ORIGIN_M, [0.0, side * opening_m, 0.0])
            self._world.put(
                finger.number, world_from_hand @ rigid(rotation=facing, translation=offset)
            )


def _mount(random: np.random.Generator) -> Floats:
    """Pose `camera_from_hand` (4, 4) of a mount that is not quite the true one."""
    camera_from_hand = inverse(HAND_FROM_CAMERA)
    # The hand lies above the image, at camera y < 0, and ahead of the lens.
    camera_from_hand[1, 3] += random.uniform(*CLOSER_M)
    camera_from_hand[2, 3] += random.uniform(*FORWARD_M)
    camera_from_hand[0, 3] += random.normal(0.0, 0.015)
    tilt = turn(0, -random.uniform(*TILT_RAD))
    wobble = turn(1, random.normal(0.0, WOBBLE_RAD)) @ turn(2, random.normal(0.0, WOBBLE_RAD))
    # A camera on another side of the hand sees it at another border: above in half of them.
    side = turn(2, random.choice([0.0, 0.0, 0.0, 0.5, 1.0, 1.5]) * math.pi)
    return rigid(rotation=side @ tilt @ wobble, translation=np.zeros(3)) @ camera_from_hand
