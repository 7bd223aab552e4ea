"""Bowls, ramekins and soup plates."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.objects import profile as section
from sim_scenes.objects.draws import chance, choose, integer, uniform
from sim_scenes.objects.finish import finish
from sim_scenes.objects.outline import circle, lobed, superellipse
from sim_scenes.objects.part import strips
from sim_scenes.objects.primitives import revolved

if TYPE_CHECKING:
    import manifold3d  # type: ignore[import-not-found]
    import trimesh

    from sim_scenes.objects.loft import Ring
    from sim_scenes.objects.part import Floats

ABOVE_M = 0.04


class Style(StrEnum):
    """Side view of a bowl."""

    RAMEKIN = "ramekin"
    ROUND = "round"
    CONICAL = "conical"
    CEREAL = "cereal"
    SOUP_PLATE = "soup_plate"


class Rim(StrEnum):
    """Upper edge of a bowl."""

    PLAIN = "plain"
    LIP = "lip"
    BEAD = "bead"


class Outline(StrEnum):
    """View of a bowl from above."""

    ROUND = "round"
    SQUARE = "square"
    LOBED = "lobed"


# Width (metres), height and base as shares of width and radius: lowest and highest.
RANGES: dict[Style, tuple[tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    Style.RAMEKIN: ((0.082, 0.115), (0.40, 0.58), (0.80, 0.94)),
    Style.ROUND: ((0.095, 0.165), (0.38, 0.52), (0.30, 0.45)),
    Style.CONICAL: ((0.110, 0.185), (0.30, 0.46), (0.30, 0.42)),
    Style.CEREAL: ((0.125, 0.175), (0.30, 0.42), (0.48, 0.66)),
    Style.SOUP_PLATE: ((0.170, 0.200), (0.16, 0.24), (0.42, 0.55)),
}


@dataclass(frozen=True)
class BowlParams:
    """Shape of a bowl: lengths in metres, the rest are ratios.

    `base` is the base's radius as a share of the rim's, `curve` in [0, 1] the side's roundness.
    `foot_m` is the height of the ring it stands on, 0 for a flat base. `lobes` and `squareness`
    apply to the outlines they name; `fade` is how much of the outline is left at the base.
    """

    style: Style
    width_m: float
    height_m: float
    base: float
    curve: float
    wall_m: float
    floor_m: float
    foot_m: float
    rim: Rim
    outline: Outline
    lobes: int
    lobe_depth: float
    squareness: float
    fade: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BowlParams:
        """Draw a bowl 8-20 cm wide."""
        style = choose(
            rng,
            {
                Style.RAMEKIN: 1.5,
                Style.ROUND: 2.5,
                Style.CONICAL: 1.5,
                Style.CEREAL: 2.0,
                Style.SOUP_PLATE: 1.2,
            },
        )
        width_range, height_range, base_range = RANGES[style]
        width = uniform(rng, *width_range)
        outline = choose(rng, {Outline.ROUND: 0.64, Outline.SQUARE: 0.18, Outline.LOBED: 0.18})
        # Other outlines stretch the wall by up to a fifth.
        thickest = 0.0056 if outline is Outline.ROUND else 0.0046
        wall = uniform(rng, 0.0026, thickest)
        return cls(
            style=style,
            width_m=width,
            height_m=width * uniform(rng, *height_range),
            base=uniform(rng, *base_range),
            curve=uniform(rng, 0.0, 1.0),
            wall_m=wall,
            floor_m=wall * uniform(rng, 1.0, 1.6),
            foot_m=uniform(rng, 0.002, 0.008) if chance(rng, 0.6) else 0.0,
            rim=choose(rng, {Rim.PLAIN: 0.55, Rim.LIP: 0.25, Rim.BEAD: 0.2}),
            outline=outline,
            lobes=integer(rng, 5, 12),
            lobe_depth=uniform(rng, 0.03, 0.065),
            squareness=uniform(rng, 3.0, 4.2),
            fade=uniform(rng, 0.2, 1.0),
        )

    @property
    def lift_m(self) -> float:
        """Height at which the side leaves the foot."""
        return 0.6 * self.foot_m

    @property
    def bead_m(self) -> float:
        """How far a rolled rim stands out."""
        return 0.35 * self.wall_m

    def side(self) -> Floats:
        """Outer side (n, 2) of (r, z), metres, from the base (above its foot) to the rim."""
        base, curve = self.base, self.curve
        if self.style is Style.SOUP_PLATE:
            # A well, then a flange that climbs gently.
            well, flange = 0.7 + 0.06 * curve, 0.72 + 0.16 * curve
            bowl = section.bezier([(base, 0.0), (0.96 * well, 0.05), (well, flange)], count=24)
            line = np.concatenate([bowl, [(1.0, 1.0)]])
        elif self.style is Style.CONICAL:
            line = section.bezier(
                [(base, 0.0), (0.5 * (1 + base) + 0.08 * curve, 0.5 - 0.1 * curve), (1.0, 1.0)],
                count=40,
            )
        elif self.style is Style.RAMEKIN:
            line = np.array([(base, 0.0), (1.0, 1.0)])
        else:
            # Leaves the base at a slant and meets the rim almost upright.
            full = 0.86 + 0.12 * curve
            line = section.bezier(
                [(base, 0.0), (full, 0.02 + 0.1 * (1 - curve)), (0.99, 0.5), (1.0, 1.0)],
                count=48,
            )
        radius, foot = 0.5 * self.width_m, self.lift_m
        if self.rim is Rim.BEAD:
            radius -= self.bead_m
        # Where the side is flat at the rim, its upper face ends a wall higher than its lower one.
        run, rise = (line[-1] - line[-2]) * (radius, self.height_m - foot)
        top = self.height_m - 1.05 * self.wall_m * float(run / np.hypot(run, rise))
        z = foot + (top - foot) * line[:, 1]
        r = radius * line[:, 0]
        if self.rim is Rim.LIP:
            lip = np.clip((z - self.height_m + 0.012) / 0.012, 0.0, 1.0)
            r = (r + 0.003 * lip**2) * radius / (radius + 0.003)
        return np.column_stack([r, z])

    def ring(self) -> Ring:
        """Outline at each height."""
        radius = 0.5 * self.width_m

        def strength(z: float) -> float:
            s = min(max(z / self.height_m, 0.0), 1.0)
            return self.fade + (1.0 - self.fade) * s * s * (3.0 - 2.0 * s)

        if self.outline is Outline.SQUARE:
            return superellipse(radius, exponent=self.squareness, strength=strength)
        if self.outline is Outline.LOBED:
            return lobed(radius, lobes=self.lobes, depth=self.lobe_depth, strength=strength)
        return circle(radius)


def generate(rng: np.random.Generator) -> trimesh.Trimesh:
    """Draw and build a bowl: origin at the centre of its base."""
    return build(BowlParams.draw(rng))


def build(params: BowlParams) -> trimesh.Trimesh:
    """Build the bowl that the parameters describe."""
    return finish(revolved(_shell(params), params.ring(), rect=strips(1.0)[0]))


def _shell(params: BowlParams) -> manifold3d.CrossSection:
    """Cut of the bowl by a vertical plane."""
    side = params.side()
    height, wall, foot = params.height_m, params.wall_m, params.foot_m
    top = [[side[-1, 0], height + ABOVE_M]]
    block = section.section_from_curve(np.concatenate([side, top]))
    floor = float(side[0, 1]) + params.floor_m

    cavity = section.inset(block, wall) ^ section.box_section(radius_m=1.0, z0_m=floor, z1_m=1.0)
    # A corner of the cavity as round as its depth allows, so that food and light slide off.
    cavity = section.round_convex(cavity, min(0.012, 0.3 * (height - floor)))
    shell = block - section.box_section(radius_m=1.0, z0_m=height, z1_m=1.0)
    base = float(side[0, 0])
    if foot:
        # Narrower than the base; hollow underneath.
        shell += section.section_from_curve(
            np.array([[0.93 * base, 0.0], [0.97 * base, 1.5 * foot]])
        ) - section.box_section(
            radius_m=0.93 * base - max(0.0035, wall), z0_m=-1.0, z1_m=0.85 * foot
        )
        hollow = section.box_section(
            radius_m=0.93 * base - max(0.0035, wall), z0_m=-1.0, z1_m=float(side[0, 1])
        )
        shell -= hollow
    shell -= cavity
    if params.rim is Rim.BEAD:
        bead = 0.5 * wall + params.bead_m
        shell += section.disc_section(
            radius_m=bead, at_m=(float(side[-1, 0]) - 0.5 * wall, height - bead)
        )
    shell = section.round_convex(shell, 0.42 * wall)
    return section.round_concave(shell, 0.003)
