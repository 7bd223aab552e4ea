"""Checked access to the JSON files of a dataset: every error names the file and the key."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from sim_scenes.errors import BopError
from sim_scenes.geometry import Floats, rigid

if TYPE_CHECKING:
    from pathlib import Path

# Published poses carry as few as four decimals; what is worse is no rotation.
RIGID_TOLERANCE = 1e-3
MM_PER_M = 1000.0


def read_table(path: Path) -> dict[str, Any]:
    """Read a JSON object."""
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BopError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise BopError(f"{path}: is not valid JSON ({error}); restore or re-export it") from error
    if not isinstance(table, dict):
        raise BopError(f"{path}: holds a {type(table).__name__}, not a table of entries")
    return table


def read_numbered(path: Path) -> dict[int, Any]:
    """Read a JSON object whose keys are image or object ids, in order of the ids."""
    entries = read_table(path)
    for key in entries:
        if not (key.isascii() and key.isdigit() and len(key) <= 9):
            raise BopError(f"{path}: '{key:.40}' is no id; keys are whole numbers of 1 to 9 digits")
    return {int(key): entries[key] for key in sorted(entries, key=int)}


def table_of(value: Any, *, where: str) -> dict[str, Any]:
    """Check that an entry is a table."""
    if not isinstance(value, dict):
        raise BopError(f"{where} is {_short(value)}; it must be a table")
    return value


def number(entry: dict[str, Any], key: str, *, where: str) -> float:
    """Return a finite number."""
    value = entry.get(key)
    if not _is_finite(value):
        raise BopError(f"{where}: {key} is {_short(value)}; it must be a finite number")
    return float(value)  # type: ignore[arg-type]  # _is_finite has checked it


def numbers(entry: dict[str, Any], key: str, *, count: int, where: str) -> Floats:
    """Return `count` finite numbers."""
    value = entry.get(key)
    if not (isinstance(value, list) and len(value) == count and all(map(_is_finite, value))):
        raise BopError(f"{where}: {key} is {_short(value)}; it must hold {count} finite numbers")
    return np.array(value, dtype=np.float64)


def whole(entry: dict[str, Any], key: str, *, where: str, limit: int) -> int:
    """Return a whole number from 0 up to `limit`."""
    value = entry.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= limit:
        raise BopError(
            f"{where}: {key} is {_short(value)}; it must be a whole number from 0 to {limit}"
        )
    return value


def pose_mm(entry: dict[str, Any], *, rotation: str, translation: str, where: str) -> Floats:
    """Return a pose (4, 4) in metres from BOP's rotation and millimetres."""
    matrix = numbers(entry, rotation, count=9, where=where).reshape(3, 3)
    _check_rotation(matrix, where=f"{where}: {rotation}")
    # Rounded in print; the nearest rotation is what was meant.
    left, _, right = np.linalg.svd(matrix)
    offset = numbers(entry, translation, count=3, where=where)
    return rigid(rotation=left @ right, translation=offset / MM_PER_M)


def pose_exact(entry: dict[str, Any], key: str, *, where: str) -> Floats:
    """Return a pose (4, 4) of 16 numbers in metres, bit for bit."""
    matrix = numbers(entry, key, count=16, where=where).reshape(4, 4)
    _check_rotation(matrix[:3, :3], where=f"{where}: {key}")
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        raise BopError(f"{where}: {key} ends in {matrix[3].tolist()}; its last row is 0 0 0 1")
    return matrix


def _check_rotation(matrix: Floats, *, where: str) -> None:
    off = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if not (off <= RIGID_TOLERANCE and np.linalg.det(matrix) > 0):
        raise BopError(
            f"{where} is no rotation (R R' differs from 1 by {off:.2g}, "
            f"determinant {np.linalg.det(matrix):.3g}); poses must be rigid"
        )


def _is_finite(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _short(value: Any) -> str:
    return "missing" if value is None else f"{value!r:.60}"
