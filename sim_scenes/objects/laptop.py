"""Laptops, opened."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from sim_scenes.objects.draws import chance, uniform
from sim_scenes.objects.finish import finish
from sim_scenes.objects.part import Floats, Part, Rect, snap, strips, union
from sim_scenes.objects.primitives import Z_TO_RIGHT, disc, slab

if TYPE_CHECKING:
    import trimesh

# Keys stand a little below the top plate, in a well; where the base is wedged, both are shallower.
WELL_M = 0.0022
KEY_TOP_M = 0.0005
KEY_PITCH_M = 0.019
SPACE_BAR_KEYS = 5
TOUCHPAD_DEPTH_M = 0.0006
SCREEN_DEPTH_M = 0.0007


@dataclass(frozen=True)
class LaptopParams:
    """Shape of a laptop: lengths in metres; x runs along the hinge, -y towards the user.

    `base_m` is the base's thickness at the hinge and `front` its share at the front edge.
    `angle_rad` is between base and screen. `hinges` barrels of `hinge_length_m` share the back
    edge. The `keys` fill a rectangle of the base in `rows` with `key_gap_m` between them; the
    `touchpad`'s extents are shares of the base's width and of the room before the keyboard.
    """

    width_m: float
    depth_m: float
    base_m: float
    front: float
    lid_m: float
    corner_m: float
    edge_m: float
    angle_rad: float
    hinges: int
    hinge_length_m: float
    bezel_m: float
    chin_m: float
    key_gap_m: float
    keys: Rect
    rows: int
    touchpad: tuple[float, float]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> LaptopParams:
        """Draw a laptop 22-36 cm wide, opened by 95-130 degrees, that stands on its base."""
        width = uniform(rng, 0.222, 0.358)
        depth = width * uniform(rng, 0.62, 0.72)
        base = uniform(rng, 0.0085, 0.0195)
        # A lid lighter than the base keeps the whole from falling over backwards.
        lid = uniform(rng, 0.0040, max(0.0042, min(0.0088, 0.5 * base)))
        one_hinge = chance(rng, 0.4)
        side = width * uniform(rng, 0.035, 0.075)
        back = depth * uniform(rng, 0.10, 0.15)
        keys_depth = min(depth * uniform(rng, 0.40, 0.46), 0.112)
        high = 0.5 * depth - back
        return cls(
            width_m=width,
            depth_m=depth,
            base_m=base,
            front=uniform(rng, 0.55, 1.0) if chance(rng, 0.5) else 1.0,
            lid_m=lid,
            corner_m=uniform(rng, 0.003, 0.014),
            edge_m=uniform(rng, 0.0008, 0.0019),
            angle_rad=float(np.radians(uniform(rng, 95.5, 129.5))),
            hinges=1 if one_hinge else 2,
            hinge_length_m=width
            * (uniform(rng, 0.55, 0.8) if one_hinge else uniform(rng, 0.10, 0.20)),
            bezel_m=uniform(rng, 0.004, 0.014),
            chin_m=uniform(rng, 0.010, 0.024),
            key_gap_m=uniform(rng, 0.0022, 0.0042),
            keys=Rect(side - 0.5 * width, high - keys_depth, 0.5 * width - side, high),
            rows=6 if chance(rng, 0.7) else 5,
            touchpad=(uniform(rng, 0.26, 0.46), uniform(rng, 0.66, 0.88)),
        )

    @property
    def pivot_m(self) -> tuple[float, float]:
        """Axis (y, z) of the hinge."""
        radius = self.hinge_radius_m
        return 0.5 * self.depth_m - radius, self.base_m - 0.2 * radius

    @property
    def hinge_radius_m(self) -> float:
        """Radius of the hinge's barrels: they hold the lower edge of the lid."""
        return 0.5 * self.lid_m + 0.0012

    @property
    def lid_length_m(self) -> float:
        """Extent of the lid from the hinge's axis to its free edge."""
        return self.depth_m - self.hinge_radius_m


