"""What a scene's surfaces and light look like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.render import Light
from sim_scenes.streams import stream
from sim_scenes.textures import (
    FLOOR_PATTERNS,
    OBJECT_PATTERNS,
    TABLE_PATTERNS,
    Picture,
    colour,
    paint,
    uniform,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_scenes.solid import Solid
    from sim_scenes.spec import Appearance
    from sim_scenes.world import Body, World

TABLE_COLOUR = np.array([0.55, 0.45, 0.35])
FLOOR_COLOUR = np.array([0.6, 0.6, 0.62])
# One per instance, when textures are off.
OBJECT_COLOURS = np.array(
    [
        [0.80, 0.30, 0.25],
        [0.25, 0.45, 0.75],
        [0.30, 0.65, 0.35],
        [0.85, 0.70, 0.25],
        [0.55, 0.35, 0.65],
        [0.30, 0.65, 0.70],
        [0.85, 0.50, 0.65],
        [0.50, 0.50, 0.45],
    ]
)


@dataclass(frozen=True, eq=False)
class Look:
    """Light, and surfaces, each a picture (h, w, 3) uint8."""

    light: Light
    table: Picture
    floor: Picture
    objects: tuple[Picture, ...]

    def dress(self, world: World, bodies: Sequence[Body]) -> None:
        """Cover the room and its objects."""
        numbers = [world.table, world.floor, *(body.number for body in bodies)]
        surfaces = [self.table, self.floor, *self.objects]
        for number, surface in zip(numbers, surfaces, strict=True):
            world.cover(number, surface)


def draw_look(appearance: Appearance, seed: int, solids: Sequence[Solid]) -> Look:
    """Draw a look; models that come with a picture of their own keep it."""
    light = Light.draw(stream(seed, "light")) if appearance.light else Light()
    if not appearance.textures:
        objects = tuple(uniform(OBJECT_COLOURS[index]) for index in range(len(solids)))
        return Look(light, uniform(TABLE_COLOUR), uniform(FLOOR_COLOUR), objects)
    room = stream(seed, "room texture")
    return Look(
        light,
        table=paint(room, TABLE_PATTERNS, saturation=(0.0, 0.6), value=(0.3, 0.9), contrast=0.4),
        floor=paint(room, FLOOR_PATTERNS, saturation=(0.0, 0.4), value=(0.3, 0.8), contrast=0.5),
        objects=tuple(
            _surface(solid, stream(seed, f"object texture/{index}"))
            for index, solid in enumerate(solids)
        ),
    )


def _surface(solid: Solid, random: np.random.Generator) -> Picture:
    if solid.texture is not None:
        return solid.texture
    if solid.uv is not None:
        return paint(random, OBJECT_PATTERNS)
    return uniform(colour(random, saturation=(0.0, 0.9), value=(0.3, 1.0)))
