"""Cameras: compacts, rangefinders, reflexes with long lenses, instant cameras."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from sim_scenes.objects import profile as section
from sim_scenes.objects.draws import chance, choose, uniform
from sim_scenes.objects.finish import finish
from sim_scenes.objects.loft import loft
from sim_scenes.objects.outline import circle, rounded_rectangle
from sim_scenes.objects.part import Part, Rect, strips, union
from sim_scenes.objects.primitives import Z_TO_FRONT, disc, slab

if TYPE_CHECKING:
    import trimesh

Span: TypeAlias = tuple[float, float]

Z_TO_BACK = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # z -> y

# Parts reach this far into the body.
SUNK_M = 0.004
# The lens stays this far above the table.
CLEARANCE_M = 0.003
# The centre of mass stays within this share of the base's half depth, in front of its middle.
BALANCE = 0.6
# Depth of the whole, and how far an eyepiece stands out.
LONGEST_M = 0.139
EYEPIECE_M = (0.003, 0.008)


class Kind(StrEnum):
    """Build of a camera."""

    COMPACT = "compact"
    RANGEFINDER = "rangefinder"
    REFLEX = "reflex"
    INSTANT = "instant"


@dataclass(frozen=True)
class _Family:
    """Ranges of one kind: lengths in metres, those of the lens as shares of what there is room for.

    `features` are the chances of a grip, a hump, a flash box, a dial and an eyepiece.
    """

    width: Span
    height: Span
    depth: Span
    corner: Span
    edge: Span
    lens_radius: Span
    lens_length: Span
    grip: Span
    features: tuple[float, float, float, float, float]


FAMILIES = {
    Kind.COMPACT: _Family(
        width=(0.092, 0.112),
        height=(0.060, 0.068),
        depth=(0.025, 0.036),
        corner=(0.35, 0.98),
        edge=(0.002, 0.005),
        lens_radius=(0.62, 0.85),
        lens_length=(0.006, 0.030),
        grip=(0.006, 0.009),
        features=(0.35, 0.0, 0.35, 0.35, 0.0),
    ),
    Kind.RANGEFINDER: _Family(
        width=(0.112, 0.140),
        height=(0.066, 0.079),
        depth=(0.030, 0.040),
        corner=(0.4, 0.98),
        edge=(0.0015, 0.004),
        lens_radius=(0.68, 0.92),
        lens_length=(0.018, 0.055),
        grip=(0.006, 0.010),
        features=(0.4, 0.0, 0.3, 0.9, 0.6),
    ),
    Kind.REFLEX: _Family(
        width=(0.118, 0.149),
        height=(0.072, 0.086),
        depth=(0.040, 0.058),
        corner=(0.3, 0.7),
        edge=(0.003, 0.007),
        lens_radius=(0.78, 0.98),
        lens_length=(0.030, 0.095),
        grip=(0.007, 0.018),
        features=(1.0, 1.0, 0.0, 0.85, 1.0),
    ),
    Kind.INSTANT: _Family(
        width=(0.100, 0.122),
        height=(0.088, 0.107),
        depth=(0.045, 0.066),
        corner=(0.3, 0.9),
        edge=(0.005, 0.010),
        lens_radius=(0.50, 0.68),
        lens_length=(0.008, 0.026),
        grip=(0.0, 0.0),
        features=(0.0, 0.0, 1.0, 0.0, 0.5),
    ),
}


@dataclass(frozen=True)
class CameraParams:
    """Shape of a camera: lengths in metres; x runs to the right seen from the front, -y forward.

    `height_m` and `depth_m` are those of the body alone. A part that a camera lacks has size 0:
    `grip_m` and `hump_m` are how far the grip and the viewfinder's hump stand out, `dial_m` and
    `eyepiece_m` the mode dial's radius and the eyepiece's depth. `rings` are the radii of the
    lens's rings from the body to the front, over the largest.
    """

    kind: Kind
    width_m: float
    height_m: float
    depth_m: float
    corner_m: float
    edge_m: float
    lens_x_m: float
    lens_z_m: float
    lens_radius_m: float
    lens_length_m: float
    rings: tuple[float, ...]
    grip_m: float
    grip_width_m: float
    hump_m: float
    hump_width_m: float
    flash: bool
    dial_m: float
    eyepiece_m: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> CameraParams:
        """Draw a camera 9-15 cm wide, 6-11 cm tall and 3-14 cm deep that stands on its base."""
        kind = choose(
            rng, {Kind.COMPACT: 2.5, Kind.RANGEFINDER: 2.5, Kind.REFLEX: 3.5, Kind.INSTANT: 1.0}
        )
        family = FAMILIES[kind]
        grip, hump, flash, dial, eyepiece = (chance(rng, p) for p in family.features)
        width = uniform(rng, *family.width)
        height = uniform(rng, *family.height)
        depth = uniform(rng, *family.depth)
        lens_z = height * uniform(rng, 0.46, 0.54)
        radius = (min(lens_z, height - lens_z) - CLEARANCE_M) * uniform(rng, *family.lens_radius)
        length = uniform(rng, *family.lens_length)
        edge = uniform(rng, *family.edge)
        longest = balanced_length(
            body_m3=width * height * depth, depth_m=depth, edge_m=edge, radius_m=radius
        )
        room = LONGEST_M - depth - EYEPIECE_M[1]
        count = 2 + int(length / 0.022)
        steps = [uniform(rng, 0.86, 1.0) for _ in range(count)]
        return cls(
            kind=kind,
            width_m=width,
            height_m=height,
            depth_m=depth,
            corner_m=0.5 * depth * uniform(rng, *family.corner),
            edge_m=edge,
            lens_x_m=width
            * (uniform(rng, -0.04, 0.1) if kind is Kind.COMPACT else uniform(rng, -0.02, 0.05)),
            lens_z_m=lens_z,
            lens_radius_m=radius,
            lens_length_m=min(length, longest, room),
            rings=tuple(step / max(steps) for step in steps),
            grip_m=uniform(rng, 0.006, 0.009 if kind is not Kind.REFLEX else 0.018)
            if grip
            else 0.0,
            grip_width_m=uniform(rng, 0.020, 0.030),
            hump_m=uniform(rng, 0.012, 0.022) if hump else 0.0,
            hump_width_m=uniform(rng, 0.040, 0.056),
            flash=flash,
            dial_m=uniform(rng, 0.0075, 0.0105) if dial else 0.0,
            eyepiece_m=uniform(rng, *EYEPIECE_M) if eyepiece else 0.0,
        )


def balanced_length(*, body_m3: float, depth_m: float, edge_m: float, radius_m: float) -> float:
    """Longest lens (metres) with which a camera of uniform density does not tip over.

    With a = pi r^2, d the depth and s the allowed offset, `BALANCE` (d / 2 - edge), the centre of
    mass is s before the middle where a L (d + L) / 2 = s (V + a L).
    """
    area = np.pi * radius_m**2
    offset = BALANCE * (0.5 * depth_m - edge_m)
    linear = 0.5 * depth_m - offset
    return float(np.sqrt(linear**2 + 2.0 * offset * body_m3 / area) - linear)


def generate(rng: np.random.Generator) -> trimesh.Trimesh:
    """Draw and build a camera: origin at the centre of its body's base, lens along -y."""
    return build(CameraParams.draw(rng))


