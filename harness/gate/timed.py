"""A benchmark run between two calibrations, so that its times can be held against others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.bench import BenchOptions, BenchResult, Wiring, resolve_config, run_bench
from harness.gate.calibration import conclude, measure, this_machine, write_calibration

if TYPE_CHECKING:
    from harness.runs.progress import Progress


def run_timed(
    options: BenchOptions, *, progress: Progress | None = None, wiring: Wiring | None = None
) -> BenchResult:
    """Run the benchmark as `run_bench` does, and leave `CALIBRATION` in its folder.

    Raises
    ------
    InputError, RunInterruptedError
        As `run_bench` does.
    """
    wiring = wiring or Wiring()
    config = resolve_config(options, check_pipeline=wiring.check_pipeline)
    machine = this_machine(
        workers=config.run.workers, scenes=config.run.scenes * len(config.run.classes)
    )
    before = measure(workers=machine.workers)
    result = run_bench(options, progress=progress, wiring=wiring)
    after = measure(workers=machine.workers)
    write_calibration(conclude(before, after, machine=machine), result.folder)
    return result
