"""Procedural surfaces: pictures that a seed draws, for objects, table and floor."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from sim_scenes.geometry import Floats

Picture: TypeAlias = npt.NDArray[np.uint8]
# A pattern maps texture coordinates u, v (n, n) in [0, 1) to a blend weight (n, n) in [0, 1].
Pattern: TypeAlias = Callable[[Floats, Floats, np.random.Generator], Floats]

SIDE_PX = 256


def plain(u: Floats, v: Floats, _: np.random.Generator) -> Floats:
    """One colour."""
    return np.zeros(np.broadcast_shapes(u.shape, v.shape))


def stripes(u: Floats, v: Floats, random: np.random.Generator) -> Floats:
    """Bands along u, along v, or aslant; whole turns, so that the seam closes."""
    turns_u, turns_v = random.integers(0, 9, size=2)
    turns_v += turns_u == turns_v == 0
    bands: Floats = (turns_u * u + turns_v * v) % 1.0
    return (bands < random.uniform(0.2, 0.7)).astype(np.float64)


def checks(u: Floats, v: Floats, random: np.random.Generator) -> Floats:
    """Chequerboard."""
    across, up = 2 * random.integers(2, 9, size=2)
    fields: Floats = (np.floor(across * u) + np.floor(up * v)) % 2.0
    return fields


def dots(u: Floats, v: Floats, random: np.random.Generator) -> Floats:
    """Discs on a grid, every other row shifted by half."""
    count = int(random.integers(4, 11))
    row = np.floor(count * v)
    x = (count * u + 0.5 * (row % 2)) % 1.0 - 0.5
    y = (count * v) % 1.0 - 0.5
    return (np.hypot(x, y) < random.uniform(0.15, 0.4)).astype(np.float64)


def clouds(u: Floats, v: Floats, random: np.random.Generator) -> Floats:
    """Smooth noise: random waves of whole turns."""
    total = np.zeros(np.broadcast_shapes(u.shape, v.shape))
    for _ in range(12):
        turns_u, turns_v = random.integers(-6, 7, size=2)
        phase = random.uniform(0, 2 * np.pi)
        total += np.cos(2 * np.pi * (turns_u * u + turns_v * v) + phase)
    return np.clip(0.5 + total / 10, 0, 1)


def grain(u: Floats, v: Floats, random: np.random.Generator) -> Floats:
    """Wood: wavering lines along u."""
    rings = random.integers(6, 20)
    waver = 0.05 * np.sin(2 * np.pi * (u * random.integers(1, 4) + random.uniform(0, 1)))
    lines = 0.5 + 0.5 * np.sin(2 * np.pi * rings * (v + waver))
    return 0.6 * lines + 0.4 * random.random((lines.shape[0], 1))


OBJECT_PATTERNS: tuple[Pattern, ...] = (plain, stripes, checks, dots, clouds)
TABLE_PATTERNS: tuple[Pattern, ...] = (plain, grain, clouds)
FLOOR_PATTERNS: tuple[Pattern, ...] = (plain, checks, clouds)


def colour(
    random: np.random.Generator, *, saturation: tuple[float, float], value: tuple[float, float]
) -> Floats:
    """Draw a colour (3,) in [0, 1]: any hue, saturation and value in these ranges."""
    return np.array(
        colorsys.hsv_to_rgb(random.uniform(), random.uniform(*saturation), random.uniform(*value))
    )


def uniform(colour: Floats) -> Picture:
    """Picture of a single colour (3,) in [0, 1]."""
    return np.tile(np.round(255 * colour).astype(np.uint8), (4, 4, 1))


def paint(
    random: np.random.Generator,
    patterns: tuple[Pattern, ...],
    *,
    saturation: tuple[float, float] = (0.0, 0.9),
    value: tuple[float, float] = (0.25, 1.0),
    contrast: float = 1.0,
) -> Picture:
    """Draw a picture (256, 256, 3): a pattern that blends two colours, under fine noise.

    Parameters
    ----------
    random
        Stream to draw from.
    patterns
        To choose among, evenly.
    saturation, value
        Ranges of both colours.
    contrast
        Share of the way from the first colour to the second where the pattern is 1.
    """
    pattern = patterns[int(random.integers(len(patterns)))]
    ground = colour(random, saturation=saturation, value=value)
    figure = colour(random, saturation=saturation, value=value)
    axis = np.arange(SIDE_PX) / SIDE_PX
    weight = contrast * pattern(axis[None, :], axis[:, None], random)[..., None]
    picture = ground + (figure - ground) * weight
    picture += 0.015 * random.standard_normal((SIDE_PX, SIDE_PX, 1))
    return np.round(255 * np.clip(picture, 0, 1)).astype(np.uint8)