def build(params: CameraParams) -> trimesh.Trimesh:
    """Build the camera that the parameters describe."""
    body, lens, trim = strips(0.55, 0.25, 0.2)
    case = slab(
        half_x_m=0.5 * params.width_m,
        half_y_m=0.5 * params.depth_m,
        height_m=params.height_m,
        corner_m=max(params.corner_m, params.edge_m + 0.0005),
        edge_m=params.edge_m,
        rect=body,
    ).solid()
    # Windows are cut first: the lens may stand before one.
    for window in _windows(params, trim):
        case -= window.solid()
    parts = [_lens(params, lens), _screen(params, trim), *_top(params, trim)]
    if params.grip_m:
        parts.append(_grip(params, body))
    if params.hump_m:
        parts += _hump(params, trim)
    elif params.eyepiece_m:
        parts.append(_eyepiece(params, trim))
    return finish(case + union(parts))


def _lens(params: CameraParams, rect: Rect) -> Part:
    """Turn the barrel: rings of different radii, and a front element sunk into the last."""
    length, radius = params.lens_length_m, params.lens_radius_m
    edges = np.concatenate(
        [[-SUNK_M], length * np.arange(1, len(params.rings) + 1) / len(params.rings)]
    )
    barrel = section.box_section(radius_m=0.9 * radius, z0_m=-SUNK_M, z1_m=length)
    for ring, low, high in zip(params.rings, edges[:-1], edges[1:], strict=True):
        # A gap shows where a ring ends.
        barrel += section.box_section(
            radius_m=ring * radius, z0_m=float(low) + 0.0006, z1_m=float(high) - 0.0006
        )
    last = 0.9 * radius if params.rings[-1] < 0.9 else params.rings[-1] * radius
    sunk = min(0.006, 0.5 * length)
    glass = 0.74 * last
    mouth, rim = 0.9 * last, length - 0.001
    front = section.section_from_curve(
        np.array([[glass, length - sunk], [mouth, rim], [mouth, length + 0.01]])
    )
    # The front element: a cap of a sphere whose rim lies on the bottom of the cone.
    angle = np.linspace(0.45, 0.0, 10)
    ball = glass / np.sin(0.45)
    dome = np.column_stack(
        [ball * np.sin(angle), length - sunk + ball * (np.cos(angle) - np.cos(0.45))]
    )
    bulge = section.section_from_curve(
        np.concatenate([[[glass, length - sunk - 0.001]], dome])
    ) ^ section.box_section(radius_m=1.0, z0_m=-1.0, z1_m=length - 0.0005)
    cut = section.round_convex(barrel, 0.0005) - front + bulge
    (curve,) = section.half_profiles(cut)
    part = loft(curve, circle(radius), rect=rect)
    return part.moved(
        rotation=Z_TO_FRONT, offset=(params.lens_x_m, -0.5 * params.depth_m, params.lens_z_m)
    )