def generate(rng: np.random.Generator) -> trimesh.Trimesh:
    """Draw and build a laptop: origin at the centre of its base, screen towards -y."""
    return build(LaptopParams.draw(rng))


def build(params: LaptopParams) -> trimesh.Trimesh:
    """Build the laptop that the parameters describe."""
    base, lid, picture, keys, spare = strips(0.28, 0.22, 0.3, 0.12, 0.08)
    deck = slab(
        half_x_m=0.5 * params.width_m,
        half_y_m=0.5 * params.depth_m,
        height_m=params.base_m,
        corner_m=params.corner_m,
        edge_m=params.edge_m,
        rect=base,
    )
    well, touchpad = _well(params, spare), _touchpad(params, spare)
    solid = _wedged(params, deck).solid() - _wedged(params, well).solid()
    solid -= _wedged(params, touchpad).solid()
    solid += _wedged(params, _keyboard(params, keys)).solid()
    solid += _lid(params, lid).solid() - _picture(params, picture).solid()
    return finish(solid + union(_hinges(params, spare)))


def _wedged(params: LaptopParams, part: Part) -> Part:
    """Thin a part of the base towards the front, where y = -depth / 2."""
    share = 0.5 + part.vertices[:, 1] / params.depth_m
    scale = params.front + (1.0 - params.front) * share
    height = part.vertices[:, 2] * scale
    return replace(part, vertices=snap(np.column_stack([part.vertices[:, :2], height])))


def _well(params: LaptopParams, rect: Rect) -> Part:
    """Cutter of the well that the keys stand in."""
    keys, margin = params.keys, 0.0015
    return _plate(
        Rect(keys.u0 - margin, keys.v0 - margin, keys.u1 + margin, keys.v1 + margin),
        low_m=params.base_m - WELL_M,
        high_m=params.base_m + 0.01,
        corner_m=0.002,
        rect=rect,
    )


def _touchpad(params: LaptopParams, rect: Rect) -> Part:
    """Cutter of the touchpad's recess, between the keyboard and the front edge."""
    room = params.keys.v0 + 0.5 * params.depth_m
    half_x = 0.5 * params.touchpad[0] * params.width_m
    middle = params.keys.v0 - 0.5 * room
    half_y = 0.5 * params.touchpad[1] * (room - 0.004)
    return _plate(
        Rect(-half_x, middle - half_y, half_x, middle + half_y),
        low_m=params.base_m - TOUCHPAD_DEPTH_M,
        high_m=params.base_m + 0.01,
        corner_m=0.003,
        rect=rect,
    )


def _plate(place: Rect, *, low_m: float, high_m: float, corner_m: float, rect: Rect) -> Part:
    """Slab over a horizontal rectangle (metres)."""
    return slab(
        half_x_m=0.5 * (place.u1 - place.u0),
        half_y_m=0.5 * (place.v1 - place.v0),
        height_m=high_m - low_m,
        corner_m=corner_m,
        edge_m=0.0003,
        rect=rect,
    ).moved(offset=(0.5 * (place.u0 + place.u1), 0.5 * (place.v0 + place.v1), low_m))


def _keyboard(params: LaptopParams, rect: Rect) -> Part:
    """Lay out the keys: full rows, and a space bar in the nearest."""
    field = params.keys
    columns = max(int((field.u1 - field.u0) / KEY_PITCH_M), SPACE_BAR_KEYS + 4)
    left = (columns - SPACE_BAR_KEYS) // 2
    places = []
    for row in range(params.rows):
        edges = list(range(columns + 1))
        if row == 0:
            edges = edges[: left + 1] + edges[left + SPACE_BAR_KEYS :]
        gap_u = 0.5 * params.key_gap_m / (field.u1 - field.u0)
        gap_v = 0.5 * params.key_gap_m / (field.v1 - field.v0)
        places += [
            Rect(
                start / columns + gap_u,
                row / params.rows + gap_v,
                stop / columns - gap_u,
                (row + 1) / params.rows - gap_v,
            )
            for start, stop in pairwise(edges)
        ]
    low, high = params.base_m - WELL_M - 0.001, params.base_m - KEY_TOP_M
    return _boxes(places, field=field, low_m=low, high_m=high, rect=rect)


