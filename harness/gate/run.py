"""`harness gate`: run the benchmark as the baseline was, or take a finished run, and judge it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.bench import QUICK_SCENES, BenchOptions, Wiring, run_bench
from harness.config import differing_values
from harness.errors import InputError
from harness.gate.acceptance import check_objects, reported
from harness.gate.baseline import Baseline, read_baseline
from harness.gate.calibration import read_calibration, several_sittings, this_machine
from harness.gate.judge import Quality, judge_quality
from harness.gate.pairs import pair_runs
from harness.gate.speed import Speed, SpeedMode, judge_speed, other_machine
from harness.gate.timed import run_timed
from harness.results import finished_run
from harness.runs.code import scene_code_digest
from harness.runs.directory import RunDirectory
from harness.runs.records import Record, read_records, read_timings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.config import Config
    from harness.runs.progress import Progress

BASELINE_FOLDER = Path("results/baseline")


@dataclass(frozen=True)
class GateOptions:
    """What a person chooses.

    Attributes
    ----------
    against
        Folder of the baseline.
    quick
        Judge the first `QUICK_SCENES` scenes of each class alone.
    run
        A finished run to judge; None runs the benchmark.
    out
        Where that run is written; by default a new folder under ``results``.
    workers
        Worker processes; None takes the baseline's setting.
    speed
        ``auto`` judges times where the baseline is of this machine, ``require`` takes it for bad
        input where it is not, ``skip`` leaves them out.
    """

    against: Path = BASELINE_FOLDER
    quick: bool = False
    run: Path | None = None
    out: Path | None = None
    workers: int | None = None
    speed: SpeedMode = "auto"


@dataclass(frozen=True)
class GateResult:
    """What the gate says.

    Attributes
    ----------
    passed
        Whether neither quality nor speed is worse.
    against, run
        Folders of the baseline and of the run.
    revision
        That made the baseline.
    quick
        Whether the first scenes of each class were judged alone.
    settings
        What is configured differently: key, the baseline's value, the run's.
    notes
        What a person should know.
    """

    passed: bool
    against: Path
    run: Path
    revision: str
    quick: bool
    quality: Quality
    speed: Speed
    settings: Sequence[tuple[str, Any, Any]]
    notes: Sequence[str]


def run_gate(
    options: GateOptions, *, progress: Progress | None = None, wiring: Wiring | None = None
) -> GateResult:
    """Judge this revision, or a finished run, against the baseline.

    Raises
    ------
    InputError
        A baseline or run that cannot be used, or the two are of different scenes.
    RunInterruptedError
        Ctrl-C.
    """
    if options.run is not None and (options.out is not None or options.workers is not None):
        raise InputError("--run judges a finished run; --out and --workers are for a new one")
    baseline = read_baseline(options.against)
    scenes = baseline.config.run.scenes
    if options.quick:
        scenes = min(scenes, QUICK_SCENES)
    records = _judged(baseline.records, baseline.config, scenes=scenes)
    check_objects(baseline.folder, records, classes=baseline.config.run.classes)
    if options.run is None and options.speed == "require":
        _require_speed(baseline, workers=options.workers, scenes=scenes)
    folder = options.run or _compute(
        options, baseline, scenes=scenes, progress=progress, wiring=wiring
    )
    run = finished_run(folder)
    settings = _check_same_scenes(run, baseline, scenes=scenes)
    now = _judged(read_records(run.records_path), baseline.config, scenes=scenes)
    paired = pair_runs(records, now, names=f"{baseline.folder} and {run.folder}")
    quality = judge_quality(paired)
    speed = _speed(options, run, baseline)
    return GateResult(
        passed=quality.passed and not speed.slower,
        against=baseline.folder,
        run=run.folder,
        revision=baseline.history[-1].revision if baseline.history else "unknown",
        quick=options.quick,
        quality=quality,
        speed=speed,
        settings=settings,
        notes=_notes(run, baseline),
    )


def _require_speed(baseline: Baseline, *, workers: int | None, scenes: int) -> None:
    """Refuse, before hours of work, times that could not be compared."""
    if baseline.calibration is None:
        raise InputError(f"--speed require: {_without_calibration(baseline)}")
    here = this_machine(
        workers=workers or baseline.config.run.workers,
        scenes=scenes * len(baseline.config.run.classes),
    )
    if refused := other_machine(here, baseline.calibration.machine):
        raise InputError(f"--speed require: {refused}")


def _without_calibration(baseline: Baseline) -> str:
    return (
        f"{baseline.folder} has no calibration; make it of a run by `harness baseline run`, which "
        "takes one"
    )


def _judged(records: Sequence[Record], config: Config, *, scenes: int) -> list[Record]:
    """Take the reported tolerance and the first scenes of each class."""
    return [item for item in reported(records, config) if _index(item.scene_id) < scenes]


def _index(scene_id: str) -> int:
    """Return the number of a scene in its class."""
    found = re.search(r"(\d+)$", scene_id)
    return int(found[1]) if found else 0


def _compute(
    options: GateOptions,
    baseline: Baseline,
    *,
    scenes: int,
    progress: Progress | None,
    wiring: Wiring | None,
) -> Path:
    """Run the benchmark as the baseline was, between calibrations if its times are judged.

    Raises
    ------
    InputError
        The folder holds scenes that other code computed: they would be judged for this one's.
    """
    if options.out is not None and RunDirectory.is_run(options.out):
        for session in RunDirectory(options.out).manifest()["sessions"]:
            if session.get("code") != scene_code_digest():
                raise InputError(
                    f"--out {options.out} holds a run of other code ({session.get('code')}, now "
                    f"{scene_code_digest()}), which says nothing of this; pass another --out, or "
                    f"--run {options.out} to judge that"
                )
    compute = run_bench if options.speed == "skip" or baseline.calibration is None else run_timed
    bench = BenchOptions(
        config=baseline.config_path, scenes=scenes, workers=options.workers, out=options.out
    )
    return compute(bench, progress=progress, wiring=wiring).folder


def _check_same_scenes(
    run: RunDirectory, baseline: Baseline, *, scenes: int
) -> list[tuple[str, Any, Any]]:
    """Return the settings that differ, none of which may change what is asked."""
    if (shard := run.shard()) is not None:
        raise InputError(
            f"{run.folder} is part {shard} of a run; join the parts with `harness merge` first"
        )
    config, folder = run.config(), run.folder
    if config.run.scenes < scenes:
        raise InputError(
            f"{folder} has {config.run.scenes} scenes of each class, {baseline.folder} {scenes}; "
            "judge a run of as many, or pass --quick where both have "
            f"{QUICK_SCENES}"
        )
    settings = [
        item
        for item in differing_values(ours=baseline.config, theirs=config)
        if item[0] != "run.scenes"
    ]
    for key, there, here in settings:
        if not key.startswith("pipeline."):
            raise InputError(
                f"{folder} and {baseline.folder} do not ask the same: {key} is {here} in the run "
                f"and {there} in the baseline; run it with --config {baseline.config_path}"
            )
    if odd := sorted(set(baseline.objects) ^ set(run.manifest()["objects"])):
        raise InputError(
            f"{folder} and {baseline.folder} are of different objects (first difference: "
            f"{odd[0]}); run the benchmark again and make that the baseline with "
            "`harness baseline update --from RUN`"
        )
    return settings


def _speed(options: GateOptions, run: RunDirectory, baseline: Baseline) -> Speed:
    """Judge the times, as far as they can be compared."""
    if options.speed == "skip":
        return Speed("left out by --speed skip")
    speed = _compared(run, baseline)
    if speed.refused is not None and options.speed == "require":
        raise InputError(f"--speed require: {speed.refused}")
    return speed


def _compared(run: RunDirectory, baseline: Baseline) -> Speed:
    if baseline.calibration is None:
        return Speed(_without_calibration(baseline))
    calibration = read_calibration(run.folder)
    if calibration is None:
        return Speed(
            f"{run.folder} has no calibration; `harness gate` takes one where it runs the "
            "benchmark itself"
        )
    if sittings_problem := several_sittings(run.manifest()["sessions"]):
        return Speed(f"{run.folder} {sittings_problem}")
    return judge_speed(
        baseline.timings,
        read_timings(run.timings_path),
        before=baseline.calibration,
        after=calibration,
    )


def _notes(run: RunDirectory, baseline: Baseline) -> list[str]:
    """Say what else differs and may move the last bits."""
    here = run.manifest()["sessions"][-1]["machine"]
    there = finished_run(baseline.folder).manifest()["sessions"][-1]["machine"]
    # A baseline keeps the system's kind, not its build.
    if here["cpu"] == there["cpu"] and here["system"].startswith(there["system"]):
        return []
    return [
        f"the baseline was made on another machine ({there['cpu']}, {there['system']}): last bits "
        "may differ, so that no row may be the same; quality is judged all the same"
    ]
