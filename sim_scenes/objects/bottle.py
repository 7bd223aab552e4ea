"""Bottles: water, soda, wine, beer, shampoo and squeeze bottles, closed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from sim_scenes.objects import profile as section
from sim_scenes.objects.closure import Closure, ClosureParams, closure_solid
from sim_scenes.objects.draws import chance, choose, integer, uniform
from sim_scenes.objects.finish import finish
from sim_scenes.objects.outline import circle, lobed, superellipse
from sim_scenes.objects.part import Floats, strips
from sim_scenes.objects.primitives import revolved

if TYPE_CHECKING:
    import manifold3d  # type: ignore[import-not-found]
    import trimesh

    from sim_scenes.objects.loft import Ring

Span: TypeAlias = tuple[float, float]

# The neck runs this far up into its closure.
INTO_CLOSURE_M = 0.003
PETALS = 5
# The lobes of a petaloid base fade out at this share of the body's radius above the base.
PETAL_RISE = 0.8
GROOVE_RADIUS_M = 0.003
# Greatest height over the lesser width: beyond it a bottle falls over at a touch.
MOST_SLENDER = 4.2


class Kind(StrEnum):
    """What a bottle holds."""

    WATER = "water"
    SODA = "soda"
    WINE = "wine"
    BEER = "beer"
    SHAMPOO = "shampoo"
    SQUEEZE = "squeeze"


@dataclass(frozen=True)
class _Family:
    """Ranges of one kind: lengths in metres, `slender` the height over the width.

    The other spans are those of the fields of `BottleParams`, `span` that of `neck - shoulder`.
    `features` are the chances of an oval outline, a square one, grooves, petals and a deep punt.
    """

    width: Span
    slender: Span
    neck_radius: Span
    shoulder: Span
    span: Span
    fullness: Span
    taper: Span
    waist: Span
    features: tuple[float, float, float, float, float]
    closures: dict[Closure, float]


FAMILIES = {
    Kind.WATER: _Family(
        width=(0.060, 0.086),
        slender=(2.6, 3.6),
        neck_radius=(0.0125, 0.0140),
        shoulder=(0.66, 0.80),
        span=(0.14, 0.26),
        fullness=(0.35, 0.75),
        taper=(-0.02, 0.06),
        waist=(-0.01, 0.10),
        features=(0.0, 0.3, 0.75, 0.3, 0.0),
        closures={Closure.SCREW: 3.0, Closure.SPORT: 1.0},
    ),
    Kind.SODA: _Family(
        width=(0.062, 0.090),
        slender=(3.0, 3.6),
        neck_radius=(0.0125, 0.0140),
        shoulder=(0.56, 0.70),
        span=(0.22, 0.32),
        fullness=(0.25, 0.6),
        taper=(-0.03, 0.05),
        waist=(0.04, 0.17),
        features=(0.0, 0.0, 0.3, 0.85, 0.0),
        closures={Closure.SCREW: 1.0},
    ),
    Kind.WINE: _Family(
        width=(0.071, 0.086),
        slender=(3.4, 4.1),
        neck_radius=(0.0130, 0.0148),
        shoulder=(0.60, 0.84),
        span=(0.14, 0.40),
        fullness=(0.35, 0.65),
        taper=(-0.03, 0.04),
        waist=(0.0, 0.0),
        features=(0.0, 0.0, 0.0, 0.0, 0.85),
        closures={Closure.CORK: 3.0, Closure.LONG_SCREW: 1.0},
    ),
    Kind.BEER: _Family(
        width=(0.056, 0.070),
        slender=(3.2, 4.0),
        neck_radius=(0.0118, 0.0130),
        shoulder=(0.46, 0.64),
        span=(0.18, 0.36),
        fullness=(0.35, 0.7),
        taper=(-0.02, 0.02),
        waist=(0.0, 0.0),
        features=(0.0, 0.0, 0.0, 0.0, 0.3),
        closures={Closure.CROWN: 1.0},
    ),
    Kind.SHAMPOO: _Family(
        width=(0.052, 0.096),
        slender=(1.9, 2.9),
        neck_radius=(0.0100, 0.0150),
        shoulder=(0.82, 0.90),
        span=(0.10, 0.20),
        fullness=(0.6, 0.95),
        taper=(-0.25, 0.25),
        waist=(-0.06, 0.08),
        features=(0.75, 0.5, 0.0, 0.0, 0.0),
        closures={Closure.FLIP: 3.0, Closure.PUMP: 2.0, Closure.SCREW: 0.7},
    ),
    Kind.SQUEEZE: _Family(
        width=(0.055, 0.085),
        slender=(2.2, 3.1),
        neck_radius=(0.0110, 0.0150),
        shoulder=(0.68, 0.84),
        span=(0.14, 0.30),
        fullness=(0.45, 0.85),
        taper=(-0.12, 0.15),
        waist=(0.0, 0.14),
        features=(0.6, 0.25, 0.25, 0.0, 0.0),
        closures={Closure.NOZZLE: 2.5, Closure.FLIP: 1.0, Closure.SPORT: 0.8},
    ),
}


@dataclass(frozen=True)
class BottleParams:
    """Shape of a bottle: lengths in metres, the rest are ratios.

    `height_m` includes the closure. The shoulder starts at `shoulder` and ends at `neck`, both
    shares of the height below the closure; `fullness` bulges it from a cone (0) to a dome (1),
    `settle` is how far it runs out along the neck. `taper` narrows the body towards its base
    (towards its shoulder below 0), `waist` pinches it at `waist_at`. Its outline is a superellipse
    of `exponent` (2 round, more is squarer) whose y extent is `aspect` of its width; `petal_depth`
    is the share of the radius cut in between the feet of a petaloid base. The base is hollow to the
    height `punt_m`, so that the bottle stands on a ring.
    """

    kind: Kind
    width_m: float
    height_m: float
    aspect: float
    exponent: float
    shoulder: float
    neck: float
    fullness: float
    settle: float
    taper: float
    waist: float
    waist_at: float
    neck_radius_m: float
    base_edge_m: float
    grooves: int
    groove_depth_m: float
    petal_depth: float
    punt_m: float
    closure: ClosureParams

    @classmethod
    def draw(cls, rng: np.random.Generator) -> BottleParams:
        """Draw a bottle 5-10 cm wide and 12-30 cm tall."""
        kind = choose(rng, dict.fromkeys(FAMILIES, 1.0))
        family = FAMILIES[kind]
        oval, square, grooves, petals, punt = (chance(rng, p) for p in family.features)
        width = uniform(rng, *family.width)
        aspect = uniform(rng, 0.55, 0.85) if oval else 1.0
        height = min(width * uniform(rng, *family.slender), MOST_SLENDER * width * aspect)
        height = min(max(height, 0.125), 0.296)
        neck_radius = uniform(rng, *family.neck_radius)
        shoulder = uniform(rng, *family.shoulder)
        taper = uniform(rng, *family.taper)
        return cls(
            kind=kind,
            width_m=width,
            height_m=height,
            aspect=aspect,
            exponent=uniform(rng, 2.6, 5.0) if square else 2.0,
            shoulder=shoulder,
            neck=min(shoulder + uniform(rng, *family.span), 0.985),
            fullness=uniform(rng, *family.fullness),
            settle=uniform(rng, 0.1, 0.5),
            taper=taper,
            waist=uniform(rng, *family.waist),
            waist_at=uniform(rng, 0.4, 0.65),
            neck_radius_m=neck_radius,
            base_edge_m=uniform(rng, 0.0025, 0.1 * width * aspect),
            grooves=integer(rng, 2, 3) if grooves else 0,
            groove_depth_m=uniform(rng, 0.0008, 0.0017),
            petal_depth=uniform(rng, 0.12, 0.3) if petals and not square else 0.0,
            punt_m=uniform(rng, 0.008, 0.03) if punt else uniform(rng, 0.0008, 0.0025),
            closure=ClosureParams.draw(
                rng,
                kind=choose(rng, family.closures),
                neck_radius_m=neck_radius,
                shoulder_radius_m=0.5 * width * aspect * (1.0 - max(-taper, 0.0)),
            ),
        )

    @property
    def body_height_m(self) -> float:
        """Height of the lower edge of the closure."""
        return self.height_m - self.closure.height_m

    def side(self) -> Floats:
        """Side (n, 2) of (r, z), metres, from the base to the shoulder."""
        s = np.linspace(0.0, 1.0, 60)
        radius = 1.0 - max(self.taper, 0.0) * (1.0 - s) ** 1.3
        radius -= max(-self.taper, 0.0) * s**1.6
        radius -= self.waist * np.exp(-(((s - self.waist_at) / 0.22) ** 2))
        radius *= 0.5 * self.width_m / radius.max()
        return np.column_stack([radius, self.shoulder * self.body_height_m * s])

    def shoulder_side(self) -> Floats:
        """Side (n, 2) of (r, z), metres, from the top of the body to the foot of the neck."""
        radius, start = (float(v) for v in self.side()[-1])
        neck, end = self.neck_radius_m, self.neck * self.body_height_m
        return section.bezier(
            [
                (radius, start),
                (radius, start + self.fullness * (end - start)),
                (neck + 0.5 * self.fullness * (radius - neck), end - self.settle * (end - start)),
                (neck, end),
            ],
            count=40,
        )

    def ring(self) -> Ring:
        """Outline at each height: that of the body, which the shoulder turns into a circle."""
        radius = 0.5 * self.width_m
        if self.petal_depth:
            rise = PETAL_RISE * radius
            return lobed(
                radius,
                lobes=PETALS,
                depth=self.petal_depth,
                strength=lambda z: max(0.0, 1.0 - z / rise) ** 2,
            )
        if self.exponent == 2.0 and self.aspect == 1.0:
            return circle(radius)
        shoulder = self.shoulder_side()
        # Of the radius, not of the height: a shoulder that turns round too soon would bulge.
        gone = (shoulder[0, 0] - shoulder[:, 0]) / (shoulder[0, 0] - self.neck_radius_m)

        def strength(z: float) -> float:
            return 1.0 - float(np.interp(z, shoulder[:, 1], gone)) ** 2

        return superellipse(radius, exponent=self.exponent, strength=strength, aspect=self.aspect)


def generate(rng: np.random.Generator) -> trimesh.Trimesh:
    """Draw and build a bottle: origin at the centre of its base, width and spout along x."""
    return build(BottleParams.draw(rng))


def build(params: BottleParams) -> trimesh.Trimesh:
    """Build the bottle that the parameters describe."""
    label, cap = strips(0.75, 0.25)
    body = revolved(_body(params), params.ring(), rect=label)
    return finish(body + closure_solid(params.closure, z_m=params.body_height_m, rect=cap))


def _body(params: BottleParams) -> manifold3d.CrossSection:
    """Cut of the bottle below its closure."""
    side = params.side()
    neck, start = params.neck_radius_m, float(side[-1, 1])
    shoulder = params.shoulder_side()
    top = [[neck, params.body_height_m + INTO_CLOSURE_M]]
    body = section.section_from_curve(np.concatenate([side, shoulder[1:], top]))
    body = section.round_convex(body, params.base_edge_m)
    body = section.round_concave(body, 0.004)
    for z in _groove_heights(params, start):
        at = float(np.interp(z, side[:, 1], side[:, 0])) - params.groove_depth_m
        body -= section.disc_section(radius_m=GROOVE_RADIUS_M, at_m=(at + GROOVE_RADIUS_M, z))
    if params.closure.flange_m:
        body += section.box_section(
            radius_m=neck + params.closure.flange_m,
            z0_m=params.body_height_m - 0.003,
            z1_m=params.body_height_m - 0.0015,
        )
    return body - _punt(params, float(side[0, 0]))


def _groove_heights(params: BottleParams, start_m: float) -> list[float]:
    """Heights of the grooves: spread over the middle of the side."""
    share = (np.arange(params.grooves) + 0.5) / max(params.grooves, 1)
    return [float(z) for z in start_m * (0.2 + 0.65 * share)]


def _punt(params: BottleParams, base_radius_m: float) -> manifold3d.CrossSection:
    """Hollow under the base: half an ellipse."""
    angle = 0.5 * np.pi * np.linspace(0.0, 1.0, 24)
    reach = base_radius_m - params.base_edge_m - 0.002
    dome = np.column_stack([reach * np.cos(angle), params.punt_m * np.sin(angle)])
    return section.section_from_curve(np.concatenate([[[reach, -0.01]], dome]))
