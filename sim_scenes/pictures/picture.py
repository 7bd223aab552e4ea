"""Training pictures for networks that look at images: drawn in groups, from one set of things.

Loading meshes and painting textures takes as long as rendering, so a group of `GROUP` pictures
shares them: each picture chooses among the group's objects, distractors and surfaces anew, and has
a layout, a light, tints and a camera of its own. A group is a pure function of the mesh set, the
seed and the group's number, whatever was drawn before it.

Blur and colour noise are left to the training, which draws them anew in every epoch.
"""

from __future__ import annotations

import colorsys
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from sim_scenes.camera import Intrinsics, d435_intrinsics
from sim_scenes.errors import SceneError
from sim_scenes.objects.manifest import CATEGORIES
from sim_scenes.pictures.distractors import distractor
from sim_scenes.pictures.hand import Hand
from sim_scenes.pictures.layout import (
    Counts,
    Layout,
    draw_counts,
    draw_layout,
    table_fills,
)
from sim_scenes.pictures.stage import WHITE, Stage, Thing, Tint, shape_of
from sim_scenes.pictures.surfaces import floor_surface, object_surface, table_surface
from sim_scenes.render import Light, render
from sim_scenes.sensor import DepthNoise, raw_from_metres
from sim_scenes.streams import stream

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_scenes.geometry import Floats
    from sim_scenes.objects import ObjectModel, ObjectSet
    from sim_scenes.render import Numbered, Picture as Rendered

GROUP = 10
MOST_OBJECTS = 16
"""Places of `TrainingPicture.classes`."""

STEP = 2
"""Every second pixel of the simulated camera is kept, along both axes."""

# What a group has to choose from.
LOADED = 9
LOADED_DISTRACTORS = 5
SURFACES = 14
TABLES = 4
FLOORS = 3
SCALE = (0.9, 1.1)
# Groups of few categories, so that like stands beside like, and their share.
FEW_CATEGORIES = 0.15
# The hand: in half the pictures of this share of the groups, unless it hides more than this.
HAND_GROUPS = 0.32
HAND_PICTURES = 0.5
HAND_HIDES = 0.2
HAND_TRIES = 4
TINTED = 0.3
LAYOUT_TRIES = 50

# As the sensor is at 640 px: noise and quantum of the disparity are lengths on the sensor, so at
# half the pixels they are half as many of them, and sigma(z) = z^2 s / (f B) stays what it is. A
# pixel lies beside an edge twice as often when pixels are twice as large.
_FULL = DepthNoise()
DEPTH_NOISE = replace(
    _FULL,
    subpixel_px=_FULL.subpixel_px / STEP,
    disparity_step_px=_FULL.disparity_step_px / STEP,
    edge_loss=_FULL.edge_loss / STEP,
)


@dataclass(frozen=True, eq=False)
class TrainingPicture:
    """What the camera shows, and the truth.

    Attributes
    ----------
    rgb : (h, w, 3) uint8
    depth : (h, w) uint16
        In 0.1 mm; 0 where nothing was measured.
    instances : (h, w) uint8
        0 for the room, distractors and the hand; k for the k-th object.
    classes : (16,) uint8
        Class of the k-th object at place k - 1, from 1 in the order of NOCS; 0 = no such object.
        Objects of which no pixel shows are left out.
    """

    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.uint16]
    instances: npt.NDArray[np.uint8]
    classes: npt.NDArray[np.uint8]


def picture_intrinsics() -> Intrinsics:
    """Camera of the pictures: every second pixel of 640 x 480, the first included."""
    full = d435_intrinsics(width=640, height=480)
    return Intrinsics(
        full.width // STEP,
        full.height // STEP,
        full.fx / STEP,
        full.fy / STEP,
        full.cx / STEP,
        full.cy / STEP,
    )


def draw_group(objects: ObjectSet, seed: int, group: int) -> list[TrainingPicture]:
    """Draw the pictures of a group: a pure function of its arguments.

    Parameters
    ----------
    objects
        The models to draw from; each category that it has is as likely.
    seed
        Which pictures.
    group
        Number of the group: pictures `GROUP * group` and on.

    Raises
    ------
    ObjectError
        A mesh that cannot be used.
    SceneError
        Things always stand too near to the lens.
    SimulatorMissing
        If PyBullet is not installed.
    """
    return _Group(objects, seed, group).draw()


