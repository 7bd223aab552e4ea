"""What stands where on the table, and where it is seen from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.geometry import Floats, look_at, rigid, turn
from sim_scenes.placement import TARGET_BEARING_RAD, TARGET_RADIUS_M
from sim_scenes.spec import Arc, SceneSpec
from sim_scenes.views import FARTHER, FLAT
from sim_scenes.world import TABLE_CENTRE_M, TABLE_HALF_M

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_scenes.camera import Intrinsics

# Shares of pictures.
EMPTY = 0.03
SINGLE = 0.4
DISTRACTED = 0.4
DISTRACTED_WHEN_EMPTY = 0.7
OBJECTS = (2, 6)
DISTRACTORS = (1, 5)

# As in the benchmark; elsewhere on the table, so that its edge and the floor are seen; and how far
# from the edge a circle's middle stays.
AS_BENCHMARK = 0.7
FROM_EDGE_M = 0.06
GAP_M = (0.002, 0.06)
TRIES = 20
# A distractor stands before the first object this often, within this angle of its line of sight.
BEFORE = 0.5
BEFORE_RAD = math.radians(40)

# The benchmark's arcs, one that is wider than the robot's reach, and looks from very near, from
# far away and from low down, with their shares.
WIDE = Arc(elevation_deg=(20.0, 70.0), distance_m=(0.3, 0.7))
NEAR = Arc(elevation_deg=(25.0, 70.0), distance_m=(0.22, 0.32))
FAR = Arc(elevation_deg=(20.0, 65.0), distance_m=(0.7, 1.0))
LOW = Arc(elevation_deg=(7.0, 20.0), distance_m=(0.35, 0.8))
ARCS = ((WIDE, 0.3), (NEAR, 0.03), (FAR, 0.05), (LOW, 0.03))
# The camera looks beside the first object this often, at most this far; and a few look far beside.
ASIDE = 0.6
ASIDE_M = 0.12
FAR_ASIDE = 0.15
FAR_ASIDE_M = 0.22
ROLLED = 0.3
ROLL_RAD = math.radians(4)
# Nothing comes nearer to the lens: the renderer drops what crosses its near plane.
CLEARANCE_M = 0.09


@dataclass(frozen=True)
class Footprint:
    """The upright cylinder that holds a thing, metres."""

    radius_m: float
    height_m: float


@dataclass(frozen=True)
class Standing:
    """A thing on the table: which one, where (x, y), and how it is turned about the vertical."""

    thing: int
    place_m: tuple[float, float]
    yaw_rad: float

    @property
    def world_from_thing(self) -> Floats:
        """Pose (4, 4)."""
        return rigid(rotation=turn(2, self.yaw_rad), translation=[*self.place_m, 0.0])


@dataclass(frozen=True, eq=False)
class Layout:
    """One picture's geometry.

    Attributes
    ----------
    objects, distractors
        What stands on the table; `thing` counts the group's objects, and its distractors.
    world_from_camera : (4, 4) float64
    """

    objects: tuple[Standing, ...]
    distractors: tuple[Standing, ...]
    world_from_camera: Floats


@dataclass(frozen=True)
class Counts:
    """How many objects and distractors a picture gets, where there is room."""

    objects: int
    distractors: int


def draw_counts(random: np.random.Generator) -> Counts:
    """Draw what a picture shows: nothing, a single object, or clutter; with distractors or not."""
    kind = random.uniform()
    clutter = int(random.integers(OBJECTS[0], OBJECTS[1] + 1))
    objects = 0 if kind < EMPTY else 1 if kind < EMPTY + SINGLE else clutter
    distracted = random.uniform() < (DISTRACTED if objects else DISTRACTED_WHEN_EMPTY)
    some = int(random.integers(DISTRACTORS[0], DISTRACTORS[1] + 1))
    return Counts(objects, some if distracted else 0)


def draw_layout(
    counts: Counts,
    *,
    objects: Sequence[Footprint],
    distractors: Sequence[Footprint],
    intrinsics: Intrinsics,
    random: np.random.Generator,
) -> Layout | None:
    """Draw where things stand and where the camera does.

    Parameters
    ----------
    counts
        What the picture shows.
    objects, distractors
        The things there are to choose from, each at most once.
    intrinsics
        The camera's.
    random
        Stream to draw from.

    Returns
    -------
    Layout or None
        None where the lens would stand in or right before a thing.
    """
    table = _Table(random)
    azimuth_rad = random.uniform(-math.pi, math.pi)
    chosen = random.permutation(len(objects))[: counts.objects]
    placed = [table.add(int(thing), objects[thing]) for thing in chosen]
    chosen = random.permutation(len(distractors))[: counts.distractors]
    distracting = [
        table.add(int(thing), distractors[thing], before_rad=azimuth_rad) for thing in chosen
    ]
    target = objects[placed[0].thing] if placed and placed[0] else Footprint(0.08, 0.1)
    camera = _camera(
        _arc(len(placed), random),
        aim_m=np.array([*table.middle_m, target.height_m / 2]),
        radius_m=math.hypot(target.radius_m, target.height_m / 2),
        azimuth_rad=azimuth_rad,
        intrinsics=intrinsics,
        random=random,
    )
    if not table.clear_of(camera[:3, 3]):
        return None
    return Layout(
        objects=tuple(item for item in placed if item is not None),
        distractors=tuple(item for item in distracting if item is not None),
        world_from_camera=camera,
    )


def table_fills(world_from_camera: Floats, intrinsics: Intrinsics) -> bool:
    """Whether every ray of an image ends at the table's top, or at what stands on it."""
    # The rays through the image's corners enclose all others, and the top is convex.
    right, bottom = intrinsics.width, intrinsics.height
    u, v = np.array([[-1, right, right, -1], [-1, -1, bottom, bottom]], dtype=np.float64)
    rays = np.stack([(u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy])
    rays_world = np.column_stack([*rays, np.ones(4)]) @ world_from_camera[:3, :3].T
    eye = world_from_camera[:3, 3]
    if (rays_world[:, 2] >= 0).any():
        return False
    hits = eye[:2] - rays_world[:, :2] * (eye[2] / rays_world[:, 2:])
    return bool((np.abs(hits - TABLE_CENTRE_M[:2]) < TABLE_HALF_M[:2]).all())


class _Table:
    """Circles on the table that stay apart."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._circles: list[tuple[Floats, Footprint]] = []
        low, high = _limits_m()
        if random.uniform() < AS_BENCHMARK:
            radius, bearing = (
                random.uniform(*limits) for limits in (TARGET_RADIUS_M, TARGET_BEARING_RAD)
            )
            self.middle_m = np.array([radius * math.cos(bearing), radius * math.sin(bearing)])
        else:
            self.middle_m = random.uniform(low, high)

    def add(
        self, thing: int, footprint: Footprint, *, before_rad: float | None = None
    ) -> Standing | None:
        """Find room for a thing; the first one stands in the middle."""
        random = self._random
        yaw_rad = random.uniform(-math.pi, math.pi)
        for _ in range(TRIES):
            place = self.middle_m
            if self._circles:
                before = before_rad is not None and random.uniform() < BEFORE
                anchor = 0 if before else int(random.integers(len(self._circles)))
                bearing = random.uniform(-math.pi, math.pi)
                if before and before_rad is not None:
                    bearing = before_rad + random.uniform(-BEFORE_RAD, BEFORE_RAD)
                middle, other = self._circles[anchor]
                reach_m = other.radius_m + footprint.radius_m + random.uniform(*GAP_M)
                place = middle + reach_m * np.array([math.cos(bearing), math.sin(bearing)])
            if self._has_room(place, footprint):
                self._circles.append((place, footprint))
                return Standing(thing, (float(place[0]), float(place[1])), yaw_rad)
        return None

    def _has_room(self, place: Floats, footprint: Footprint) -> bool:
        low, high = _limits_m()
        if (place < low).any() or (place > high).any():
            return False
        return all(
            math.hypot(*(place - middle)) >= footprint.radius_m + other.radius_m
            for middle, other in self._circles
        )

    def clear_of(self, eye: Floats) -> bool:
        """Whether a lens at `eye` (3,) keeps clear of all things and of the table."""
        return bool(eye[2] > CLEARANCE_M / 2) and all(
            eye[2] > footprint.height_m + CLEARANCE_M
            or math.hypot(*(eye[:2] - middle)) > footprint.radius_m + CLEARANCE_M
            for middle, footprint in self._circles
        )


def _limits_m() -> tuple[Floats, Floats]:
    """Least and greatest x and y of a thing's middle."""
    middle, half = np.array(TABLE_CENTRE_M[:2]), np.array(TABLE_HALF_M[:2])
    return middle - half + FROM_EDGE_M, middle + half - FROM_EDGE_M


def _arc(objects: int, random: np.random.Generator) -> Arc:
    at = random.uniform()
    for arc, share in ARCS:
        if at < share:
            return arc
        at -= share
    return SceneSpec.clutter("mug").arc if objects > 1 else Arc()


def _camera(
    arc: Arc,
    *,
    aim_m: Floats,
    radius_m: float,
    azimuth_rad: float,
    intrinsics: Intrinsics,
    random: np.random.Generator,
) -> Floats:
    """Draw a camera's pose (4, 4); the range of distances grows as in `sim_scenes.views`."""
    half_view = math.atan(intrinsics.height / 2 / intrinsics.fy)
    near_m = arc.distance_m[0]
    if arc is not NEAR:
        near_m = max(near_m, FLAT * radius_m / math.sin(half_view))
    far_m = max(arc.distance_m[1], FARTHER * near_m)
    elevation = math.radians(random.uniform(*arc.elevation_deg))
    direction = np.array(
        [
            math.cos(elevation) * math.cos(azimuth_rad),
            math.cos(elevation) * math.sin(azimuth_rad),
            math.sin(elevation),
        ]
    )
    aside = random.uniform()
    most_m = FAR_ASIDE_M if aside < FAR_ASIDE else ASIDE_M if aside < ASIDE else 0.0
    away_m, bearing = most_m * random.uniform(), random.uniform(-math.pi, math.pi)
    aim_m = aim_m + away_m * np.array([math.cos(bearing), math.sin(bearing), 0.0])
    camera = look_at(eye=aim_m + random.uniform(near_m, far_m) * direction, target=aim_m)
    roll = random.normal(0.0, ROLL_RAD) if random.uniform() < ROLLED else 0.0
    return camera @ rigid(rotation=turn(2, roll), translation=np.zeros(3))
