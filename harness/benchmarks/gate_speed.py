"""Which slowdowns the gate catches, by simulation on a recorded run's stage times, as Markdown.

    python -m harness.benchmarks.gate_speed RUN [--repeats 1000]

Two runs are drawn from the scenes of RUN, each with replacement. What sets a stage's times apart
between scenes of a class, work and chance, counts as noise, so that the noise is overstated. One of
the two is slowed down; the calibration is taken to be right.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.bench import QUICK_SCENES
from harness.errors import InputError
from harness.gate.margins import LEAST_SECONDS, SLOWER
from harness.gate.speed import by_stage, median_bound
from harness.results import finished_run
from harness.runs.records import read_timings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.gate.speed import Stage
    from harness.runs.records import Timing

SLOWDOWNS = (1.0, 1.3, 1.4, 1.5, 2.0)
SEED = 20


def stage_noise(timings: Sequence[Timing]) -> dict[Stage, npt.NDArray[np.float64]]:
    """Noise of each judged stage: log seconds (scenes,) less their class's median."""
    noise = {}
    for stage, seconds in by_stage(timings).items():
        if np.median(list(seconds.values())) < LEAST_SECONDS:
            continue
        classes: dict[str, list[float]] = {}
        for scene_id, value in seconds.items():
            classes.setdefault(scene_id.rsplit("-", 1)[0], []).append(float(np.log(value)))
        noise[stage] = np.concatenate([np.array(v) - np.median(v) for v in classes.values()])
    return noise


def caught(noise: npt.NDArray[np.float64], *, scenes: int, repeats: int) -> Mapping[float, float]:
    """Share of runs in which a stage is called slower, by how many times slower it is.

    Parameters
    ----------
    noise : (n,) float64
        Of the stage's log seconds.
    scenes
        Of each run.
    """
    random = np.random.default_rng(SEED)
    there, here = random.choice(noise, size=(2, repeats, scenes))
    lows = np.array([median_bound(ratios) or 0.0 for ratios in np.exp(here - there)])
    return {factor: float(np.mean(lows * factor > SLOWER)) for factor in SLOWDOWNS}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--repeats", type=int, default=1000)
    options = parser.parse_args(arguments)
    try:
        run = finished_run(options.run)
        noise, classes = stage_noise(read_timings(run.timings_path)), run.config().run.classes
    except InputError as error:
        sys.stderr.write(f"gate_speed: {error}\n")
        return 2
    sizes = (run.config().run.scenes * len(classes), QUICK_SCENES * len(classes))
    print(f"Runs in which a stage is called slower, %, of {options.repeats}")
    heads = " | ".join(f"{factor:g}x | quick" for factor in SLOWDOWNS)
    print(f"\n| stage | {heads} |\n|---|{'--:|' * 2 * len(SLOWDOWNS)}")
    for stage, values in sorted(noise.items(), key=lambda item: float(np.std(item[1]))):
        shares = [caught(values, scenes=size, repeats=options.repeats) for size in sizes]
        entries = [f"{100 * found[factor]:.1f}" for factor in SLOWDOWNS for found in shares]
        print(f"| {' '.join(filter(None, stage))} | {' | '.join(entries)} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
