"""The Panda's links, held to where PyBullet puts them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from harness.view.arm import Panda, load_panda
from sim_scenes.arm import FINGER_OPEN_M, FINGERS, JOINTS, LOWER_RAD, UPPER_RAD
from sim_scenes.bullet import fresh_client
from sim_scenes.geometry import rigid, rotation_from_quaternion


@pytest.fixture(scope="module")
def panda() -> Panda:
    return load_panda()


def test_links_stand_where_the_simulator_has_them(panda: Panda) -> None:
    import pybullet_data

    bullet, client = fresh_client()
    urdf = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
    body = bullet.loadURDF(str(urdf), useFixedBase=1, physicsClientId=client)
    names = {}
    for joint in range(bullet.getNumJoints(body, physicsClientId=client)):
        names[joint] = bullet.getJointInfo(body, joint, physicsClientId=client)[12].decode()
    rng = np.random.default_rng(0)
    for _ in range(5):
        angles = rng.uniform(LOWER_RAD, UPPER_RAD)
        positions = [*zip(JOINTS, angles.tolist(), strict=True)]
        for joint, position in [*positions, *((finger, FINGER_OPEN_M) for finger in FINGERS)]:
            bullet.resetJointState(body, joint, position, physicsClientId=client)
        poses = panda.world_from_links(angles)
        assert set(names.values()) | {"panda_link0"} == set(poses)
        for joint, name in names.items():
            state = bullet.getLinkState(
                body, joint, computeForwardKinematics=1, physicsClientId=client
            )
            rotation = rotation_from_quaternion(state[5])
            expected = rigid(rotation=rotation, translation=state[4])
            assert poses[name] == pytest.approx(expected, abs=1e-6), name


def test_upright_arm_by_hand(panda: Panda) -> None:
    """All joints at zero: the flange points down, 0.088 m before the base.

    Its height is 0.333 + 0.316 + 0.384 - 0.107 m: Denavit and Hartenberg's lengths of the Panda.
    """
    flange = panda.world_from_links(np.zeros(7))["panda_link8"]
    assert flange[:3, 3] == pytest.approx([0.088, 0.0, 0.926], abs=1e-9)
    assert flange[:3, 2] == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)


def test_meshes_are_small_and_turned_as_described(panda: Panda) -> None:
    assert sum(mesh.vertices.shape[0] for mesh in panda.meshes.values()) < 10_000
    left, right = (panda.meshes[f"panda_{side}finger"].vertices for side in ("left", "right"))
    assert right == pytest.approx(left * [-1.0, -1.0, 1.0], abs=1e-9)
