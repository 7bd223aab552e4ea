"""The process's one PyBullet client."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim_scenes.errors import SimulatorMissing

if TYPE_CHECKING:
    from collections.abc import Iterator

TIME_STEP_S = 1 / 240


def require_pybullet() -> Any:
    """Import PyBullet.

    Raises
    ------
    SimulatorMissing
        If it is not installed; the message says for which Python it can be.
    """
    try:
        with _quiet_stderr():
            import pybullet
    except ImportError as error:
        raise SimulatorMissing from error
    return pybullet


@contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Drop what the block prints: PyBullet greets with its build time amid our lines."""
    sys.stderr.flush()
    kept = os.dup(2)
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        sys.stderr.flush()
        os.dup2(kept, 2)
        os.close(kept)


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
