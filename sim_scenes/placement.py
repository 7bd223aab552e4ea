"""Where objects are dropped, and how they come to rest."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.geometry import Floats, apply, rigid, rotation_angle, turn
from sim_scenes.rejected import Rejected

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_scenes.solid import Solid
    from sim_scenes.world import Body, World

# The target stands here: distance from the robot's base, and bearing from straight ahead.
TARGET_RADIUS_M = (0.42, 0.58)
TARGET_BEARING_RAD = (-0.45, 0.45)
# Other objects stand within this ring, near the target.
CROWD_RADIUS_M = (0.36, 0.68)
CROWD_BEARING_RAD = 0.7
CROWD_SPREAD_M = 0.24
CROWD_GAP_M = (0.004, 0.04)
CROWD_TRIES = 200

DROP_HEIGHT_M = (0.01, 0.03)
DROP_TILT_RAD = 0.03

# At rest is who moves less than this from one window of 0.1 s to the next, twice. Speeds tell less:
# contacts make resting hulls tremble by micrometres at up to 0.3 rad/s.
WINDOW_STEPS = 24
REST_M = 1e-4
REST_RAD = math.radians(0.15)
CALM_WINDOWS = 2
LIMIT_WINDOWS = 30
TOPPLED_RAD = math.radians(20)
ROLLED_M = 0.05
# Now and then Bullet lets a corner sink in; more than this would be seen.
SUNK_M = 3e-4
# Deeper contact between hulls than this would put one object inside another.
OVERLAP_M = 1e-3


def drop(
    world: World, solids: Sequence[Solid], random: np.random.Generator
) -> tuple[list[Body], list[Floats]]:
    """Drop objects onto the table and let them settle.

    Returns
    -------
    bodies
        In the order of `solids`.
    poses
        `world_from_object` (4, 4) of each, at rest.

    Raises
    ------
    Rejected
        If there is no room, or an object topples, rolls away, or does not come to rest.
    """
    starts = [
        _start(solid, position, random)
        for solid, position in zip(solids, _positions(solids, random), strict=True)
    ]
    bodies = [
        world.add(solid, world_from_object=start)
        for solid, start in zip(solids, starts, strict=True)
    ]
    settle(world, bodies)
    poses = [world.pose(body) for body in bodies]
    for body, start, pose in zip(bodies, starts, poses, strict=True):
        _check_at_rest(body.solid, start=start, pose=pose)
    for first, second in itertools.combinations(bodies, 2):
        if world.within(first.number, second.number, limit_m=-OVERLAP_M):
            raise Rejected(f"{first.solid.name} and {second.solid.name} overlap")
    return bodies, poses


def settle(world: World, bodies: Sequence[Body]) -> None:
    """Simulate until no object moves any more."""
    before = [world.pose(body) for body in bodies]
    calm = 0
    restless: list[str] = []
    for _ in range(LIMIT_WINDOWS):
        world.step(WINDOW_STEPS)
        after = [world.pose(body) for body in bodies]
        restless = [
            body.solid.name
            for body, old, new in zip(bodies, before, after, strict=True)
            if _moved(old, new)
        ]
        calm = 0 if restless else calm + 1
        if calm == CALM_WINDOWS:
            return
        before = after
    raise Rejected(f"{' and '.join(restless) or 'an object'} did not come to rest within 3 s")


def _moved(old: Floats, new: Floats) -> bool:
    shift_m = float(np.linalg.norm(new[:3, 3] - old[:3, 3]))
    return shift_m > REST_M or rotation_angle(old[:3, :3].T @ new[:3, :3]) > REST_RAD


def _start(solid: Solid, position: Floats, random: np.random.Generator) -> Floats:
    """Pose above the table: a random yaw, a slight tilt, the lowest point at the drop height."""
    yaw = random.uniform(-math.pi, math.pi)
    tilt = random.uniform(-DROP_TILT_RAD, DROP_TILT_RAD, size=2)
    rotation = turn(2, yaw) @ turn(0, tilt[0]) @ turn(1, tilt[1])
    middle = np.append(solid.bounds.mean(axis=0)[:2], 0.0)
    lowest = float(apply(rigid(rotation=rotation, translation=np.zeros(3)), solid.hull)[:, 2].min())
    translation = np.append(position, random.uniform(*DROP_HEIGHT_M) - lowest)
    translation[:2] -= (rotation @ middle)[:2]
    return rigid(rotation=rotation, translation=translation)


def _positions(solids: Sequence[Solid], random: np.random.Generator) -> list[Floats]:
    """Places (2,) on the table, whose objects' footprints stand clear of each other."""
    radii = [_footprint(solid) for solid in solids]
    places = [_polar(random.uniform(*TARGET_RADIUS_M), random.uniform(*TARGET_BEARING_RAD))]
    for index in range(1, len(solids)):
        for _ in range(CROWD_TRIES):
            anchor = int(random.integers(index))
            reach = radii[index] + radii[anchor] + random.uniform(*CROWD_GAP_M)
            place = places[anchor] + _polar(reach, random.uniform(-math.pi, math.pi))
            if _fits(place, radii[index], places, radii):
                places.append(place)
                break
        else:
            raise Rejected(f"no room for {solids[index].name}")
    return places


def _polar(radius_m: float, bearing_rad: float) -> Floats:
    return radius_m * np.array([math.cos(bearing_rad), math.sin(bearing_rad)])


def _footprint(solid: Solid) -> float:
    """Radius of the circle about the box's middle that holds the object, seen from above."""
    offsets = solid.hull[:, :2] - solid.bounds.mean(axis=0)[:2]
    return float(np.hypot(*offsets.T).max())


def _fits(place: Floats, radius_m: float, places: list[Floats], radii: list[float]) -> bool:
    from_base = float(np.hypot(*place))
    if not CROWD_RADIUS_M[0] <= from_base <= CROWD_RADIUS_M[1]:
        return False
    if abs(math.atan2(place[1], place[0])) > CROWD_BEARING_RAD:
        return False
    # A wide object, such as a laptop, may stand right beside the target, wherever its middle is.
    spread_m = max(CROWD_SPREAD_M, radius_m + CROWD_GAP_M[1])
    if float(np.hypot(*(place - places[0]))) > spread_m + radii[0]:
        return False
    return all(
        float(np.hypot(*(place - other))) >= radius_m + radius + CROWD_GAP_M[0]
        for other, radius in zip(places, radii, strict=False)
    )


def _check_at_rest(solid: Solid, *, start: Floats, pose: Floats) -> None:
    if math.acos(min(1.0, pose[2, 2])) > TOPPLED_RAD:
        raise Rejected(f"{solid.name} toppled")
    lowest_m = float(apply(pose, solid.hull)[:, 2].min())
    if abs(lowest_m) > SUNK_M:
        raise Rejected(f"{solid.name} rests {1e3 * lowest_m:.1f} mm off the table")
    middle = solid.bounds.mean(axis=0)[None]
    moved = apply(pose, middle)[0] - apply(start, middle)[0]
    if math.hypot(*moved[:2]) > ROLLED_M:
        raise Rejected(f"{solid.name} rolled away")