def _screen(params: CameraParams, rect: Rect) -> Part:
    """Raise the screen from the back."""
    room = params.height_m - 2.0 * params.edge_m
    half_z = 0.36 * room
    return slab(
        half_x_m=min(1.4 * half_z, 0.3 * params.width_m),
        half_y_m=half_z,
        height_m=SUNK_M + 0.0018,
        corner_m=0.0025,
        edge_m=0.0008,
        rect=rect,
    ).moved(
        rotation=Z_TO_BACK,
        offset=(0.08 * params.width_m, 0.5 * params.depth_m - SUNK_M, 0.46 * params.height_m),
    )


def _top(params: CameraParams, rect: Rect) -> list[Part]:
    """Place the shutter button, the dial, the flash or its shoe on the top plate."""
    top = params.height_m
    middle = -0.5 * params.width_m + 0.5 * params.grip_width_m + 0.006
    forward = -0.12 * params.depth_m
    parts = [
        disc(radius_m=0.0055, height_m=SUNK_M + 0.0022, edge_m=0.0007, rect=rect).moved(
            offset=(middle, forward, top - SUNK_M)
        )
    ]
    if params.dial_m:
        radius = min(params.dial_m, 0.32 * params.depth_m)
        parts.append(
            disc(radius_m=radius, height_m=SUNK_M + 0.0055, edge_m=0.0008, rect=rect).moved(
                offset=(middle + radius + 0.009, 0.02 * params.depth_m, top - SUNK_M)
            )
        )
    if not params.hump_m and params.kind is not Kind.INSTANT:
        shoe = slab(
            half_x_m=0.0095,
            half_y_m=min(0.0090, 0.3 * params.depth_m),
            height_m=SUNK_M + 0.0020,
            corner_m=0.0015,
            edge_m=0.0006,
            rect=rect,
        )
        parts.append(shoe.moved(offset=(params.lens_x_m, 0.0, top - SUNK_M)))
    return parts


