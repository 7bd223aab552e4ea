"""What can go wrong with a scene; every message names the value and the remedy."""

from __future__ import annotations

import platform


class SpecError(ValueError):
    """A scene specification that describes no scene."""


class SceneError(RuntimeError):
    """A scene that could not be drawn within its allowed redraws."""


class BopError(ValueError):
    """A BOP dataset that cannot be read or written; the message names the file."""


class SimulatorMissing(ImportError):
    """PyBullet is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "pybullet is not installed for this Python "
            f"({platform.python_implementation()} {platform.python_version()}). "
            "pybullet has wheels for CPython up to 3.11; "
            "run with Python 3.11 and `pip install pybullet`. "
            "Reading BOP datasets works without it."
        )
