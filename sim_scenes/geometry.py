"""Rigid transforms as 4x4 row-major float64 matrices, named `target_from_source`."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]


def rigid(*, rotation: npt.ArrayLike, translation: npt.ArrayLike) -> Floats:
    """Stack a rotation (3, 3) and a translation (3,) in metres into a (4, 4) matrix."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def inverse(matrix: Floats) -> Floats:
    """Invert a rigid (4, 4) matrix by its transpose, which keeps it orthonormal."""
    rotation = matrix[:3, :3].T
    return rigid(rotation=rotation, translation=-rotation @ matrix[:3, 3])


def apply(matrix: Floats, points: Floats) -> Floats:
    """Transform points (n, 3) by a (4, 4) matrix."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def turn(axis: int, angle_rad: float) -> Floats:
    """Rotation (3, 3) about a coordinate axis: 0 for x, 1 for y, 2 for z."""
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = math.cos(angle_rad)
    matrix[j, i] = math.sin(angle_rad)
    matrix[i, j] = -matrix[j, i]
    return matrix


def rotation_from_quaternion(quaternion: npt.ArrayLike) -> Floats:
    """Rotation (3, 3) of a quaternion (x, y, z, w), the order of PyBullet."""
    x, y, z, w = np.asarray(quaternion, dtype=np.float64) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: Floats) -> Floats:
    """Quaternion (x, y, z, w) of a rotation (3, 3), by the largest of its four components.

    Shepperd's method: dividing by the largest component never cancels.
    """
    trace = np.trace(rotation)
    squares = np.append(1 + 2 * np.diag(rotation) - trace, 1 + trace)
    i = int(np.argmax(squares))
    quaternion = np.zeros(4)
    if i == 3:
        quaternion[:3] = (
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        )
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        quaternion[j] = rotation[j, i] + rotation[i, j]
        quaternion[k] = rotation[k, i] + rotation[i, k]
        quaternion[3] = rotation[k, j] - rotation[j, k]
    quaternion[i] = squares[i]
    return quaternion / np.linalg.norm(quaternion)


def rotation_angle(rotation: Floats) -> float:
    """Angle of a rotation (3, 3), radians, accurate near zero."""
    skew = rotation - rotation.T
    sine = 0.5 * np.linalg.norm([skew[2, 1], skew[0, 2], skew[1, 0]])
    return float(np.arctan2(sine, 0.5 * (np.trace(rotation) - 1)))


def look_at(*, eye: Floats, target: Floats) -> Floats:
    """Pose (4, 4) of an upright OpenCV camera at `eye` (3,) that looks at `target` (3,).

    The image's rows run downwards in the world; the two points must not lie on one vertical.
    """
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return rigid(
        rotation=np.column_stack([right, np.cross(forward, right), forward]), translation=eye
    )
