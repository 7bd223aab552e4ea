"""The Panda: inverse kinematics, what it must not touch, and the camera's true pose."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from sim_scenes.bullet import TIME_STEP_S
from sim_scenes.camera import HAND_FROM_CAMERA, HOUSING_HALF_M
from sim_scenes.geometry import (
    Floats,
    inverse,
    quaternion_from_rotation,
    rigid,
    rotation_angle,
    rotation_from_quaternion,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sim_scenes.world import Body, World

# Joint limits of the Panda's datasheet (the soft limits of its URDF), radians.
LOWER_RAD = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
UPPER_RAD = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
LIMIT_MARGIN_RAD = 0.02
FORCE_NM = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)
FINGER_OPEN_M = 0.04
FINGER_FORCE_N = 20.0

JOINTS = tuple(range(7))
HAND = 8
FINGERS = (9, 10)
# Links by the joint that carries them; the base is -1 and stands on the table.
TABLE_FREE = (1, 2, 3, 4, 5, 6, HAND, *FINGERS)
HAND_LINKS = (HAND, *FINGERS)
BODY_LINKS = (-1, 0, 1, 2, 3)

# Starts of the inverse kinematics: a greedy choice out of 62, in order of what each adds. On
# camera poses all around targets within reach they solve 94 % of what 62 starts solve 94 % of;
# the first alone 86 %.
STARTS_RAD = (
    (0.0, -0.3, 0.0, -2.2, 0.0, 2.0, 0.785),
    (1.2, 0.0, 1.0, -1.6, 0.0, 2.4, -0.8),
    (0.0, 0.6, 1.0, -1.6, 0.0, 1.5, 0.8),
    (-1.2, -0.9, 1.0, -1.6, 1.0, 1.5, 0.8),
    (0.0, -0.9, -1.0, -2.4, 1.0, 2.4, -0.8),
)
ROUNDS = 10
ITERATIONS = 20
REACHED_M = 5e-4
REACHED_RAD = math.radians(0.2)

CLEARANCE_M = 0.01
HOLD_S = 0.05


class Arm:
    """The Panda with its wrist camera, loaded into a world; it stands at the origin."""

    def __init__(self, world: World) -> None:
        import pybullet_data

        self._world = world
        urdf = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
        self._body: int = world.call("loadURDF", str(urdf), useFixedBase=1)
        self._housing: int = world.call(
            "createMultiBody",
            0,
            world.call("createCollisionShape", world.bullet.GEOM_BOX, halfExtents=HOUSING_HALF_M),
            -1,
            basePosition=[0.0, 0.0, -5.0],
        )
        # The housing only takes part in distance queries.
        world.call("setCollisionFilterGroupMask", self._housing, -1, 0, 0)

    def reach(self, world_from_camera: Floats, *, starts: Iterable[npt.ArrayLike]) -> bool:
        """Move the joints, by inverse kinematics, until the camera has a pose (4, 4).

        False if no start leads within 0.5 mm and 0.2 degrees inside the joint limits. PyBullet's
        null-space variant, which would keep the limits itself, finds a tenth of the solutions.
        """
        world_from_hand = world_from_camera @ inverse(HAND_FROM_CAMERA)
        position = world_from_hand[:3, 3].tolist()
        quaternion = quaternion_from_rotation(world_from_hand[:3, :3]).tolist()
        for start in starts:
            self._set_joints(np.asarray(start))
            for _ in range(ROUNDS):
                solution = self._world.call(
                    "calculateInverseKinematics",
                    self._body,
                    HAND,
                    position,
                    quaternion,
                    maxNumIterations=ITERATIONS,
                    residualThreshold=1e-6,
                )
                self._set_joints(
                    np.clip(
                        solution[:7],
                        LOWER_RAD + LIMIT_MARGIN_RAD,
                        UPPER_RAD - LIMIT_MARGIN_RAD,
                    )
                )
                miss = inverse(world_from_hand) @ self._world_from_hand()
                if (
                    math.hypot(*miss[:3, 3]) < REACHED_M
                    and rotation_angle(miss[:3, :3]) < REACHED_RAD
                ):
                    return True
        return False

    def hold(self) -> None:
        """Let the position controller hold the joints where they are, under gravity."""
        bullet, call = self._world.bullet, self._world.call
        call(
            "setJointMotorControlArray",
            self._body,
            [*JOINTS, *FINGERS],
            bullet.POSITION_CONTROL,
            targetPositions=[*self.joint_positions_rad().tolist(), *[FINGER_OPEN_M] * 2],
            forces=[*FORCE_NM, *[FINGER_FORCE_N] * 2],
        )
        self._world.step(round(HOLD_S / TIME_STEP_S))

    def touches(self, bodies: Iterable[Body]) -> str | None:
        """Name what the arm or camera comes within 1 cm of: the table, an object, or itself."""
        world = self._world
        camera = self.world_from_camera()
        world.call(
            "resetBasePositionAndOrientation",
            self._housing,
            camera[:3, 3].tolist(),
            quaternion_from_rotation(camera[:3, :3]).tolist(),
        )
        obstacles = [("the table", world.table)]
        obstacles += [(body.solid.name, body.number) for body in bodies]
        for name, number in obstacles:
            if world.within(self._housing, number, limit_m=CLEARANCE_M):
                return name
            points = world.call("getClosestPoints", self._body, number, CLEARANCE_M)
            if any(number != world.table or point[3] in TABLE_FREE for point in points):
                return name
        for link in BODY_LINKS:
            if world.within(self._housing, self._body, limit_m=0.0, linkIndexB=link) or any(
                world.within(self._body, self._body, limit_m=0.0, linkIndexA=tool, linkIndexB=link)
                for tool in HAND_LINKS
            ):
                return "itself"
        return None

    def joint_positions_rad(self) -> Floats:
        """Angles (7,) of the joints as simulated."""
        states = self._world.call("getJointStates", self._body, JOINTS)
        return np.array([state[0] for state in states])

    def world_from_camera(self) -> Floats:
        """Pose (4, 4) of the camera that the simulated joints give."""
        return self._world_from_hand() @ HAND_FROM_CAMERA

    def _world_from_hand(self) -> Floats:
        # Entries 4 and 5 are the link's own frame; 0 and 1 are its centre of mass.
        state = self._world.call("getLinkState", self._body, HAND, computeForwardKinematics=1)
        return rigid(rotation=rotation_from_quaternion(state[5]), translation=state[4])

    def _set_joints(self, positions_rad: Floats) -> None:
        for joint, position in zip(JOINTS, positions_rad.tolist(), strict=True):
            self._world.call("resetJointState", self._body, joint, position)
        for finger in FINGERS:
            self._world.call("resetJointState", self._body, finger, FINGER_OPEN_M)
