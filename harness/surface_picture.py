"""Clouds of points over a true surface, in perspective: what a completion gets right and wrong.

The surface is cast ray by ray, and a point is drawn where it lies no deeper than a little behind
the surface: what stands on the far side stays hidden.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from harness.cubes import OVERSAMPLING, Picture, View

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.native import MeshTruth

Floats = npt.NDArray[np.float64]

OBSERVED_COLOUR = (232, 48, 40)
COMPLETED_COLOUR = (255, 255, 255)
GROUND = (38, 40, 46)
# Grey of a surface that faces sideways, and that faces the viewer: both darker than every cloud.
SURFACE_GREY = (52, 128)
# A point this far behind the surface still shows.
BEHIND_M = 0.003
RADIUS_PX = 1.6
VIEW_DISTANCE_M = 0.6
ELEVATION_RAD = np.deg2rad(30.0)


@dataclass(frozen=True, eq=False)
class Dots:
    """A cloud to draw.

    Attributes
    ----------
    points_world : (n, 3) float64
        Metres.
    """

    points_world: Floats
    colour: tuple[int, int, int]


def two_sides(
    shown_world: Floats, *, camera_world: Floats, size: tuple[int, int]
) -> tuple[View, View]:
    """Stand on the camera's side and behind it all, so that points (n, 3) fill the views."""
    focus = (shown_world.min(axis=0) + shown_world.max(axis=0)) / 2
    offset = camera_world[:2] - focus[:2]
    azimuth = float(np.arctan2(offset[1], offset[0]))
    # The views keep the distance to the nearest of the points, whatever their extent.
    distance = VIEW_DISTANCE_M + float(np.linalg.norm(np.ptp(shown_world, axis=0))) / 2
    views = []
    for angle in (azimuth, azimuth + np.pi):
        direction = [
            np.cos(ELEVATION_RAD) * np.cos(angle),
            np.cos(ELEVATION_RAD) * np.sin(angle),
            np.sin(ELEVATION_RAD),
        ]
        view = View(focus + distance * np.array(direction), focus, size=size)
        views.append(view.fitted_to(shown_world))
    return views[0], views[1]


class Backdrop:
    """A true surface from one side, over which clouds are drawn.

    Parameters
    ----------
    truth
        The surface, in the world.
    view
        Where from.
    """

    def __init__(self, truth: MeshTruth, view: View) -> None:
        width, height = view.size
        self._view = replace(view, size=(width * OVERSAMPLING, height * OVERSAMPLING))
        self._size = view.size
        self._depth = cast_surface(truth, self._view)
        self._grey = shade_surface(self._depth, self._view)

    def draw(self, clouds: Sequence[Dots]) -> Picture:
        """Draw clouds, all before the viewer, the near points last; (height, width, 3) uint8."""
        image = Image.fromarray(self._grey)
        pen = ImageDraw.Draw(image)
        points = np.concatenate([cloud.points_world for cloud in clouds])
        colours = [cloud.colour for cloud in clouds for _ in cloud.points_world]
        depths, pixels = self._view.depths(points), self._view.project(points)
        column, row = pixels.astype(int).T
        width, height = self._view.size
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        surface = np.full(len(points), np.inf)
        surface[inside] = self._depth[row[inside], column[inside]]
        # Where no surface lies behind a point, it shows.
        shown = inside & ~(depths > surface + BEHIND_M)
        radius = RADIUS_PX * OVERSAMPLING
        for index in np.argsort(-depths, kind="stable"):
            if shown[index]:
                u, v = pixels[index].tolist()
                pen.ellipse((u - radius, v - radius, u + radius, v + radius), fill=colours[index])
        return np.asarray(image.resize(self._size, Image.Resampling.BOX))


def cast_surface(truth: MeshTruth, view: View) -> Floats:
    """Depth (height, width) of the surface at each pixel, NaN where there is none."""
    rays = view.rays()
    directions = np.ascontiguousarray(rays.reshape(-1, 3))
    origins = np.ascontiguousarray(np.broadcast_to(view.eye_world, directions.shape))
    return truth.ray_depths(origins, directions).reshape(rays.shape[:2])


def shade_surface(
    depth: Floats,
    view: View,
    *,
    greys: tuple[int, int] = SURFACE_GREY,
    ground: tuple[int, int, int] = GROUND,
) -> Picture:
    """Shade a surface by how far it is turned to the viewer.

    Parameters
    ----------
    depth : (height, width) float64
        As `cast_surface` finds it.
    view
        Where from.
    greys
        Where the surface faces sideways, and where it faces the viewer.
    ground
        Where there is none.

    Returns
    -------
    picture : (height, width, 3) uint8
    """
    rays = view.rays()
    hits = rays * depth[..., None]
    down, right = np.gradient(hits, axis=(0, 1))
    normal = np.cross(right, down)
    lengths = np.linalg.norm(normal, axis=-1) * np.linalg.norm(rays, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        facing = np.abs((normal * rays).sum(axis=-1)) / lengths
    low, high = greys
    # Along an outline there is no gradient: it is turned sideways.
    grey = low + (high - low) * np.nan_to_num(facing, nan=0.0)
    empty = np.isnan(depth)[..., None]
    return np.asarray(np.where(empty, ground, grey[..., None]), dtype=np.uint8)
