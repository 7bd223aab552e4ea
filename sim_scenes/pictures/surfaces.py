"""Surfaces of training pictures: those of the benchmark's scenes, and wilder ones around them.

The benchmark's textures are two colours each. Real products carry printed labels, real tables
cloths: a network that shall find shapes must not take a colour or a pattern for one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from sim_scenes.textures import (
    FLOOR_PATTERNS,
    OBJECT_PATTERNS,
    SIDE_PX,
    TABLE_PATTERNS,
    Pattern,
    Picture,
    colour,
    paint,
    uniform,
)

if TYPE_CHECKING:
    from sim_scenes.geometry import Floats

ALL_PATTERNS = tuple(dict.fromkeys(OBJECT_PATTERNS + TABLE_PATTERNS + FLOOR_PATTERNS))
ANY = (0.0, 1.0)
# What is printed on a label, each as likely.
PRINTS = ("rectangle", "disc", "band", "text")
MOST_PRINTS = 12
MOST_WORDS = 9


def object_surface(random: np.random.Generator) -> Picture:
    """Draw an object's surface (h, w, 3): as the benchmark's, grey, of one colour, or printed."""
    kind = random.uniform()
    if kind < 0.45:
        return paint(random, OBJECT_PATTERNS)
    if kind < 0.6:
        return _grey(random)
    if kind < 0.7:
        return uniform(colour(random, saturation=ANY, value=ANY))
    return collage(random)


def table_surface(random: np.random.Generator) -> Picture:
    """Draw a table's surface (h, w, 3): as the benchmark's, glaring, grey, or printed."""
    return _ground(random, TABLE_PATTERNS, saturation=(0.0, 0.6), value=(0.3, 0.9), contrast=0.4)


def floor_surface(random: np.random.Generator) -> Picture:
    """Draw a floor's surface (h, w, 3)."""
    return _ground(random, FLOOR_PATTERNS, saturation=(0.0, 0.4), value=(0.3, 0.8), contrast=0.5)


def _ground(
    random: np.random.Generator,
    patterns: tuple[Pattern, ...],
    *,
    saturation: tuple[float, float],
    value: tuple[float, float],
    contrast: float,
) -> Picture:
    kind = random.uniform()
    if kind < 0.55:  # `sim_scenes.look` draws these.
        return paint(random, patterns, saturation=saturation, value=value, contrast=contrast)
    if kind < 0.75:
        return paint(
            random, ALL_PATTERNS, saturation=ANY, value=(0.1, 1.0), contrast=random.uniform()
        )
    return _grey(random) if kind < 0.87 else collage(random)


def _grey(random: np.random.Generator) -> Picture:
    return uniform(np.full(3, random.choice([random.uniform(0.05, 1), random.uniform(0.8, 1)])))


def collage(random: np.random.Generator) -> Picture:
    """Draw a printed surface (256, 256, 3): rectangles, discs, bands and lines of text.

    On one colour or a gradient, under noise.
    """
    ends = [colour(random, saturation=ANY, value=(0.1, 1.0)) for _ in range(2)]
    weight = _ramp(random) if random.uniform() < 0.4 else np.zeros((SIDE_PX, SIDE_PX, 1))
    ground = ends[0] + (ends[1] - ends[0]) * weight
    image = Image.fromarray(np.round(255 * ground).astype(np.uint8))
    pen = ImageDraw.Draw(image)
    # A label's few inks come again.
    inks = [_ink(random) for _ in range(int(random.integers(2, 6)))]
    for _ in range(int(random.integers(2, MOST_PRINTS + 1))):
        _print(pen, inks[int(random.integers(len(inks)))], random)
    noise = random.uniform(0, 0.06) * random.standard_normal((SIDE_PX, SIDE_PX, 1))
    picture = np.asarray(image) / 255 + noise
    return np.round(255 * np.clip(picture, 0, 1)).astype(np.uint8)


def _ramp(random: np.random.Generator) -> Floats:
    axis = np.linspace(0, 1, SIDE_PX)
    across, up = random.uniform(-1, 1, size=2)
    ramp = across * axis[None, :] + up * axis[:, None]
    scaled: Floats = ((ramp - ramp.min()) / (np.ptp(ramp) + 1e-9))[..., None]
    return scaled


def _ink(random: np.random.Generator) -> tuple[int, int, int]:
    red, green, blue = np.round(255 * colour(random, saturation=ANY, value=ANY)).astype(int)
    return int(red), int(green), int(blue)


def _print(
    pen: ImageDraw.ImageDraw, ink: tuple[int, int, int], random: np.random.Generator
) -> None:
    kind = PRINTS[int(random.integers(len(PRINTS)))]
    left, top = random.uniform(-0.2, 0.9, size=2) * SIDE_PX
    width, height = random.uniform(0.05, 0.6, size=2) * SIDE_PX
    if kind == "rectangle":
        pen.rectangle((left, top, left + width, top + height), fill=ink)
    elif kind == "disc":
        pen.ellipse((left, top, left + width, top + height), fill=ink)
    elif kind == "band":
        if random.uniform() < 0.5:
            pen.rectangle((0, top, SIDE_PX, top + height / 3), fill=ink)
        else:
            pen.rectangle((left, 0, left + width / 3, SIDE_PX), fill=ink)
    else:
        _text(pen, ink, random, corner=(left, top))


def _text(
    pen: ImageDraw.ImageDraw,
    ink: tuple[int, int, int],
    random: np.random.Generator,
    *,
    corner: tuple[float, float],
) -> None:
    """Print lines of bars, each about as long as a word."""
    left, top = corner
    size = random.uniform(3, 18)
    for line in range(int(random.integers(1, 7))):
        x = left
        y = top + 1.7 * size * line
        for _ in range(int(random.integers(1, MOST_WORDS))):
            word = size * random.uniform(0.6, 4)
            pen.rectangle((x, y, x + word, y + size), fill=ink)
            x += word + 0.6 * size
