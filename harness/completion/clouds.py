"""Clouds of points: what a view observed of an object, thinning, and distances between clouds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from sim_scenes.geometry import apply

if TYPE_CHECKING:
    import numpy.typing as npt

    from sim_scenes import Frame, Scene, SceneObject

    Floats = npt.NDArray[np.float64]

THINNED_FROM = 8192
"""Most points that an even choice is made from; of more, every k-th."""


def observed_points(frame: Frame, *, instance_id: int) -> Floats:
    """Points (n, 3) that a view measured on an object, by its true mask; metres, world."""
    if frame.instance_ids is None:
        return np.zeros((0, 3))
    shown = (frame.instance_ids == instance_id) & np.isfinite(frame.depth_m)
    x, y = frame.intrinsics.ray_slopes()
    depth_m = frame.depth_m.astype(np.float64)
    camera = np.stack([x * depth_m, y * depth_m, depth_m], axis=-1)[shown]
    return apply(frame.world_from_camera, camera)


def observed_of(scene: Scene, target: SceneObject) -> Floats:
    """Points (n, 3) that all views measured on an object, metres, world."""
    return np.concatenate(
        [observed_points(frame, instance_id=target.instance_id) for frame in scene.frames]
    )


def nearest_m(points: Floats, others: Floats) -> Floats:
    """Distance (n,) of each of points (n, 3) to the nearest of others (m, 3)."""
    distances, _ = cKDTree(others).query(points)
    return np.asarray(distances)


def spread_evenly(points: Floats, *, count: int) -> Floats:
    """Choose at most `count` of points (n, 3), each the farthest from those before it.

    The first is the farthest from the mean, so that the choice does not depend on the order of up
    to `THINNED_FROM` points. Of more only every k-th is looked at, in the order given.
    """
    if len(points) > THINNED_FROM:
        points = points[:: -(-len(points) // THINNED_FROM)]
    if len(points) <= count:
        return points
    centred = points - points.mean(axis=0)
    squares = np.einsum("nk,nk->n", centred, centred)
    chosen = np.zeros(count, dtype=np.int64)
    chosen[0] = int(squares.argmax())
    nearest = np.full(len(points), np.inf)
    for number in range(1, count):
        last = chosen[number - 1]
        # |p - q|^2 = |p|^2 + |q|^2 - 2 p q, which needs no difference of all points.
        np.minimum(nearest, squares + squares[last] - 2 * (centred @ centred[last]), out=nearest)
        chosen[number] = int(nearest.argmax())
    return np.asarray(points[chosen])
