"""Mugs and cups."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.objects import profile as section
from sim_scenes.objects.draws import chance, choose, uniform
from sim_scenes.objects.finish import finish
from sim_scenes.objects.handle import Handle, HandleParams, handle_part
from sim_scenes.objects.outline import circle
from sim_scenes.objects.part import Floats, strips
from sim_scenes.objects.primitives import revolved

if TYPE_CHECKING:
    import manifold3d  # type: ignore[import-not-found]
    import trimesh

# Room above the rim through which cutting bodies extend.
ABOVE_M = 0.04


class Body(StrEnum):
    """Side view of a mug."""

    STRAIGHT = "straight"
    TAPERED = "tapered"
    FLARED = "flared"
    ROUNDED = "rounded"


@dataclass(frozen=True)
class MugParams:
    """Shape of a mug: lengths in metres, the rest are ratios.

    `gap_m` is the air between the two walls of an insulated mug, 0 for a single wall.
    `shape` is the depth of the body's curve as a share of its radius.
    """

    body: Body
    diameter_m: float
    height_m: float
    shape: float
    wall_m: float
    floor_m: float
    gap_m: float
    base_radius_m: float
    recess_m: float
    inner_fillet_m: float
    handle: HandleParams

    @classmethod
    def draw(cls, rng: np.random.Generator) -> MugParams:
        """Draw a mug 6-11 cm wide and 6-14 cm tall."""
        body = choose(
            rng, {Body.STRAIGHT: 3.0, Body.TAPERED: 2.5, Body.FLARED: 2.0, Body.ROUNDED: 2.5}
        )
        diameter = uniform(rng, 0.061, 0.109)
        height = uniform(rng, max(0.061, 0.72 * diameter), min(0.139, 1.55 * diameter))
        low, high = {
            Body.STRAIGHT: (-0.01, 0.03),
            Body.TAPERED: (0.08, 0.27),
            Body.FLARED: (0.12, 0.28),
            Body.ROUNDED: (0.08, 0.26),
        }[body]
        shape = uniform(rng, low, high)
        double = chance(rng, 0.15)
        wall = uniform(rng, 0.0025, 0.0029) if double else uniform(rng, 0.0025, 0.0058)
        return cls(
            body=body,
            diameter_m=diameter,
            height_m=height,
            shape=shape,
            wall_m=wall,
            floor_m=wall * uniform(rng, 1.0, 1.7),
            gap_m=uniform(rng, 0.0025, 0.005) if double else 0.0,
            base_radius_m=uniform(rng, 0.0015, min(0.012, 0.1 * (1.0 - shape) * diameter)),
            recess_m=uniform(rng, 0.001, 0.0025) if chance(rng, 0.7) else 0.0,
            inner_fillet_m=uniform(rng, 0.002, 0.01),
            handle=HandleParams.draw(rng, height_m=height, diameter_m=diameter, wall_m=wall),
        )

    def outer(self) -> Floats:
        """Side (n, 2) of (r, z), metres, from the base to the rim, before its edges are rounded."""
        s = np.linspace(0.0, 1.0, 60)
        radius = {
            Body.STRAIGHT: 1.0 - self.shape * (1.0 - s),
            Body.TAPERED: 1.0 - self.shape * (1.0 - s) ** 1.2,
            Body.FLARED: 1.0 - self.shape * (1.0 - s**2.4),
            Body.ROUNDED: 1.0 - self.shape * (2.0 * np.abs(s - 0.48)) ** 2.0,
        }[self.body]
        radius = radius / radius.max()
        return np.column_stack([0.5 * self.diameter_m * radius, self.height_m * s])


def generate(rng: np.random.Generator) -> trimesh.Trimesh:
    """Draw and build a mug: origin at the centre of its base, handle along +x."""
    return build(MugParams.draw(rng))


def build(params: MugParams) -> trimesh.Trimesh:
    """Build the mug that the parameters describe."""
    around, spare = strips(0.8, 0.2)
    ring = circle(0.5 * params.diameter_m)
    shell = revolved(_shell(params), ring, rect=around)
    if params.handle.kind is Handle.NONE:
        return finish(shell)
    # The handle ends inside the wall: what would reach into the cup is cut away.
    side = params.outer()
    core = _tall(side[:, 0] - 0.5 * params.wall_m, side[:, 1])
    handle = handle_part(params.handle, side=side, rect=spare).solid()
    return finish(shell + (handle - revolved(core, ring, rect=around)))


def _shell(params: MugParams) -> manifold3d.CrossSection:
    """Cut of the cup without its handle."""
    side = params.outer()
    height, wall = params.height_m, params.wall_m
    walls = 2.0 * wall + params.gap_m if params.gap_m else wall
    bottom = params.recess_m + params.floor_m
    floor = bottom + params.gap_m + params.floor_m if params.gap_m else bottom
    block = _tall(side[:, 0], side[:, 1])

    def above(z: float) -> manifold3d.CrossSection:
        return section.box_section(radius_m=1.0, z0_m=z, z1_m=1.0)

    block = section.round_convex(block, params.base_radius_m)
    shell = block - above(height)
    shell -= section.inset(block, walls) ^ above(floor)
    # The lip; before the recess is cut, since the ring around that is thinner than a double wall.
    shell = section.round_convex(shell, 0.42 * walls)
    if params.recess_m:
        standing = float(side[0, 0]) - params.base_radius_m
        shell -= section.box_section(radius_m=standing - 0.004, z0_m=-1.0, z1_m=params.recess_m)
        shell = section.round_convex(shell, 0.0006)
    shell = section.round_concave(shell, params.inner_fillet_m)
    if params.gap_m:
        between = section.inset(block, wall) ^ above(bottom)
        between -= section.inset(block, wall + params.gap_m) ^ above(bottom + params.gap_m)
        shell -= between - above(height - walls)
    return shell


def _tall(radius: Floats, z: Floats) -> manifold3d.CrossSection:
    """Fill a side view and extend it straight up past the rim."""
    top = [[radius[-1], z[-1] + ABOVE_M]]
    return section.section_from_curve(np.concatenate([np.column_stack([radius, z]), top]))
