"""Test points that are drawn from the truth: in the target's box, or on a wrong instance of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.streams import stream

if TYPE_CHECKING:
    import numpy.typing as npt

    from sim_scenes import SceneObject

SCALE_ERROR = (0.05, 0.10)
SHIFT_M = 0.004
NOISE_M = (0.002, 0.003)


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
