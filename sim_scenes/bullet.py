"""The process's one PyBullet client."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from sim_scenes.errors import SimulatorMissing

TIME_STEP_S = 1 / 240


def require_pybullet() -> Any:
    """Import PyBullet.

    Raises
    ------
    SimulatorMissing
        If it is not installed; the message says for which Python it can be.
    """
    try:
        import pybullet
    except ImportError as error:
        raise SimulatorMissing from error
    return pybullet


@dataclass
class _Client:
    # The process that connected: a forked child must not share its parent's client.
    process: int = -1
    number: int = -1


_client = _Client()


def fresh_client() -> tuple[Any, int]:
    """Empty world of this process's client: the PyBullet module and the client's number.

    Every scene starts from here, so nothing of the one before it is left.
    """
    bullet = require_pybullet()
    if _client.process != os.getpid():
        _client.number = bullet.connect(bullet.DIRECT)
        _client.process = os.getpid()
    number = _client.number
    bullet.resetSimulation(physicsClientId=number)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=TIME_STEP_S,
        deterministicOverlappingPairs=1,
        physicsClientId=number,
    )
    bullet.setGravity(0.0, 0.0, -9.81, physicsClientId=number)
    return bullet, number
