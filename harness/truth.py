"""What is true of a scene: its meshes, and which object of a map is the target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harness.native import MeshTruth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.native import MappedObject
    from sim_scenes import SceneObject

ORACLE = "oracle"
"""The segmenter that stands for the truth."""

ON_TARGET_M = 0.010
"""Points of a mapped object within this distance of the target's mesh are of the target."""
MOST_ASKED = 1000
"""Of a mapped object's points, about so many are asked whose they are."""


class SceneFailure(Exception):
    """A scene that cannot be scored, with the reason."""


class TargetMissedError(SceneFailure):
    """No mapped object is the target."""


def mesh_truth(item: SceneObject) -> MeshTruth:
    """Prepare an object's true mesh, in the world, to be measured against."""
    vertices, faces = item.mesh_world()
    return MeshTruth(np.ascontiguousarray(vertices), faces.astype(np.uint32))


def find_mapped(
    mapped: Sequence[MappedObject], truths: Sequence[MeshTruth], *, name: str
) -> MappedObject:
    """Find the mapped object that is the target.

    More than half of its observed points must lie within `ON_TARGET_M` of the target's mesh, and
    nearer to it than to any other object's: an object beside the target does not stand for one
    that was missed, nor does a piece of the table. Of several the one with the most such points is
    taken. The category is not asked for: a wrong one costs the scores what it should.

    Parameters
    ----------
    mapped
        The map's objects.
    truths
        The true meshes of the scene's objects; the target's is the first.
    name
        The target's, for the message.

    Raises
    ------
    TargetMissedError
        No mapped object is the target.
    """
    best: MappedObject | None = None
    most, nearest_m = 0.0, np.inf
    for item in mapped:
        points = item.points_world
        some = np.ascontiguousarray(points[:: -(-len(points) // MOST_ASKED) or 1])
        distances_m = np.stack([truth.distances(some) for truth in truths])
        if len(some) == 0:
            continue
        own = (distances_m.argmin(axis=0) == 0) & (distances_m[0] <= ON_TARGET_M)
        nearest_m = min(nearest_m, float(np.median(distances_m[0])))
        if own.mean() > 0.5 and (count := own.mean() * len(points)) > most:
            best, most = item, count
    if best is None:
        where = "it is empty"
        if np.isfinite(nearest_m):
            where = f"the points of the nearest are {nearest_m:.3f} m off in the median"
        raise TargetMissedError(f"the map holds no object where {name} stands: {where}")
    return best
