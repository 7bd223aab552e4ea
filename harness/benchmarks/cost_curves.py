"""Time and memory against training points, map resolution and number of scenes, as Markdown.

    python -m harness.benchmarks.cost_curves

Every row runs in a process of its own, whose highest resident memory is its row's. The machine
should have nothing else to do.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable


def measure_gp(training_points: int) -> str:
    """Time one posterior with variance and one likelihood with gradient."""
    from harness.benchmarks.gp_peer import LENGTHSCALE_M, MEANS, OUTPUTSCALE, training_problem
    from harness.native import gp_log_likelihood, gp_posterior

    points, labels, test = training_problem(training_points, 1000)
    scales: dict[str, Any] = {
        "lengthscales": np.full(2, LENGTHSCALE_M),
        "outputscales": np.full(2, OUTPUTSCALE),
        "means": np.array(MEANS),
    }
    start = time.perf_counter()
    gp_posterior(points=points, labels=labels, test_points=test, **scales)
    posterior_s = time.perf_counter() - start
    start = time.perf_counter()
    gp_log_likelihood(points=points, labels=labels, **scales)
    likelihood_s = time.perf_counter() - start
    return f"{posterior_s:.3f} | {likelihood_s:.3f}"


def measure_map(resolution_m: float) -> str:
    """Time three 640x480 views of one mug, from segmentation to voxels, and count what is kept."""
    from harness.config import Config
    from harness.runs.job import SceneJob
    from harness.scene_run import map_scene, simulate_job

    config = Config(pipeline={"map": {"resolution_m": resolution_m}})
    job = SceneJob(scene_id="mug-0000", category="mug", object_name="mug_test_000", seed=0)
    scene = simulate_job(job, config)
    start = time.perf_counter()
    pipeline = map_scene(scene, config=config)
    seconds = time.perf_counter() - start
    leaves = len(pipeline.occupancy().leaves()[1])
    voxels = len(pipeline.voxels().centres_world)
    return f"{seconds / len(scene.frames):.3f} | {leaves} | {voxels}"


def measure_scenes(scenes: int) -> str:
    """Time the benchmark with this many scenes of each class on two workers."""
    from harness.bench import BenchOptions, run_bench
    from harness.runs.records import read_timings

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        result = run_bench(BenchOptions(scenes=scenes, out=out, workers=2))
        timings = read_timings(out / "timings.parquet")
    peaks = [timing.peak_memory_mib for timing in timings if timing.peak_memory_mib is not None]
    return f"{result.seconds:.1f} | {max(peaks):.0f}"


@dataclass(frozen=True)
class Curve:
    """What is measured against what."""

    measure: Callable[[Any], str]
    values: tuple[float, ...]
    columns: tuple[str, ...]


CURVES = {
    "gp": Curve(
        measure_gp,
        (450, 900, 1800, 3600, 7200),
        ("training points", "posterior (s)", "likelihood and gradient (s)", "peak (MiB)"),
    ),
    "map": Curve(
        measure_map,
        (0.02, 0.01, 0.005, 0.0025),
        ("resolution (m)", "a frame (s)", "octree leaves", "semantic voxels", "peak (MiB)"),
    ),
    "scenes": Curve(
        measure_scenes,
        (1, 2, 4, 8),
        ("scenes of each class", "wall (s)", "a worker's peak (MiB)", "parent's peak (MiB)"),
    ),
}


def main() -> int:
    """Print all curves, or, as a child, one row."""
    if len(sys.argv) == 3:
        curve = CURVES[sys.argv[1]]
        value = next(value for value in curve.values if str(value) == sys.argv[2])
        row = curve.measure(value)
        peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"| {value} | {row} | {peak_mib:.0f} |")
        return 0
    for name, curve in CURVES.items():
        print(f"\n| {' | '.join(curve.columns)} |\n|{'---|' * len(curve.columns)}")
        for value in curve.values:
            command = [sys.executable, "-m", "harness.benchmarks.cost_curves", name, str(value)]
            row = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            print(row.splitlines()[-1], flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
