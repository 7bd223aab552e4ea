"""Time distances to meshes beside trimesh, libigl and Open3D, in one run, against the faces.

    python -m harness.benchmarks.score_peer [--queries 100000] [--threads 2] [--repeats 3]

trimesh comes with the project (its fast search needs `rtree`); libigl (``pip install libigl``) and
Open3D (``pip install open3d``, best in an environment of its own) join where they are installed.
All get the same mesh, points and number of threads, and their distances are compared before their
times are. trimesh is timed on the first 2,000 points. Open3D computes in float32, the others in
float64; trimesh has one thread only.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]
    Faces = npt.NDArray[np.uint32]
    Distances = Callable[[Floats], Floats]

RINGS = (25, 50, 100, 200, 400)
PADDING_M = 0.03
TRIMESH_QUERIES = 2_000


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A library that measures distances.

    Attributes
    ----------
    package : distribution whose version is reported
    modules : what it needs
    prepare : vertices (n, 3), faces (m, 3) -> points (k, 3) -> distances (k,), metres
    tolerance_m : how far its distances may lie from ours
    queries : number of points that it is timed on, all where None
    """

    package: str
    modules: tuple[str, ...]
    prepare: Callable[[Floats, Faces], Distances]
    tolerance_m: float = 1e-9
    queries: int | None = None

    def usable(self) -> bool:
        """Import what it needs; where that fails, say why and leave the peer out."""
        try:
            for module in self.modules:
                import_module(module)
        except ImportError as error:
            sys.stderr.write(f"score_peer: {self.package} is left out: {error}\n")
            return False
        return True


def bumpy_torus(*, rings: int) -> tuple[Floats, Faces]:
    """Build a torus the size of a bowl whose tube's radius is wavy by 15 %.

    Returns
    -------
    vertices : (0.4 rings^2, 3) float64, metres
    faces : (0.8 rings^2, 3) uint32
    """
    sides = rings * 2 // 5
    ring, side = (
        index.ravel() for index in np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    )
    around, across = 2 * np.pi * ring / rings, 2 * np.pi * side / sides
    tube = 0.015 * (1 + 0.15 * np.sin(5 * around) * np.cos(3 * across))
    radius = 0.04 + tube * np.cos(across)
    vertices = np.stack(
        [radius * np.cos(around), radius * np.sin(around), tube * np.sin(across)], axis=1
    )

    def corner(ring_step: int, side_step: int) -> npt.NDArray[np.int64]:
        return (ring + ring_step) % rings * sides + (side + side_step) % sides

    faces = np.concatenate(
        [
            np.stack([corner(0, 0), corner(1, 0), corner(1, 1)], axis=1),
            np.stack([corner(0, 0), corner(1, 1), corner(0, 1)], axis=1),
        ]
    )
    return vertices, faces.astype(np.uint32)


def prepare_ours(vertices: Floats, faces: Faces) -> Distances:
    """Distances by Credence's scorer."""
    from harness.native import MeshTruth

    return MeshTruth(vertices, faces).distances


def prepare_trimesh(vertices: Floats, faces: Faces) -> Distances:
    """Closest points by trimesh, which holds the faces in an R-tree."""
    trimesh: Any = import_module("trimesh")
    mesh = trimesh.Trimesh(vertices, faces, process=False)

    def distances(points: Floats) -> Floats:
        found: Floats = trimesh.proximity.closest_point(mesh, points)[1]
        return found

    return distances


def prepare_libigl(vertices: Floats, faces: Faces) -> Distances:
    """Squared distances by libigl, whose tree of axis-aligned boxes is built once."""
    igl: Any = import_module("igl")
    signed_indices = faces.astype(np.int64)
    tree = igl.AABB()
    tree.init(vertices, signed_indices)

    def distances(points: Floats) -> Floats:
        squared: Floats = tree.squared_distance(vertices, signed_indices, points)[0]
        return np.asarray(np.sqrt(squared))

    return distances


def prepare_open3d(vertices: Floats, faces: Faces) -> Distances:
    """Distances by Open3D's ray casting scene, on Embree in float32."""
    open3d: Any = import_module("open3d")
    threads = int(os.environ["RAYON_NUM_THREADS"])
    scene = open3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(vertices.astype(np.float32), faces)

    def distances(points: Floats) -> Floats:
        found = scene.compute_distance(points.astype(np.float32), nthreads=threads)
        return np.asarray(found.numpy(), dtype=np.float64)

    return distances


PEERS = (
    Peer(
        package="trimesh",
        modules=("trimesh", "rtree"),
        prepare=prepare_trimesh,
        # It takes faces whose squared distances differ by less than 1e-8 for equally near.
        tolerance_m=1e-4,
        queries=TRIMESH_QUERIES,
    ),
    Peer(package="libigl", modules=("igl",), prepare=prepare_libigl),
    Peer(package="open3d", modules=("open3d",), prepare=prepare_open3d, tolerance_m=1e-6),
)


def microseconds_per_query(distances: Distances, *, points: Floats, repeats: int) -> float:
    """Median wall time per point, after one warm-up."""
    distances(points)
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        distances(points)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds) / len(points) * 1e6


def say(line: str) -> None:
    """Write a line of the result at once: a run takes a minute."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print microseconds per query for every library and mesh, and how they grow."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--queries", type=int, default=100_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args(arguments)
    # The libraries read these when they start their threads, at the earliest at their import.
    os.environ["RAYON_NUM_THREADS"] = os.environ["IGL_NUM_THREADS"] = str(options.threads)

    peers = [peer for peer in PEERS if peer.usable()]
    names = ["ours", *(f"{peer.package} {version(peer.package)}" for peer in peers)]
    say(
        f"us per distance query, {options.queries} points within {PADDING_M * 1e3:.0f} mm of a "
        f"bumpy torus's box, {options.threads} threads, median of {options.repeats}"
    )
    say(f"{'faces':>9}" + "".join(f"{name:>18}" for name in names))

    rng = np.random.default_rng(np.random.SeedSequence(7))
    rows = []
    for rings in RINGS:
        vertices, faces = bumpy_torus(rings=rings)
        low, high = vertices.min(axis=0) - PADDING_M, vertices.max(axis=0) + PADDING_M
        points = rng.uniform(low, high, size=(options.queries, 3))
        ours = prepare_ours(vertices, faces)
        expected = ours(points)
        row = [microseconds_per_query(ours, points=points, repeats=options.repeats)]
        for peer in peers:
            theirs = peer.prepare(vertices, faces)
            some = points[: peer.queries]
            np.testing.assert_allclose(
                theirs(some), expected[: peer.queries], rtol=0.0, atol=peer.tolerance_m
            )
            row.append(microseconds_per_query(theirs, points=some, repeats=options.repeats))
        say(f"{len(faces):>9}" + "".join(f"{value:>18.2f}" for value in row))
        rows.append((len(faces), row))

    (few, first), (many, last) = rows[0], rows[-1]
    growth = [after / before for before, after in zip(first, last, strict=True)]
    say(f"{'growth':>9}" + "".join(f"{f'{value:.1f}-fold':>18}" for value in growth))
    say(
        f"{many // few} times the faces: log(faces) grows {np.log(many) / np.log(few):.1f}-fold, "
        f"sqrt(faces) {(many / few) ** 0.5:.1f}-fold"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
