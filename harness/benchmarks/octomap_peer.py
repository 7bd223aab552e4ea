"""Time the insertion of depth scans beside OctoMap, in one run.

    python -m harness.benchmarks.octomap_peer [--scans 20] [--threads 1] [--repeats 3]

Both insert the same 640 x 480 scans at 5 mm with free space: a table at z = 0 with a ball of 8 cm
radius on it, seen from an arc of 120 degrees, depth up to 1.5 m (the scene of
``crates/credence-map/benches/insert.rs``). The leaves are compared before the times are printed.
OctoMap comes as pyoctomap, with the extra ``dev``; its C++ code runs on one thread. Its time per
scan is measured through Python, which copies the points one by one: that copy is timed by itself
and taken off.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

RESOLUTION_M = 0.005
WIDTH, HEIGHT, FOCAL_PX = 640, 480, 525.0
BALL_M, MAX_DEPTH_M = 0.08, 1.5


def make_scan(index: int, *, count: int) -> tuple[Floats, Floats]:
    """Ray cast view `index` of `count`.

    Returns
    -------
    sensor : (3,) float64, metres
    points : (640 * 480, 3) float64, metres
    """
    angle = np.deg2rad(-60.0 + 120.0 * index / max(count - 1, 1))
    eye = np.array([0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.55])
    forward = np.array([0.0, 0.0, 0.05]) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    x, y = (u.ravel() - (WIDTH - 1) / 2) / FOCAL_PX, (v.ravel() - (HEIGHT - 1) / 2) / FOCAL_PX
    rays = np.stack([x, y, np.ones_like(x)], axis=1) @ np.stack(
        [right, np.cross(forward, right), forward]
    )
    table = np.full(len(rays), np.inf)
    np.divide(-eye[2], rays[:, 2], out=table, where=rays[:, 2] < 0.0)
    from_centre = eye - np.array([0.0, 0.0, BALL_M])
    a, b = np.sum(rays * rays, axis=1), rays @ from_centre
    inside = b * b - a * (from_centre @ from_centre - BALL_M**2)
    ball = np.where(inside > 0.0, (-b - np.sqrt(np.maximum(inside, 0.0))) / a, np.inf)
    depth_m = np.minimum(np.minimum(table, ball), MAX_DEPTH_M)
    return eye, eye + rays * depth_m[:, None]


def seconds_of_ours(scans: Sequence[tuple[Floats, Floats]]) -> tuple[float, int]:
    """Insert all scans; return the seconds and the number of leaves."""
    from harness.native import OccupancyMap

    tree = OccupancyMap(resolution_m=RESOLUTION_M)
    start = time.perf_counter()
    for sensor, points in scans:
        tree.insert_scan(sensor, points)
    return time.perf_counter() - start, len(tree.leaves()[0])


def seconds_of_octomap(scans: Sequence[tuple[Floats, Floats]]) -> tuple[float, int]:
    """Insert all scans; return the seconds without the copy of the points, and the leaves."""
    octomap: Any = import_module("pyoctomap")
    tree = octomap.OcTree(RESOLUTION_M)
    start = time.perf_counter()
    for sensor, points in scans:
        tree.insertPointCloud(points, sensor)
    total = time.perf_counter() - start
    # With a range of next to nothing every ray ends in its own voxel: what is left is the copy.
    tiny = octomap.OcTree(RESOLUTION_M)
    start = time.perf_counter()
    for sensor, points in scans:
        tiny.insertPointCloud(points, sensor, 1e-9)
    return total - (time.perf_counter() - start), tree.getNumLeafNodes()


def say(line: str) -> None:
    """Write a line of the result at once: a run takes minutes."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print seconds per scan for both, and the ratio; 1 if their leaves differ in number."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--scans", type=int, default=20)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args(arguments)
    # Read when the threads start, at the earliest at the import of the extension.
    os.environ["RAYON_NUM_THREADS"] = str(options.threads)

    scans = [make_scan(index, count=options.scans) for index in range(options.scans)]
    say(
        f"{options.scans} scans of {WIDTH} x {HEIGHT} at {RESOLUTION_M * 1e3:.0f} mm with free "
        f"space, ours on {options.threads} thread(s)"
    )
    theirs_s, their_leaves = seconds_of_octomap(scans)
    runs = [seconds_of_ours(scans) for _ in range(options.repeats)]
    ours_s = statistics.median(seconds for seconds, _ in runs)
    our_leaves = runs[0][1]
    peer = f"pyoctomap {version('pyoctomap')}"
    say(f"{peer:>18}: {theirs_s / options.scans:8.3f} s per scan, {their_leaves} leaves")
    say(f"{'ours':>18}: {ours_s / options.scans:8.3f} s per scan, {our_leaves} leaves")
    say(f"{'ratio':>18}: {theirs_s / ours_s:8.1f}")
    if our_leaves != their_leaves:
        sys.stderr.write("octomap_peer: the maps differ; the times compare different work\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
