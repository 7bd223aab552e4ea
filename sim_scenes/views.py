"""Camera poses on the arc that the arm really reaches."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.arm import STARTS_RAD, Arm
from sim_scenes.geometry import Floats, apply, inverse, look_at
from sim_scenes.rejected import Rejected
from sim_scenes.render import Light, Picture, render
from sim_scenes.silhouette import silhouette

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from sim_scenes.camera import Intrinsics
    from sim_scenes.spec import Arc
    from sim_scenes.world import Body, World

CANDIDATES = 32
# The target's projection keeps this share of the image's width from the border.
BORDER_SHARE = 0.0125
# It is visible when this share of the image, and of its own outline, shows it.
VISIBLE_IMAGE_SHARE = 1e-3
VISIBLE_OUTLINE_SHARE = 0.4
# From radius over the field of view's sine on, a ball about the target is in view; flat or long
# targets are from this share of it on, or else their candidates are dropped as cut.
FLAT = 0.65
# The range of distances reaches at least this far beyond its near end.
FARTHER = 1.3


@dataclass(frozen=True, eq=False)
class View:
    """A pose that the arm holds, and what the camera sees from there."""

    joint_positions_rad: Floats
    world_from_camera: Floats
    picture: Picture


@dataclass(frozen=True, eq=False)
class Viewer:
    """Finds the views of one settled scene.

    Attributes
    ----------
    world, arm
        The simulation.
    bodies, poses
        Objects at rest, the target first, and their `world_from_object`.
    intrinsics, light
        Of the images.
    """

    world: World
    arm: Arm
    bodies: Sequence[Body]
    poses: Sequence[Floats]
    intrinsics: Intrinsics
    light: Light

    def find(self, arc: Arc, *, count: int, random: np.random.Generator) -> list[View]:
        """Find `count` views along the arc, in order of azimuth.

        Raises
        ------
        Rejected
            If one of them has no candidate that serves; says what was wrong with them.
        """
        candidates = self._candidates(arc, count=count, random=random)
        views: list[View] = []
        for number, poses in enumerate(candidates, start=1):
            reasons: Counter[str] = Counter()
            starts = [view.joint_positions_rad for view in views[-1:]]
            for pose in poses:
                found = self._try(pose, starts=[*starts, *map(np.asarray, STARTS_RAD)])
                if isinstance(found, View):
                    views.append(found)
                    break
                reasons[found] += 1
            else:
                listed = ", ".join(f"{count} {reason}" for reason, count in reasons.most_common())
                raise Rejected(f"view {number} of {count}: of {CANDIDATES} poses {listed}")
        return views

    def _candidates(
        self, arc: Arc, *, count: int, random: np.random.Generator
    ) -> Iterator[list[Floats]]:
        """For each view, camera poses in its share of the arc."""
        hull = self._target_hull()
        target = (hull.min(axis=0) + hull.max(axis=0)) / 2
        radius = float(np.linalg.norm(hull - target, axis=1).max())
        half_view = math.atan(self.intrinsics.height / 2 / self.intrinsics.fy)
        near_m = max(arc.distance_m[0], FLAT * radius / math.sin(half_view))
        far_m = max(arc.distance_m[1], FARTHER * near_m)

        side = random.choice([-1.0, 1.0])
        away_from_base = math.degrees(math.atan2(target[1], target[0]))
        centre_deg = away_from_base + side * random.uniform(*arc.azimuth_centre_deg)
        share_deg = arc.azimuth_span_deg / count
        for number in range(count):
            middle_deg = centre_deg + (number + 0.5) * share_deg - arc.azimuth_span_deg / 2
            poses = []
            for _ in range(CANDIDATES):
                azimuth = math.radians(middle_deg + share_deg * random.uniform(-0.5, 0.5))
                elevation = math.radians(random.uniform(*arc.elevation_deg))
                distance_m = random.uniform(near_m, far_m)
                direction = np.array(
                    [
                        math.cos(elevation) * math.cos(azimuth),
                        math.cos(elevation) * math.sin(azimuth),
                        math.sin(elevation),
                    ]
                )
                poses.append(look_at(eye=target + distance_m * direction, target=target))
            yield poses

    def _target_hull(self) -> Floats:
        return apply(self.poses[0], self.bodies[0].solid.hull)

    def _try(self, world_from_camera: Floats, *, starts: Sequence[Floats]) -> View | str:
        """Take a candidate's view, or say why not."""
        if not self._in_image(world_from_camera):
            return "cut the target"
        if not self.arm.reach(world_from_camera, starts=starts):
            return "out of reach"
        self.arm.hold()
        # The arm's dynamics must not have nudged an object.
        for body, pose in zip(self.bodies, self.poses, strict=True):
            self.world.place(body, world_from_object=pose)
        touched = self.arm.touches(self.bodies)
        if touched is not None:
            return f"touch {touched}"
        # From here on counts where the arm is, not where it was sent.
        reached = self.arm.world_from_camera()
        if not self._in_image(reached):
            return "cut the target"
        picture = render(
            self.world,
            bodies=self.bodies,
            world_from_camera=reached,
            intrinsics=self.intrinsics,
            light=self.light,
        )
        if not self._target_visible(picture, reached):
            return "hide the target"
        return View(self.arm.joint_positions_rad(), reached, picture)

    def _in_image(self, world_from_camera: Floats) -> bool:
        hull_camera = apply(inverse(world_from_camera), self._target_hull())
        if (hull_camera[:, 2] <= 0).any():
            return False
        border = BORDER_SHARE * self.intrinsics.width
        pixels = self.intrinsics.project(hull_camera)
        size = np.array([self.intrinsics.width, self.intrinsics.height])
        return bool(((pixels >= border) & (pixels <= size - 1 - border)).all())

    def _target_visible(self, picture: Picture, world_from_camera: Floats) -> bool:
        visible = int((picture.instance_ids == 1).sum())
        if visible < VISIBLE_IMAGE_SHARE * picture.instance_ids.size:
            return False
        if len(self.bodies) == 1 and not picture.arm_in_view:
            return True  # Nothing can stand before the target.
        camera_from_object = inverse(world_from_camera) @ self.poses[0]
        solid = self.bodies[0].solid
        outline = silhouette(
            apply(camera_from_object, solid.vertices), solid.faces, intrinsics=self.intrinsics
        )
        return visible >= VISIBLE_OUTLINE_SHARE * int(outline.sum())
