"""The mean shape of a category: the training shape that lies closest to all others.

Shapes are drawn from the generator's training split, so that none is an object of a test.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from harness.completion.clouds import nearest_m, spread_evenly
from harness.drawn_points import surface_points
from sim_scenes.objects.draws import Split
from sim_scenes.objects.generate import generate_object
from sim_scenes.streams import stream

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

SHAPES = 40
SEED = 0
COMPARED_POINTS = 512
SHAPE_POINTS = 2048
# Of these a shape's points are chosen.
DENSE_POINTS = 8192


@dataclass(frozen=True, eq=False)
class MeanShape:
    """A category's mean shape.

    Attributes
    ----------
    index
        Number of the shape in the training split.
    points_unit : (n, 3) float64
        Points spread evenly over it, scaled along each axis to the box from 0 to 1.
    """

    category: str
    index: int
    points_unit: Floats


@lru_cache
def mean_shape(category: str, *, shapes: int = SHAPES) -> MeanShape:
    """Find the medoid, by Chamfer distance, of a category's first training shapes in the unit box.

    Parameters
    ----------
    category
        One of the six.
    shapes
        How many to choose among.
    """
    dense = [_unit_points(category, index) for index in range(shapes)]
    index = medoid([points[:COMPARED_POINTS] for points in dense])
    return MeanShape(category, index, spread_evenly(dense[index], count=SHAPE_POINTS))


def medoid(clouds: Sequence[Floats]) -> int:
    """Find the cloud (n, 3) with the least sum of Chamfer distances to the others."""
    # Nearest distances from each cloud to each other one; their sum with the transpose is Chamfer.
    one_way = np.array(
        [[nearest_m(points, others).mean() for others in clouds] for points in clouds]
    )
    return int((one_way + one_way.T).sum(axis=1).argmin())


def _unit_points(category: str, index: int) -> Floats:
    """Points over a training shape in the unit box, in random order."""
    mesh = generate_object(split=Split.TRAIN, category=category, index=index, seed=SEED)
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    points = surface_points(
        vertices,
        np.asarray(mesh.faces, dtype=np.int64),
        count=DENSE_POINTS,
        random=stream(index, f"mean shape/{category}"),
    )
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return np.asarray((points - low) / (high - low))
