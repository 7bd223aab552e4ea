"""Cans: drink cans, food and tuna tins, rectangular and oval tins."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.objects import profile as section
from sim_scenes.objects.draws import chance, choose, integer, uniform
from sim_scenes.objects.finish import finish
from sim_scenes.objects.outline import circle, rounded_rectangle
from sim_scenes.objects.part import Floats, strips
from sim_scenes.objects.primitives import disc, revolved, slab

if TYPE_CHECKING:
    import manifold3d  # type: ignore[import-not-found]
    import trimesh

    from sim_scenes.objects.loft import Ring
    from sim_scenes.objects.part import Rect

# Height of a seamed rim.
RIM_M = 0.003
# Thickness of a pull tab.
TAB_M = 0.0014
TAB_EDGE_M = 0.0004


class Kind(StrEnum):
    """What a can is for."""

    DRINK = "drink"
    FOOD = "food"
    FLAT = "flat"
    BLOCK = "block"


class Tab(StrEnum):
    """How a can is opened."""

    STAY = "stay"
    RING = "ring"
    NONE = "none"


# Drink cans (diameter, height, lid diameter), metres: 25 cl slim, 33 cl sleek, 33 cl, 35.5 cl,
# 44 cl, 50 cl.
DRINK_SIZES = {
    (0.0530, 0.1340, 0.0500): 2.0,
    (0.0575, 0.1565, 0.0500): 1.5,
    (0.0662, 0.1152, 0.0540): 3.0,
    (0.0662, 0.1222, 0.0540): 2.0,
    (0.0662, 0.1500, 0.0540): 1.0,
    (0.0662, 0.1680, 0.0540): 1.5,
}


@dataclass(frozen=True)
class CanParams:
    """Shape of a can: lengths in metres, the rest are ratios.

    `aspect` is the y extent over the x extent, and `corner` the radius of the outline's corners
    over half the lesser extent (1 is a circle or a stadium). `lid_radius_m` is the rim's radius at
    the top and `foot_radius_m` that of the ring it stands on, both along the lesser extent;
    `neck_m` and `foot_m` are the heights over which the side narrows to them. `rim_m` is the rim's
    thickness and `seam_m` how far it stands out, `dome_m` the hollow under the base, `lid_m` the
    depth of the lid below its rim, `bead_m` that of the corrugation.
    """

    kind: Kind
    width_m: float
    height_m: float
    aspect: float
    corner: float
    lid_radius_m: float
    neck_m: float
    foot_radius_m: float
    foot_m: float
    rim_m: float
    seam_m: float
    lid_m: float
    dome_m: float
    beads: int
    bead_m: float
    tab: Tab

    @classmethod
    def draw(cls, rng: np.random.Generator) -> CanParams:
        """Draw a can 5-10 cm wide and 4-17 cm tall."""
        kind = choose(rng, {Kind.DRINK: 4.0, Kind.FOOD: 3.0, Kind.FLAT: 1.6, Kind.BLOCK: 1.0})
        return _drink(rng) if kind is Kind.DRINK else _tin(rng, kind)

    @property
    def radius_m(self) -> float:
        """Half the lesser horizontal extent of the body."""
        return 0.5 * self.width_m * self.aspect

    def ring(self) -> Ring:
        """Outline: a circle, or a rectangle with rounded corners."""
        outer = max(self.radius_m + self.seam_m, self.lid_radius_m)
        if self.aspect == 1.0 and self.corner == 1.0:
            return circle(outer)
        grown = outer - self.radius_m
        ring, _ = rounded_rectangle(
            half_x_m=0.5 * self.width_m + grown,
            half_y_m=outer,
            corner_m=self.corner * self.radius_m + grown,
        )
        return ring


def _drink(rng: np.random.Generator) -> CanParams:
    """Two-piece can: a drawn body, necked in to its lid."""
    diameter, height, lid = choose(rng, DRINK_SIZES)
    scale, stretch = uniform(rng, 0.985, 1.015), uniform(rng, 0.985, 1.008)
    diameter = max(diameter * scale, 0.0515)
    height *= stretch
    lid_radius = 0.5 * lid * scale
    return CanParams(
        kind=Kind.DRINK,
        width_m=diameter,
        height_m=height,
        aspect=1.0,
        corner=1.0,
        lid_radius_m=lid_radius,
        neck_m=max(uniform(rng, 1.3, 2.0) * (0.5 * diameter - lid_radius), 0.005),
        foot_radius_m=0.5 * diameter * uniform(rng, 0.72, 0.80),
        foot_m=uniform(rng, 0.007, 0.012),
        rim_m=uniform(rng, 0.0013, 0.0017),
        seam_m=0.0,
        lid_m=uniform(rng, 0.004, 0.0065),
        dome_m=uniform(rng, 0.007, 0.011),
        beads=0,
        bead_m=0.0,
        tab=Tab.STAY if chance(rng, 0.92) else Tab.NONE,
    )


def _tin(rng: np.random.Generator, kind: Kind) -> CanParams:
    """Food tin: a tube between two seamed rims, or a drawn cup under one."""
    aspect, corner = 1.0, 1.0
    if kind is Kind.FOOD:
        width = uniform(rng, 0.060, 0.096)
        height = uniform(rng, 0.95, 1.6) * width
    elif kind is Kind.FLAT:
        width = uniform(rng, 0.075, 0.096)
        height = uniform(rng, 0.0405, 0.056)
    else:
        width = uniform(rng, 0.080, 0.096)
        height = uniform(rng, 0.042, 0.095)
        aspect = uniform(rng, 0.55, 0.72)
        corner = uniform(rng, 0.4, 1.0)
    height = min(height, 0.15)
    radius = 0.5 * width * aspect
    seam = uniform(rng, 0.0009, 0.0016)
    # A drawn cup has a rounded foot instead of a second rim.
    drawn = chance(rng, {Kind.FOOD: 0.2, Kind.FLAT: 0.7, Kind.BLOCK: 0.6}[kind])
    foot = uniform(rng, 0.003, 0.006)
    beaded = kind is Kind.FOOD and chance(rng, 0.7)
    return CanParams(
        kind=kind,
        width_m=width,
        height_m=height,
        aspect=aspect,
        corner=corner,
        lid_radius_m=radius + seam,
        neck_m=0.0,
        foot_radius_m=radius - foot if drawn else radius + seam,
        foot_m=foot if drawn else 0.0,
        rim_m=seam + uniform(rng, 0.0012, 0.0018),
        seam_m=seam,
        lid_m=uniform(rng, 0.0025, 0.0045),
        dome_m=uniform(rng, 0.0015, 0.003),
        beads=integer(rng, 3, 9) if beaded else 0,
        bead_m=uniform(rng, 0.0007, 0.0012),
        tab=Tab.RING if chance(rng, 0.55) else Tab.NONE,
    )


def generate(rng: np.random.Generator) -> trimesh.Trimesh:
    """Draw and build a can: origin at the centre of its base, tab along x."""
    return build(CanParams.draw(rng))


def build(params: CanParams) -> trimesh.Trimesh:
    """Build the can that the parameters describe."""
    label, spare = strips(0.9, 0.1)
    solid = revolved(_cut(params), params.ring(), rect=label)
    if params.tab is Tab.NONE:
        return finish(solid)
    return finish(solid + _tab(params, spare))


def _cut(params: CanParams) -> manifold3d.CrossSection:
    """Cut of the can without its tab."""
    body = section.round_convex(section.section_from_curve(_side(params)), 0.0007)
    body = section.round_concave(body, 0.0012)
    mouth = params.lid_radius_m - params.rim_m
    floor = params.height_m - params.lid_m
    # Below a drink can's rim the well clears the throat.
    top = mouth - 0.0010 if params.kind is Kind.DRINK else mouth
    lid = section.section_from_curve(
        np.array(
            [
                [top, floor],
                [top, params.height_m - RIM_M],
                [mouth, params.height_m],
                [mouth, params.height_m + 0.01],
            ]
        )
    )
    if params.kind is Kind.DRINK:
        # The countersink around the raised panel of the lid.
        panel = section.box_section(radius_m=top - 0.0035, z0_m=0.0, z1_m=floor + 0.0015)
        return body - (lid - panel) - _dome(params)
    step = section.box_section(radius_m=top - 0.006, z0_m=0.0, z1_m=floor + 0.0007)
    return body - (lid - step) - _dome(params)


def _side(params: CanParams) -> Floats:
    """Side (n, 2) of (r, z), metres, from the foot to the rim."""
    radius, height = params.radius_m, params.height_m
    share = np.linspace(0.0, 1.0, 24)
    ease = share * share * (3.0 - 2.0 * share)
    if params.foot_m:
        narrow = radius - params.foot_radius_m
        angle = 0.5 * np.pi * share
        if params.kind is Kind.DRINK:
            foot = np.column_stack([radius - narrow * (1.0 - share**0.8), params.foot_m * share])
        else:
            foot = np.column_stack(
                [radius - narrow * (1.0 - np.sin(angle)), params.foot_m * (1.0 - np.cos(angle))]
            )
    else:
        rim = params.foot_radius_m
        foot = np.array([[rim, 0.0], [rim, RIM_M], [radius, RIM_M + 0.0002]])
    rim_z = height - RIM_M
    if params.neck_m:
        throat = params.lid_radius_m - 0.0010
        neck = np.column_stack(
            [radius + (throat - radius) * ease, rim_z - 0.002 - params.neck_m * (1.0 - share)]
        )
    else:
        neck = np.array([[radius, rim_z - 0.0002]])
    rim_top = np.array([[params.lid_radius_m, rim_z], [params.lid_radius_m, height]])
    return np.concatenate([foot, _beads(params), neck, rim_top])


def _beads(params: CanParams) -> Floats:
    """Ring-shaped corrugation (n, 2) over the middle of the side."""
    if params.beads == 0:
        return np.zeros((0, 2))
    low, high = 0.22 * params.height_m, 0.78 * params.height_m
    share = np.linspace(0.0, 1.0, 8 * params.beads + 1)
    depth = 0.5 * params.bead_m * (1.0 - np.cos(2.0 * np.pi * params.beads * share))
    return np.column_stack([params.radius_m - depth, low + (high - low) * share])


def _dome(params: CanParams) -> manifold3d.CrossSection:
    """Hollow under the base: a dome under a drink can, a flat panel under a tin."""
    if params.kind is not Kind.DRINK:
        inner = params.foot_radius_m - max(params.rim_m, 0.0035 if params.foot_m else 0.0)
        return section.box_section(radius_m=inner, z0_m=-0.01, z1_m=params.dome_m)
    angle = 0.5 * np.pi * np.linspace(0.0, 1.0, 24)
    inner = params.foot_radius_m - 0.0022
    dome = np.column_stack([inner * np.cos(angle) ** 0.8, params.dome_m * np.sin(angle)])
    return section.section_from_curve(np.concatenate([[[inner, -0.01]], dome]))


def _tab(params: CanParams, rect: Rect) -> manifold3d.Manifold:
    """Build the tab, lying on the lid."""
    floor = params.height_m - params.lid_m + 0.0004
    if params.tab is Tab.STAY:
        floor += 0.0009
        body = slab(
            half_x_m=0.0125,
            half_y_m=0.0078,
            height_m=TAB_M,
            corner_m=0.0074,
            edge_m=TAB_EDGE_M,
            rect=rect,
        ).moved(offset=(0.0065, 0.0, floor))
        hole = disc(radius_m=0.0045, height_m=0.01, edge_m=TAB_EDGE_M, rect=rect)
        return body.solid() - hole.moved(offset=(0.0125, 0.0, floor + 0.0003)).solid()
    reach = 0.5 * params.width_m - 0.006
    outer = min(0.0115, 0.3 * params.radius_m)
    ring = disc(radius_m=outer, height_m=TAB_M, edge_m=TAB_EDGE_M, rect=rect)
    hole = disc(radius_m=0.68 * outer, height_m=0.01, edge_m=TAB_EDGE_M, rect=rect)
    at = reach - 0.016 - outer
    tongue = slab(
        half_x_m=0.010,
        half_y_m=0.0050,
        height_m=TAB_M,
        corner_m=0.0045,
        edge_m=TAB_EDGE_M,
        rect=rect,
    )
    open_ring = ring.solid() - hole.moved(offset=(0.0, 0.0, -0.003)).solid()
    shift = (at, 0.0, floor)
    return open_ring.translate(shift) + tongue.moved(offset=(reach - 0.010, 0.0, floor)).solid()
