"""The wrist camera: an Intel RealSense D435 on the Panda's hand.

Pixels: (u, v) = (column, row), the centre of the first pixel is (0, 0): u = fx x/z + cx.
Depth is aligned to colour, so a frame has one camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim_scenes.geometry import Floats, inverse, rigid

# Colour stream, 1920 x 1080: horizontal field of view 69.4 degrees (D400 series datasheet). At 4:3
# the device crops the sides, which leaves 54.9 degrees and f = 616 px at 640 x 480, as such cameras
# report. Half a pixel is then 0.4 mm at 0.5 m.
COLOUR_HFOV_DEG = 69.4
COLOUR_SENSOR_PX = (1920, 1080)

# Pose of the camera in the link `panda_hand` (z along the fingers, y the way they open): 6.5 cm in
# front of the hand and 3.5 cm along it, looking along the fingers, the image's rows running forward
# (+x). Turned the other way up, the arm holds the image upright on half as many view directions.
# The fingers, 6.5 cm aside and at most 7 cm ahead, stay outside the field of view.
HAND_FROM_CAMERA: Floats = rigid(
    rotation=[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], translation=[0.065, 0.0, 0.035]
)
# Half extents of the housing about the lens, metres, in camera axes (90 x 25 x 25 mm).
HOUSING_HALF_M = (0.045, 0.0125, 0.0125)

# Range of the renderer's depth buffer, metres. At 0.5 m a float32 step of the buffer is under 1 um.
NEAR_M, FAR_M = 0.05, 5.0


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion; focal lengths and principal point in pixels."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def project(self, points_camera: Floats) -> Floats:
        """Pixels (n, 2) as (u, v) of points (n, 3) in camera axes, metres, all with z > 0."""
        x, y, z = points_camera.T
        return np.column_stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy])

    def ray_slopes(self) -> tuple[Floats, Floats]:
        """Slopes x (1, w) and y (h, 1) of the rays (x, y, 1) through the pixel centres."""
        x: Floats = (np.arange(self.width, dtype=np.float64) - self.cx) / self.fx
        y: Floats = (np.arange(self.height, dtype=np.float64) - self.cy) / self.fy
        return x[None, :], y[:, None]


def d435_intrinsics(*, width: int, height: int) -> Intrinsics:
    """Colour intrinsics of the D435 at an image size: the sensor's largest crop of that shape."""
    sensor_width, sensor_height = COLOUR_SENSOR_PX
    sensor_focal_px = sensor_width / 2 / math.tan(math.radians(COLOUR_HFOV_DEG / 2))
    focal_px = sensor_focal_px * max(width / sensor_width, height / sensor_height)
    return Intrinsics(width, height, focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)


def projection_matrix(intrinsics: Intrinsics) -> list[float]:
    """OpenGL projection, column-major (16), under which TinyRenderer samples pixel centres.

    TinyRenderer samples a pixel at its left edge and, as it flips the image last, at its lower
    edge: (u, v) of its image, whose corner is (0, 0), is sampled at (u, v + 1). The frustum is
    therefore moved so that those points are our pixel centres.
    """
    left = -intrinsics.cx / intrinsics.fx
    right = (intrinsics.width - intrinsics.cx) / intrinsics.fx
    top = (intrinsics.cy + 1) / intrinsics.fy
    bottom = -(intrinsics.height - 1 - intrinsics.cy) / intrinsics.fy
    depth = FAR_M - NEAR_M
    columns = [
        [2 / (right - left), 0.0, 0.0, 0.0],
        [0.0, 2 / (top - bottom), 0.0, 0.0],
        [
            (right + left) / (right - left),
            (top + bottom) / (top - bottom),
            -(FAR_M + NEAR_M) / depth,
            -1.0,
        ],
        [0.0, 0.0, -2 * FAR_M * NEAR_M / depth, 0.0],
    ]
    return [value for column in columns for value in column]


def view_matrix(world_from_camera: Floats) -> list[float]:
    """OpenGL view matrix, column-major (16): its camera looks along -z with y up."""
    opengl_from_opencv = np.diag([1.0, -1.0, -1.0, 1.0])
    view: list[float] = (opengl_from_opencv @ inverse(world_from_camera)).T.reshape(-1).tolist()
    return view


def depth_from_buffer(buffer: np.ndarray) -> np.ndarray:
    """Depth along the optical axis, float32 metres, of the depth buffer (h, w) in [0, 1].

    NaN where nothing was hit. Inverts buffer = far (z - near) / (z (far - near)).
    """
    depth_m = FAR_M * NEAR_M / (FAR_M - (FAR_M - NEAR_M) * buffer.astype(np.float64))
    return np.where(buffer < 1.0, depth_m, np.nan).astype(np.float32)
