"""How close a cloud is to the true surface: on the whole, where a view saw it, and where none did.

Points are measured against the mesh itself, the mesh by points drawn evenly over its surface:

    accuracy      mean distance of the cloud's points to the mesh
    completeness  mean distance of the surface's samples to the nearest point of the cloud
    Chamfer       (accuracy + completeness) / 2: the mean of both directions' mean distances
    F at t        harmonic mean of the share of points within t of the mesh and the share of
                  samples within t of the cloud (Knapitsch et al. 2017, "Tanks and Temples")

A sample is seen if an observed point lies within `SEEN_WITHIN_M` of it: the hidden face of a thin
wall whose other face was observed counts as seen. A point of the cloud is seen if the sample
nearest to it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from harness.completion.clouds import nearest_m
from harness.drawn_points import surface_points
from harness.native import MeshTruth
from sim_scenes.streams import stream

if TYPE_CHECKING:
    import numpy.typing as npt

    from sim_scenes import SceneObject

    Floats = npt.NDArray[np.float64]
    Flags = npt.NDArray[np.bool_]

SURFACE_SAMPLES = 4096
SEEN_WITHIN_M = 0.005
CLOSE_M = 0.005
"""Within this distance of the mesh a completed point is right."""
WIDE_M = 0.010
MM = 1000.0
PARTS = ("all", "seen", "unseen")


@dataclass(frozen=True, eq=False)
class Surface:
    """The true surface of an object.

    Attributes
    ----------
    truth
        Its mesh, in the world.
    samples_world : (n, 3) float64
        Points spread evenly over it by area, metres.
    seen : (n,) bool
        Whether an observed point lies near each.
    """

    truth: MeshTruth
    samples_world: Floats
    seen: Flags

    @classmethod
    def of(
        cls,
        target: SceneObject,
        *,
        observed_world: Floats,
        seed: int,
        count: int = SURFACE_SAMPLES,
    ) -> Surface:
        """Sample an object's surface and mark what observed points (m, 3) show of it."""
        vertices, faces = target.mesh_world()
        samples = surface_points(
            vertices, faces, count=count, random=stream(seed, "completion surface")
        )
        return cls(
            truth=MeshTruth(np.ascontiguousarray(vertices), faces.astype(np.uint32)),
            samples_world=samples,
            seen=nearest_m(samples, observed_world) <= SEEN_WITHIN_M,
        )


@dataclass(frozen=True)
class CloudScore:
    """What a cloud, or a part of it, is worth; None where a part has no point or no sample.

    Attributes
    ----------
    points
        Number of the cloud's points in the part.
    chamfer_mm, accuracy_mm, completeness_mm
        See the module's documentation.
    f_5mm, f_10mm
        F-scores, in [0, 1].
    within_5mm
        Share of the points within 5 mm of the mesh.
    """

    points: int
    chamfer_mm: float | None
    accuracy_mm: float | None
    completeness_mm: float | None
    f_5mm: float | None
    f_10mm: float | None
    within_5mm: float | None


@dataclass(frozen=True, eq=False)
class Measured:
    """A cloud against the true surface.

    Attributes
    ----------
    scores
        By the names in `PARTS`.
    distances_m : (n,) float64
        Of each point to the mesh.
    """

    scores: dict[str, CloudScore]
    distances_m: Floats


def measure_cloud(points_world: Floats, surface: Surface) -> Measured:
    """Measure a cloud (n, 3), n > 0, in metres against a true surface."""
    points_world = np.ascontiguousarray(points_world)
    to_mesh = surface.truth.distances(points_world)
    to_cloud = nearest_m(surface.samples_world, points_world)
    _, nearest = cKDTree(surface.samples_world).query(points_world)
    of_point = surface.seen[nearest]
    parts = {
        "all": (np.ones_like(of_point), np.ones_like(surface.seen)),
        "seen": (of_point, surface.seen),
        "unseen": (~of_point, ~surface.seen),
    }
    scores = {
        name: score_distances(to_mesh[points], to_cloud[samples])
        for name, (points, samples) in parts.items()
    }
    return Measured(scores, to_mesh)


def score_distances(to_mesh_m: Floats, to_cloud_m: Floats) -> CloudScore:
    """Score the distances (n,) of points to the mesh and (m,) of samples to the cloud."""
    accuracy = float(to_mesh_m.mean()) * MM if len(to_mesh_m) else None
    completeness = float(to_cloud_m.mean()) * MM if len(to_cloud_m) else None
    whole = accuracy is not None and completeness is not None
    return CloudScore(
        points=len(to_mesh_m),
        chamfer_mm=(accuracy + completeness) / 2 if whole else None,  # type: ignore[operator]
        accuracy_mm=accuracy,
        completeness_mm=completeness,
        f_5mm=_f_score(to_mesh_m, to_cloud_m, within_m=CLOSE_M) if whole else None,
        f_10mm=_f_score(to_mesh_m, to_cloud_m, within_m=WIDE_M) if whole else None,
        within_5mm=float((to_mesh_m <= CLOSE_M).mean()) if len(to_mesh_m) else None,
    )


def _f_score(to_mesh_m: Floats, to_cloud_m: Floats, *, within_m: float) -> float:
    precision = float((to_mesh_m <= within_m).mean())
    recall = float((to_cloud_m <= within_m).mean())
    total = precision + recall
    return 2 * precision * recall / total if total > 0 else 0.0