class _Group:
    """The things of a group, loaded as they are needed."""

    def __init__(self, objects: ObjectSet, seed: int, group: int) -> None:
        self._seed, self._name = seed, f"pictures/{group}"
        self._counts = [draw_counts(self._random(f"counts/{k}")) for k in range(GROUP)]
        self._stage = Stage()
        models = _choose(objects, self._random("objects"))
        scales = self._random("scales").uniform(*SCALE, size=len(models))
        self._categories = [model.category for model in models]
        self._objects = [
            self._stage.load(shape_of(model, scale=float(scale)))
            for model, scale in zip(models, scales, strict=True)
        ]
        most = max(counts.distractors for counts in self._counts)
        random = self._random("distractors")
        self._distractors = [
            self._stage.load(distractor(random)) for _ in range(LOADED_DISTRACTORS if most else 0)
        ]
        random = self._random("surfaces")
        load = self._stage.load_texture
        self._surfaces = [load(object_surface(random)) for _ in range(SURFACES)]
        self._tables = [load(table_surface(random)) for _ in range(TABLES)]
        self._floors = [load(floor_surface(random)) for _ in range(FLOORS)]
        self._hand: Hand | None = None
        if self._random("hand").uniform() < HAND_GROUPS:
            self._hand = Hand(self._stage.world)

    def _random(self, purpose: str) -> np.random.Generator:
        return stream(self._seed, f"{self._name}/{purpose}")

    def draw(self) -> list[TrainingPicture]:
        return [self._picture(k, counts) for k, counts in enumerate(self._counts)]

    def _picture(self, number: int, counts: Counts) -> TrainingPicture:
        intrinsics = picture_intrinsics()
        layout = self._layout(counts, intrinsics, self._random(f"layout/{number}"))
        bodies = self._dress(layout, self._random(f"look/{number}"))
        light = draw_light(self._random(f"light/{number}"))
        camera = layout.world_from_camera
        picture = self._render(bodies, camera, light, self._random(f"hand/{number}"))
        depth_m = DEPTH_NOISE.apply(
            picture.depth_m, intrinsics=intrinsics, random=self._random(f"depth noise/{number}")
        )
        categories = [self._categories[item.thing] for item in layout.objects]
        instances, classes = number_shown(picture.instance_ids, categories)
        return TrainingPicture(
            rgb=_fill_void(picture, self._random(f"void/{number}")),
            depth=raw_from_metres(depth_m, unit_m=DEPTH_NOISE.depth_unit_m),
            instances=instances,
            classes=classes,
        )

    def _layout(
        self, counts: Counts, intrinsics: Intrinsics, random: np.random.Generator
    ) -> Layout:
        for _ in range(LAYOUT_TRIES):
            layout = draw_layout(
                counts,
                objects=[thing.footprint for thing in self._objects],
                distractors=[thing.footprint for thing in self._distractors],
                intrinsics=intrinsics,
                random=random,
            )
            if layout is not None:
                return layout
        raise SceneError(
            f"{self._name} of seed {self._seed}: in {LAYOUT_TRIES} draws a thing always stands too "
            "near to the lens; take the largest meshes out of the folder, or use another seed"
        )

    def _dress(self, layout: Layout, random: np.random.Generator) -> list[Thing]:
        """Show what stands on the table, hide the rest; give back the objects' bodies."""
        stage = self._stage
        for thing in (*self._objects, *self._distractors):
            stage.hide(thing.number)
        surfaces = random.permutation(self._surfaces)
        shown = [
            *((self._objects, item) for item in layout.objects),
            *((self._distractors, item) for item in layout.distractors),
        ]
        for surface, (things, item) in zip(np.resize(surfaces, len(shown)), shown, strict=True):
            stage.show(
                things[item.thing].number,
                item.world_from_thing,
                texture=int(surface),
                tint=_tint(random),
            )
        world = stage.world
        world.wrap(world.table, int(random.choice(self._tables)), tint=_tint(random))
        floor, tint = int(random.choice(self._floors)), _tint(random)
        if table_fills(layout.world_from_camera, picture_intrinsics()):
            # Hidden, it would still take a fifth of the time.
            stage.hide(world.floor)
        else:
            world.wrap(world.floor, floor, tint=tint)
        return [self._objects[item.thing] for item in layout.objects]

    def _render(
        self,
        bodies: Sequence[Thing],
        world_from_camera: Floats,
        light: Light,
        random: np.random.Generator,
    ) -> Rendered:
        """Render, with the hand in view where it is drawn; it gets the numbers after the bodies."""

        def take(shown: Sequence[Numbered]) -> Rendered:
            return render(
                self._stage.world,
                bodies=shown,
                world_from_camera=world_from_camera,
                intrinsics=picture_intrinsics(),
                light=light,
            )

        if self._hand is not None and random.uniform() < HAND_PICTURES:
            for _ in range(HAND_TRIES):
                self._hand.mount(world_from_camera=world_from_camera, random=random)
                picture = take([*bodies, *self._hand.parts])
                hidden = float((picture.instance_ids > len(bodies)).mean())
                if 0 < hidden <= HAND_HIDES:
                    self._hand.hide()
                    return picture
            self._hand.hide()
        return take(bodies)


