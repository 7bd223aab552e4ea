"""Voxels drawn in perspective on the CPU: no display, no GPU, no system library needed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

Picture = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]

OVERSAMPLING = 2
# Share of the picture that a fitted view leaves free on each side: room for labels.
MARGIN = 0.1
BACKGROUND = (255, 255, 255)
# Corners of the face on the upper side of each axis, in units of half an edge.
FACES = np.array(
    [
        [[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]],
        [[-1, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]],
        [[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]],
    ]
)
BRIGHTNESS = np.array([0.72, 0.86, 1.0])


@dataclass(frozen=True)
class View:
    """A viewer.

    Attributes
    ----------
    eye_world, focus_world : (3,) float64
        Where the viewer stands and looks, metres.
    size : (width, height)
        Of the picture, pixels.
    focal : float
        Focal length as a share of the picture's height.
    shift : (x, y)
        Slope, to the right and down, of the ray through the picture's middle: (0, 0) looks at the
        focus, others slide the picture as a shifted lens does.
    up_world : (x, y, z)
        What is up in the picture; not the direction of view.
    """

    eye_world: Floats
    focus_world: Floats
    size: tuple[int, int] = (960, 720)
    focal: float = 1.6
    shift: tuple[float, float] = (0.0, 0.0)
    up_world: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def project(self, points_world: Floats) -> Floats:
        """Project points (..., 3) before the viewer to pixels (..., 2)."""
        width, height = self.size
        slopes = self._slopes(points_world) - self.shift
        return np.asarray(slopes * self.focal * height + np.array([width / 2, height / 2]))

    def fitted_to(self, points_world: Floats) -> View:
        """Zoom and shift so that points (n, 3) before the viewer just fill the picture's middle.

        At least `MARGIN` of the width and of the height stays free on every side.
        """
        slopes = self._slopes(points_world)
        low, high = slopes.min(axis=0), slopes.max(axis=0)
        width, height = self.size
        free = (1 - 2 * MARGIN) * np.array([width / height, 1.0])
        x, y = (low + high) / 2
        focal = float((free / np.maximum(high - low, 1e-9)).min())
        return replace(self, focal=focal, shift=(float(x), float(y)))

    def depths(self, points_world: Floats) -> Floats:
        """Depths (...) of points (..., 3) along the viewing direction, metres."""
        return np.asarray((points_world - self.eye_world) @ self._axes()[2])

    def rays(self) -> Floats:
        """Directions (height, width, 3) through the pixels' middles, of depth 1."""
        width, height = self.size
        columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        offsets = np.stack([columns - width / 2, rows - height / 2], axis=-1)
        slopes = offsets / (self.focal * height) + self.shift
        right, down, forward = self._axes()
        return np.asarray(slopes[..., :1] * right + slopes[..., 1:] * down + forward)

    def _slopes(self, points_world: Floats) -> Floats:
        """Slopes (..., 2) of the rays to points, to the right of the focus and below it."""
        local = (points_world - self.eye_world) @ self._axes().T
        return np.asarray(local[..., :2] / local[..., 2:])

    def _axes(self) -> Floats:
        """Rows (3, 3) to the right, down and forward, unit vectors of the world."""
        forward = self.focus_world - self.eye_world
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up_world)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(forward, right), forward])


def draw_cubes(centres_world: Floats, colours: Picture, *, size_m: float, view: View) -> Picture:
    """Draw the cubes of a grid, the far ones first.

    On a grid, a cube that hides another is nearer along every axis, hence nearer altogether:
    painting by falling distance is exact.

    Parameters
    ----------
    centres_world : (n, 3) float64
        Metres, on a grid of `size_m`, all before the viewer.
    colours : (n, 3) uint8
    size_m
        Edge of a cube.
    view
        Where from.

    Returns
    -------
    picture : (height, width, 3) uint8
    """
    scale = OVERSAMPLING
    large = replace(view, size=(view.size[0] * scale, view.size[1] * scale))
    image = Image.new("RGB", large.size, BACKGROUND)
    pen = ImageDraw.Draw(image)
    towards = view.eye_world - centres_world
    order = np.argsort(-np.linalg.norm(towards, axis=1), kind="stable")
    centres_world, towards, colours = centres_world[order], towards[order], colours[order]
    # Of each axis the one face that looks towards the viewer; flipping the axis mirrors the face.
    side = np.where(towards >= 0, 1.0, -1.0)
    corners = np.repeat(FACES[None].astype(float), len(centres_world), axis=0)
    for axis in range(3):
        corners[:, axis, :, axis] *= side[:, axis, None]
    pixels = large.project(centres_world[:, None, None] + corners * (size_m / 2))
    visible = np.abs(towards) > size_m / 2
    shades = (colours[:, None] * BRIGHTNESS[:, None]).astype(np.uint8)
    for cube, faces in enumerate(visible):
        for face in np.flatnonzero(faces):
            outline = [tuple(corner) for corner in pixels[cube, face].tolist()]
            pen.polygon(outline, fill=tuple(shades[cube, face].tolist()))
    return np.asarray(image.resize(view.size, Image.Resampling.BOX))