def _boxes(places: list[Rect], *, field: Rect, low_m: float, high_m: float, rect: Rect) -> Part:
    """Upright boxes over rectangles that are relative to `field` (metres), textured from above."""
    corner_uv = np.array([[(p.u0, p.v0), (p.u1, p.v0), (p.u1, p.v1), (p.u0, p.v1)] for p in places])
    flat = field.place(corner_uv)
    level = np.broadcast_to(np.array([low_m, high_m])[None, :, None, None], (len(places), 2, 4, 1))
    plan = np.broadcast_to(flat[:, None], (len(places), 2, 4, 2))
    vertices = np.concatenate([plan, level], axis=-1).reshape(-1, 3)
    uv = np.broadcast_to(corner_uv[:, None], (len(places), 2, 4, 2)).reshape(-1, 2)
    box = np.array(
        [
            [0, 2, 1],
            [0, 3, 2],
            [4, 5, 6],
            [4, 6, 7],
            [0, 1, 5],
            [0, 5, 4],
            [1, 2, 6],
            [1, 6, 5],
            [2, 3, 7],
            [2, 7, 6],
            [3, 0, 4],
            [3, 4, 7],
        ]
    )
    faces = (8 * np.arange(len(places))[:, None, None] + box).reshape(-1, 3)
    return Part(snap(vertices), rect.place(uv), faces)


def _upright(params: LaptopParams, part: Part) -> Part:
    """Open the lid about the hinge.

    A part is given closed and face up: y along the lid from the hinge on, z its outward thickness
    from the middle on.
    """
    cosine, sine = float(np.cos(params.angle_rad)), float(np.sin(params.angle_rad))
    rotation: Floats = np.array([[-1.0, 0.0, 0.0], [0.0, -cosine, sine], [0.0, sine, cosine]])
    return part.moved(rotation=rotation, offset=(0.0, *params.pivot_m))


def _lid(params: LaptopParams, rect: Rect) -> Part:
    """Stand the lid up, its lower edge within the hinge's barrels."""
    length = params.lid_length_m
    lid = slab(
        half_x_m=0.5 * params.width_m,
        half_y_m=0.5 * length,
        height_m=params.lid_m,
        corner_m=params.corner_m,
        edge_m=min(params.edge_m, 0.4 * params.lid_m),
        rect=rect,
    )
    return _upright(params, lid.moved(offset=(0.0, 0.5 * length, -0.5 * params.lid_m)))


def _picture(params: LaptopParams, rect: Rect) -> Part:
    """Cutter of the screen, sunk into its frame."""
    chin, top = params.hinge_radius_m + params.chin_m, params.lid_length_m - params.bezel_m
    half_x = 0.5 * params.width_m - params.bezel_m
    inner = -0.5 * params.lid_m
    place = Rect(-half_x, chin, half_x, top)
    cutter = _plate(
        place, low_m=inner - 0.01, high_m=inner + SCREEN_DEPTH_M, corner_m=0.0015, rect=rect
    )
    return _upright(params, cutter)


def _hinges(params: LaptopParams, rect: Rect) -> list[Part]:
    """Lay the hinge's barrels along the back edge."""
    length = params.hinge_length_m
    middles = [0.0] if params.hinges == 1 else [-0.3 * params.width_m, 0.3 * params.width_m]
    barrel = disc(radius_m=params.hinge_radius_m, height_m=length, edge_m=0.0006, rect=rect)
    return [
        barrel.moved(rotation=Z_TO_RIGHT, offset=(middle - 0.5 * length, *params.pivot_m))
        for middle in middles
    ]
