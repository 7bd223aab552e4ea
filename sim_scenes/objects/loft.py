"""Surfaces from curves: lofts of a profile around an outline, and sweeps along a path."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from sim_scenes.objects.part import Floats, Part, Rect, snap

if TYPE_CHECKING:
    from collections.abc import Callable

# The horizontal ring (n, 2), metres, of a body where its profile stands at (r, z).
Ring: TypeAlias = "Callable[[float, float], Floats]"

# Where a loft's wall and its two flat caps lie within its texture rectangle.
WALL = Rect(0.0, 0.0, 1.0, 0.66)
# Caps flatter than this are seen from above in the texture, others with the wall.
FLAT_SLOPE = 0.3
CAPS = (Rect(0.01, 0.69, 0.49, 1.0), Rect(0.51, 0.69, 0.99, 1.0))


def loft(profile: Floats, ring: Ring, *, rect: Rect) -> Part:
    """Carry a profile around the z axis.

    Parameters
    ----------
    profile
        Curve (k, 2) of (r, z), metres, from the axis to the axis, the body on its left.
    ring
        The outline at each point of the profile.
    rect
        Texture rectangle: u follows the outline and v the length of the profile; flat caps are
        charts of their own, seen from above.
    """
    rings = [ring(float(r), float(z)) for r, z in profile[1:-1]]
    count = len(rings[0])
    levels = len(rings)
    heights = profile[1:-1, 1]
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    share = length / length[-1]

    around = np.arange(count + 1)
    grid = np.stack(
        [
            np.column_stack([xy[around % count], np.full(count + 1, z)])
            for xy, z in zip(rings, heights, strict=True)
        ]
    )
    uv = np.stack(np.broadcast_arrays(around[None, :] / count, share[1:-1, None]), axis=-1)
    vertices = [grid.reshape(-1, 3)]
    charts = [WALL.within(rect).place(uv.reshape(-1, 2))]

    level, j = np.meshgrid(np.arange(levels - 1), np.arange(count), indexing="ij")
    a = (level * (count + 1) + j).reshape(-1)
    b, c, d = a + 1, a + count + 2, a + count + 1
    faces = [np.column_stack([a, b, c]), np.column_stack([a, c, d])]

    base = levels * (count + 1)
    for cap, chart in enumerate(CAPS):
        end, z = (0, profile[0, 1]) if cap == 0 else (levels - 1, profile[-1, 1])
        edge = grid[end, :-1]
        pole = np.tile([0.0, 0.0, z], (count, 1))
        if abs(edge[0, 2] - z) < FLAT_SLOPE * float(np.abs(edge[:, 0]).max()):
            # A flat cap: planar chart over the outline's bounding box.
            low, high = edge[:, :2].min(axis=0), edge[:, :2].max(axis=0)
            plane = np.concatenate([edge, pole])
            vertices.append(plane)
            charts.append(chart.within(rect).place((plane[:, :2] - low) / (high - low)))
            first = base + np.arange(count)
            second = base + (np.arange(count) + 1) % count
            tip = base + count + np.arange(count)
            base += 2 * count
        else:
            vertices.append(pole)
            middle = np.column_stack([(np.arange(count) + 0.5) / count, np.full(count, float(cap))])
            charts.append(WALL.within(rect).place(middle))
            first = end * (count + 1) + np.arange(count)
            second = first + 1
            tip = base + np.arange(count)
            base += count
        order = [tip, second, first] if cap == 0 else [tip, first, second]
        faces.append(np.column_stack(order))

    return Part(snap(np.concatenate(vertices)), np.concatenate(charts), np.concatenate(faces))


def sweep(
    path: Floats,
    *,
    half_width: Floats,
    half_depth: Floats,
    exponent: float,
    sections: int,
    rect: Rect,
) -> Part:
    """Carry a superelliptic section along a path in the xz plane.

    Parameters
    ----------
    path
        Points (k, 2) of (x, z), metres; its radius of curvature stays above `half_depth`.
    half_width, half_depth
        Half extents (k,) of the section along y and in the path's plane, metres.
    exponent
        Of the superellipse: 2 is an ellipse, more is squarer.
    sections
        Points around the section.
    rect
        Texture rectangle: u around the section, v along the path.
    """
    step = np.gradient(path, axis=0)
    tangent = step / np.linalg.norm(step, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(sections) / sections
    cosine, sine = np.cos(angle), np.sin(angle)
    across = np.sign(cosine) * np.abs(cosine) ** (2 / exponent)
    aside = np.sign(sine) * np.abs(sine) ** (2 / exponent)

    # In-plane normal of the path; with y it spans the section.
    in_plane = half_depth[:, None] * across
    x = path[:, :1] - tangent[:, 1:] * in_plane
    z = path[:, 1:] + tangent[:, :1] * in_plane
    y = -half_width[:, None] * aside
    grid = np.stack([x, y, z], axis=-1)
    grid = np.concatenate([grid, grid[:, :1]], axis=1)

    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    uv = np.stack(
        np.broadcast_arrays(
            np.arange(sections + 1)[None, :] / sections, (length / length[-1])[:, None]
        ),
        axis=-1,
    )
    ends = np.array([[path[k, 0], 0.0, path[k, 1]] for k in (0, -1)])
    vertices = np.concatenate([grid.reshape(-1, 3), ends])
    coordinates = np.concatenate([uv.reshape(-1, 2), [[0.5, 0.0], [0.5, 1.0]]])

    level, j = np.meshgrid(np.arange(len(path) - 1), np.arange(sections), indexing="ij")
    a = (level * (sections + 1) + j).reshape(-1)
    b, c, d = a + 1, a + sections + 2, a + sections + 1
    start, stop = len(vertices) - 2, len(vertices) - 1
    first = np.arange(sections)
    last = (len(path) - 1) * (sections + 1) + first
    faces = np.concatenate(
        [
            np.column_stack([a, b, c]),
            np.column_stack([a, c, d]),
            np.column_stack([np.full(sections, start), first + 1, first]),
            np.column_stack([np.full(sections, stop), last, last + 1]),
        ]
    )
    return Part(snap(vertices), rect.place(coordinates), faces)