def _choose(objects: ObjectSet, random: np.random.Generator) -> list[ObjectModel]:
    """Draw the models of a group, each category as likely."""
    present = [category for category in CATEGORIES if objects.of(category)]
    if random.uniform() < FEW_CATEGORIES:
        present = [present[int(i)] for i in random.permutation(len(present))[:2]]
    chosen = []
    for _ in range(LOADED):
        models = objects.of(present[int(random.integers(len(present)))])
        chosen.append(models[int(random.integers(len(models)))])
    return chosen


def number_shown(
    instance_ids: npt.NDArray[np.uint16], categories: Sequence[str]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Count up the objects of which a pixel shows, from 1 on, without gaps.

    Parameters
    ----------
    instance_ids : (h, w)
        k at the pixels of the k-th object; those beyond the categories become background.
    categories
        Of the objects, from the first.

    Returns
    -------
    instances : (h, w) uint8
    classes : (16,) uint8
    """
    numbers = np.zeros(int(instance_ids.max()) + 1, dtype=np.uint8)
    classes = np.zeros(MOST_OBJECTS, dtype=np.uint8)
    shown = [int(k) for k in np.unique(instance_ids) if 0 < k <= len(categories)]
    for place, k in enumerate(shown):
        numbers[k] = place + 1
        classes[place] = CATEGORIES.index(categories[k - 1]) + 1
    return numbers[instance_ids], classes


def draw_light(random: np.random.Generator) -> Light:
    """Draw a light: the benchmark's, or one from dark to glaring, also of strong colour."""
    if random.uniform() < 0.6:
        return Light.draw(random)
    bearing = random.uniform(-math.pi, math.pi)
    height = math.radians(random.uniform(8, 88))
    ambient = random.uniform(0.15, 0.9)
    red, green, blue = colorsys.hsv_to_rgb(random.uniform(), random.uniform(0.0, 0.35), 1.0)
    return Light(
        direction=(
            math.cos(height) * math.cos(bearing),
            math.cos(height) * math.sin(bearing),
            math.sin(height),
        ),
        colour=(red, green, blue),
        ambient=ambient,
        diffuse=max(0.0, random.uniform(0.35, 1.5) - ambient),
        specular=random.uniform(0.0, 0.7),
    )


def _tint(random: np.random.Generator) -> Tint:
    drawn = random.uniform(0.55, 1.0, size=3)
    if random.uniform() >= TINTED:
        return WHITE
    return float(drawn[0]), float(drawn[1]), float(drawn[2])


def _fill_void(picture: Rendered, random: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Give what lies beyond the floor a colour, or one above another, in place of white."""
    ends = random.uniform(0, 255, size=(2, 3))
    if random.uniform() < 0.4:
        return picture.rgb
    weight = np.linspace(0, random.integers(2), len(picture.rgb))[:, None, None]
    wall = np.round(ends[0] + weight * (ends[1] - ends[0])).astype(np.uint8)
    return np.where(np.isnan(picture.depth_m)[..., None], wall, picture.rgb)
