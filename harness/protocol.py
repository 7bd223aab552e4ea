"""The seed's protocol: which points a classifier is asked about, and what is true of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.streams import stream

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from sim_scenes import SceneObject


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


def true_categories(
    distances_m: npt.NDArray[np.float64], objects: Sequence[SceneObject], *, tolerance_m: float
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