def _grip(params: CameraParams, rect: Rect) -> Part:
    """Stand the grip on the table before the body, on the photographer's right."""
    half_y = 0.5 * (params.grip_m + 0.5 * params.depth_m)
    half_x = 0.5 * params.grip_width_m
    corner = 0.92 * min(half_x, half_y)
    front = -0.5 * params.depth_m - params.grip_m
    return slab(
        half_x_m=half_x,
        half_y_m=half_y,
        height_m=0.94 * params.height_m,
        corner_m=corner,
        edge_m=min(params.edge_m + 0.001, 0.8 * corner),
        rect=rect,
    ).moved(offset=(-0.5 * params.width_m + half_x + 0.002, front + half_y, 0.0))


def _hump(params: CameraParams, rect: Rect) -> list[Part]:
    """Set the prism's hump on the top plate, with a flash shoe above and the eyepiece behind."""
    half_x, half_y = 0.5 * params.hump_width_m, 0.46 * params.depth_m
    corner = 0.6 * min(half_x, half_y)
    ring, reach = rounded_rectangle(half_x_m=half_x, half_y_m=half_y, corner_m=corner)
    slope = 0.62 * corner
    side = section.fillet(
        [
            (reach, -SUNK_M),
            (reach, 0.0),
            (reach - slope, params.hump_m),
            (reach - corner + 1e-4, params.hump_m),
        ],
        radius_m=0.005,
        steps=5,
    )
    ends = np.array([[[0.0, -SUNK_M]], [[0.0, params.hump_m]]])
    curve = np.concatenate([ends[0], side[:-1], ends[1]])
    x, top = params.lens_x_m, params.height_m
    parts = [
        loft(curve, ring, rect=rect).moved(offset=(x, 0.0, top)),
        slab(
            half_x_m=0.0095,
            half_y_m=min(0.0090, 0.2 * params.depth_m),
            height_m=SUNK_M + 0.0018,
            corner_m=0.0015,
            edge_m=0.0006,
            rect=rect,
        ).moved(offset=(x, 0.0, top + params.hump_m - SUNK_M)),
    ]
    if params.eyepiece_m:
        sunk = 0.5 * params.depth_m
        parts.append(
            slab(
                half_x_m=0.015,
                half_y_m=0.0095,
                height_m=sunk + params.eyepiece_m,
                corner_m=0.005,
                edge_m=0.0015,
                rect=rect,
            ).moved(
                rotation=Z_TO_BACK,
                offset=(x, 0.5 * params.depth_m - sunk, top + 0.10 * params.hump_m),
            )
        )
    return parts


def _eyepiece(params: CameraParams, rect: Rect) -> Part:
    """Frame the viewfinder's window at the back of a camera without a hump."""
    return slab(
        half_x_m=0.009,
        half_y_m=0.0065,
        height_m=SUNK_M + 0.5 * params.eyepiece_m,
        corner_m=0.003,
        edge_m=0.001,
        rect=rect,
    ).moved(
        rotation=Z_TO_BACK,
        offset=(
            -0.34 * params.width_m,
            0.5 * params.depth_m - SUNK_M,
            params.height_m - params.edge_m - 0.008,
        ),
    )


def _windows(params: CameraParams, rect: Rect) -> list[Part]:
    """Cutters of the windows in the front: the viewfinder's, and the flash's where there is one."""
    if params.hump_m:
        return []
    depth = 0.0015
    clear = params.corner_m + 0.004
    half_z = min(0.0055, 0.08 * params.height_m)
    z = params.height_m - params.edge_m - half_z - 0.003
    places = [(0.5 * params.width_m - clear - 0.009, 0.008)] if params.flash else []
    if params.kind is not Kind.COMPACT:
        places.append((params.lens_x_m if not params.flash else -0.12 * params.width_m, 0.0065))
    return [
        slab(
            half_x_m=half_x,
            half_y_m=half_z,
            height_m=0.02,
            corner_m=0.002,
            edge_m=0.0003,
            rect=rect,
        ).moved(rotation=Z_TO_FRONT, offset=(x, -0.5 * params.depth_m + depth, z))
        for x, half_x in places
    ]
