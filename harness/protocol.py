"""Which points a classifier is asked about, and what is true of them.

A test set is named in a configuration by how its points come about, and in a record by the shape
completion that it stands for: ``box``, the seed's protocol without completion, is ``none``;
``completed`` has the completer's name. `harness.drawn_points` draws
points from the truth, `harness.asked` takes completed ones from a pipeline.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

COMPLETED = "completed"
"""The test set that a completer makes."""

COMPLETIONS = {"box": "none", "perturbed": "perturbed"}
"""Completion that a record states, by test set that is drawn from the truth."""


class HasCategory(Protocol):
    """What is needed of a true object."""

    @property
    def category(self) -> str:
        """One of the six of NOCS."""
        ...


class HasCompleter(Protocol):
    """What names a completion: a pipeline."""

    @property
    def completer(self) -> str:
        """``cloud``, ``centersnap``, or ``python:module.function``."""
        ...


def completion_name(test_set: str, pipeline: HasCompleter) -> str:
    """Completion that a record states of a test set.

    A completer from outside goes by its function's name, and by its module's too where the
    function's alone is the name of another test set's completion.
    """
    if test_set != COMPLETED:
        return COMPLETIONS[test_set]
    path = pipeline.completer.removeprefix("python:")
    function = path.rpartition(".")[2]
    return path if function in COMPLETIONS.values() else function


def test_set_of(completion: str) -> str:
    """Test set of a record by the completion that it states."""
    drawn = {name: test_set for test_set, name in COMPLETIONS.items()}
    return drawn.get(completion, COMPLETED)


def true_categories(
    distances_m: npt.NDArray[np.float64], objects: Sequence[HasCategory], *, tolerance_m: float
) -> npt.NDArray[np.str_]:
    """Category of the object that each point lies on, ``"free"`` where it lies on none.

    Parameters
    ----------
    distances_m : (objects, n) float64
        Distance of each point to each object's true mesh, metres.
    objects
        The scene's objects.
    tolerance_m
        A point lies on the nearest mesh when it is within this distance, metres.

    Returns
    -------
    categories : (n,) str
    """
    names = np.array([item.category for item in objects])
    nearest = distances_m.argmin(axis=0)
    return np.where(distances_m.min(axis=0) <= tolerance_m, names[nearest], "free")
