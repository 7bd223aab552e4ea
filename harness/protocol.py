"""Which points a classifier is asked about, and what is true of them.

A test set is named in a configuration by how its points come about, and in a record by the shape
completion that it stands for: ``box``, the seed's protocol without completion, is ``none``;
``completed`` has the completer's name. `harness.asked` takes the completed points from a pipeline.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from sim_scenes.streams import stream

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from sim_scenes import SceneObject

COMPLETED = "completed"
"""The test set that a completer makes."""

COMPLETIONS = {"box": "none", "perturbed": "perturbed"}
"""Completion that a record states, by test set that is drawn from the truth."""

SCALE_ERROR = (0.05, 0.10)
SHIFT_M = 0.004
NOISE_M = (0.002, 0.003)


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


def draw_test_points(
    target: SceneObject, *, test_set: str, count: int, seed: int
) -> npt.NDArray[np.float64]:
    """Draw the points (count, 3) of a test set other than the completed one, world metres."""
    draw = {"box": box_test_points, "perturbed": perturbed_test_points}[test_set]
    return draw(target, count=count, seed=seed)


def box_test_points(target: SceneObject, *, count: int, seed: int) -> np.ndarray:
    """Points drawn evenly in the object's true box, the protocol's test set without completion.

    Parameters
    ----------
    target
        The object; its box is the axis-aligned one of its mesh in the object's own frame.
    count
        Number of points.
    seed
        The scene's seed.

    Returns
    -------
    points_world : (count, 3) float64
        Metres.
    """
    low, high = target.vertices.min(axis=0), target.vertices.max(axis=0)
    points_object = stream(seed, "test points").uniform(low, high, size=(count, 3))
    rotation, translation = target.world_from_object[:3, :3], target.world_from_object[:3, 3]
    return np.ascontiguousarray(points_object @ rotation.T + translation)


def perturbed_test_points(target: SceneObject, *, count: int, seed: int) -> np.ndarray:
    """Points of a wrong instance of the object, where a shape completion would put them.

    Points drawn evenly on the object's surface are scaled about the middle of its box, up or down
    by a share drawn from `SCALE_ERROR`, shifted by `SHIFT_M` in a random direction, and each moved
    by isotropic noise whose standard deviation is drawn from `NOISE_M` for the whole scene.

    Parameters
    ----------
    target, count, seed
        As for `box_test_points`.

    Returns
    -------
    points_world : (count, 3) float64
        Metres.
    """
    random = stream(seed, "perturbed instance")
    scale = 1.0 + random.choice((-1.0, 1.0)) * random.uniform(*SCALE_ERROR)
    direction = random.normal(size=3)
    noise_m = random.uniform(*NOISE_M)
    middle = (target.vertices.min(axis=0) + target.vertices.max(axis=0)) / 2
    surface = surface_points(
        target.vertices, target.faces, count=count, random=stream(seed, "perturbed surface")
    )
    noise = stream(seed, "perturbed noise").normal(scale=noise_m, size=(count, 3))
    points_object = middle + scale * (surface - middle)
    rotation, translation = target.world_from_object[:3, :3], target.world_from_object[:3, 3]
    shift = SHIFT_M * direction / np.linalg.norm(direction)
    return np.ascontiguousarray(points_object @ rotation.T + translation + shift + noise)


def surface_points(
    vertices: npt.NDArray[np.float64],
    faces: npt.NDArray[np.int64],
    *,
    count: int,
    random: np.random.Generator,
) -> npt.NDArray[np.float64]:
    """Points (count, 3) spread evenly by area over a mesh of vertices (n, 3) and faces (m, 3)."""
    corners = vertices[faces]
    edges = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    upto = np.cumsum(areas)
    draws = random.uniform(size=(count, 3))
    face = np.searchsorted(upto, draws[:, 0] * upto[-1], side="right").clip(max=len(areas) - 1)
    # Even in a triangle: what falls beyond its third side is turned back into it.
    weights = draws[:, 1:]
    weights = np.where(weights.sum(axis=1, keepdims=True) > 1.0, 1.0 - weights, weights)
    return np.asarray(corners[face, 0] + np.einsum("nk,nkd->nd", weights, edges[face]))


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
