"""Completions that need no network: what a completer must beat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harness.completion.clouds import nearest_m, spread_evenly

if TYPE_CHECKING:
    import numpy.typing as npt

    from harness.completion.mean_shape import MeanShape

    Floats = npt.NDArray[np.float64]

CLOUD_POINTS = 2048
"""Points of every baseline, as many as a completion has."""
YAWS = 36
BOX_SHARES = (0.005, 0.995)
"""The observed box leaves out this share of the points at each side: noise reaches far."""
FITTED_POINTS = 1024

BASELINES = ("observed", "mean shape", "mirrored")


def observed_only(observed_world: Floats) -> Floats:
    """Choose points spread evenly over what was observed (n, 3)."""
    return spread_evenly(observed_world, count=CLOUD_POINTS)


def mirrored(observed_world: Floats, *, camera_world: Floats) -> Floats:
    """Add the observation's mirror image in the vertical plane that faces the camera.

    The plane's normal is the horizontal direction from the camera, and it passes through the
    middle of the observed box that has this direction as an axis.

    Parameters
    ----------
    observed_world : (n, 3) float64
        Metres.
    camera_world : (3,) float64
        Where the camera stands; of several, their mean.
    """
    towards = observed_world.mean(axis=0)[:2] - camera_world[:2]
    length = float(np.linalg.norm(towards))
    # A camera straight above faces no way: the mirror image is the observation.
    normal = np.append(towards / length, 0.0) if length > 0 else np.zeros(3)
    along = observed_world @ normal
    middle = float(np.quantile(along, BOX_SHARES).mean())
    image = observed_world - 2 * (along - middle)[:, None] * normal
    return spread_evenly(np.concatenate([observed_world, image]), count=CLOUD_POINTS)


def scaled_mean_shape(shape: MeanShape, observed_world: Floats, *, table_height_m: float) -> Floats:
    """Scale the mean shape to the observed box, at the yaw at which it lies closest.

    The box stands on the table and has the yaw of the shape; of `YAWS` the one is taken at which
    the observed points are closest to the shape, in the mean.

    Parameters
    ----------
    shape
        The category's.
    observed_world : (n, 3) float64
        Metres.
    table_height_m
        Where the shape stands.
    """
    some = observed_world[:: -(-len(observed_world) // FITTED_POINTS)]
    best, least = shape.points_unit, np.inf
    for yaw in np.arange(YAWS) * (2 * np.pi / YAWS):
        turn = np.array(
            [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
        )
        low, high = np.quantile(observed_world @ turn, BOX_SHARES, axis=0)
        low[2] = min(low[2], table_height_m)
        points = (low + shape.points_unit * (high - low)) @ turn.T
        if (mean := float(nearest_m(some, points).mean())) < least:
            best, least = points, mean
    return np.asarray(best)
