"""The benchmark: plan the scenes, compute them on workers, score, keep and tabulate the run."""

from __future__ import annotations

import time
from collections import Counter
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from harness.config import Config, Override, PipelineCheck, check_test_sets, load_config
from harness.engines.choice import EngineName, make_engine
from harness.engines.engine import Engine, SceneDone, SceneFailed, Work, WorkerDied
from harness.engines.local import LocalEngine
from harness.engines.worker import load_target
from harness.errors import InputError
from harness.results import tabulate
from harness.runs.atomic import DiskError
from harness.runs.confusion import write_confusion
from harness.runs.directory import CONFIG, RunDirectory, default_folder, open_run
from harness.runs.job import ObjectModel, SceneJob, object_identity, plan_jobs, scene_ids
from harness.runs.progress import Progress, SilentProgress
from harness.runs.records import (
    Record,
    SceneResult,
    Timing,
    Variant,
    write_records,
    write_timings,
)
from harness.table.flat import render_csv
from harness.table.latex import render_latex
from harness.table.markdown import render_markdown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from harness.runs.shards import Shard
    from harness.table.summary import Table

QUICK_SCENES = 8
"""Scenes of each class with ``--quick``."""


@dataclass(frozen=True)
class BenchOptions:
    """What a person chooses; None leaves a choice to the configuration.

    Attributes
    ----------
    quick
        Take `QUICK_SCENES` scenes of each class.
    scenes, seed, workers, objects
        Take the place of the configuration's ``run.scenes``, ``run.seed``, ``run.workers`` and
        ``scenes.objects``.
    cluttered
        Put other objects around the targets, whatever the configuration says.
    out
        The run's folder; by default a new one under ``results``. A folder that holds a run is
        continued with the run's own configuration.
    config
        Configuration file.
    engine
        Where the scenes are computed.
    address
        Of the Ray cluster; by default the one of this machine.
    shard
        Compute this part of the scenes alone. A folder that holds a shard is continued as one.
    """

    quick: bool = False
    scenes: int | None = None
    seed: int | None = None
    workers: int | None = None
    objects: Path | None = None
    cluttered: bool = False
    out: Path | None = None
    config: Path | None = None
    engine: EngineName = "local"
    address: str | None = None
    shard: Shard | None = None


def load_objects(folder: Path | None) -> Sequence[ObjectModel]:
    """Load the object models of a folder, or of the set that comes with the project.

    Raises
    ------
    InputError
        A manifest or any of its meshes cannot be used, so that no scene fails by it hours later.
    """
    from sim_scenes import load_object_set

    try:
        objects = load_object_set(folder)
        objects.check_meshes()
    except (ValueError, OSError) as error:
        raise InputError(" ".join(str(error).split())) from error
    return objects.models


@dataclass(frozen=True)
class Wiring:
    """The parts that the benchmark runs on, by default the real ones.

    Attributes
    ----------
    scene_function
        ``package.module:name`` of ``(SceneJob, Config) -> SceneResult``, called in a worker.
    variants_function
        ``package.module:name`` of ``(Config) -> Sequence[Variant]``: what each scene compares.
    load_objects
        Object models of a folder.
    check_pipeline
        Checks and completes the ``[pipeline]`` table; None takes the Rust pipeline's check.
    """

    scene_function: str = "harness.scene_run:run_scene"
    variants_function: str = "harness.scene_run:variants"
    load_objects: Callable[[Path | None], Sequence[ObjectModel]] = load_objects
    check_pipeline: PipelineCheck | None = None


@dataclass(frozen=True)
class BenchResult:
    """A finished run.

    Attributes
    ----------
    folder
        Where the run was written.
    failures
        Why each failed scene failed, by scene id.
    scenes
        Number of scenes, failed ones included.
    seconds
        Wall time of this sitting.
    """

    folder: Path
    table: Table
    failures: Mapping[str, str]
    scenes: int
    seconds: float

    @property
    def all_failed(self) -> bool:
        """Whether no scene was scored."""
        return len(self.failures) == self.scenes


class RunInterruptedError(Exception):
    """A person stopped the run; its finished scenes are kept."""

    def __init__(self, *, finished: int, scenes: int, resume: str) -> None:
        super().__init__(
            f"interrupted: {finished} of {scenes} scenes are kept; continue with `{resume}`"
        )


def run_bench(
    options: BenchOptions,
    *,
    progress: Progress | None = None,
    wiring: Wiring | None = None,
) -> BenchResult:
    """Run the benchmark, or continue it.

    Raises
    ------
    InputError
        Wrong options, configuration or objects; a folder that cannot be written; workers that
        cannot start.
    RunInterruptedError
        Ctrl-C.
    """
    start = time.monotonic()
    wiring, progress = wiring or Wiring(), progress or SilentProgress()
    config = resolve_config(options, check_pipeline=wiring.check_pipeline)
    models = wiring.load_objects(config.scenes.objects)
    shard = _chosen_shard(options, config=config)
    jobs = plan_jobs(config, models)
    if shard is not None:
        jobs = shard.take(jobs)
    workers = options.workers if options.engine == "ray" else config.run.workers
    engine = make_engine(options.engine, address=options.address, workers=workers)
    run = open_run(
        options.out or default_folder(config, shard=shard),
        config=config,
        objects=[object_identity(model) for model in models],
        shard=shard,
    )
    with run.session() as notes:
        finished, damaged = run.finished(jobs)
        notes += [f"{scene} is computed again: {why}" for scene, why in damaged.items()]
        with progress.watch(folder=run.folder, scenes=len(jobs), finished=len(finished)):
            for note in notes:
                progress.note(note)
            failures = compute_scenes(
                run,
                jobs,
                finished,
                config=config,
                scene_function=wiring.scene_function,
                progress=progress,
                resume=_resume(run.folder, options),
                engine=engine,
            )
        failed = [(job, config.scenes.views) for job in jobs if job.scene_id in failures]
        lost = failed_records(failed, failures, config=config, wiring=wiring)
        table = conclude_run(run, finished, lost, config=config)
    return BenchResult(
        folder=run.folder,
        table=table,
        failures=failures,
        scenes=len(jobs),
        seconds=time.monotonic() - start,
    )


def _chosen_shard(options: BenchOptions, *, config: Config) -> Shard | None:
    """Take the shard that is asked for, or else the one that the folder holds."""
    shard = options.shard
    if shard is None and options.out is not None and RunDirectory.is_run(options.out):
        return RunDirectory(options.out).shard()
    scenes = len(scene_ids(config))
    if shard is not None and shard.count > scenes:
        raise InputError(
            f"--shard {shard}: the run has {scenes} scenes, too few for {shard.count} shards; "
            "pass a smaller N"
        )
    return shard


def _resume(folder: Path, options: BenchOptions) -> str:
    """Name the command that continues a run."""
    command = f"harness bench --out {folder}"
    if options.engine == "local":
        return command
    address = "" if options.address is None else f" --address {options.address}"
    return f"{command} --engine {options.engine}{address}"


def resolve_config(options: BenchOptions, *, check_pipeline: PipelineCheck | None) -> Config:
    """Turn a person's options into a configuration."""
    if options.quick and options.scenes is not None:
        raise InputError(f"--quick means --scenes {QUICK_SCENES}; pass one of the two")
    scenes = QUICK_SCENES if options.quick else options.scenes
    objects = None if options.objects is None else str(options.objects.resolve())
    chosen = (
        Override("run.scenes", scenes, "--quick" if options.quick else "--scenes"),
        Override("run.seed", options.seed, "--seed"),
        Override("run.workers", options.workers, "--workers"),
        Override("scenes.objects", objects, "--objects"),
        Override("scenes.cluttered", options.cluttered or None, "--cluttered"),
    )
    path = options.config
    if path is None and options.out is not None and RunDirectory.is_run(options.out):
        path = options.out / CONFIG
    config = load_config(
        path,
        overrides=tuple(override for override in chosen if override.value is not None),
        check_pipeline=check_pipeline,
    )
    return check_test_sets(config)


def scene_problem(result: SceneResult, job: SceneJob) -> str | None:
    """Say what is wrong with the result that a scene function returned."""
    records = result.records
    if not records:
        return "the scene function returned no record"
    keys = [record.key() for record in records]
    if len(set(keys)) < len(keys):
        return "the scene function returned two records of one model, completion and tolerance"
    if any((row.scene_id, row.seed) != (job.scene_id, job.seed) for row in records):
        return "the scene function returned another scene's records"
    points: Counter[tuple[str, str, float]] = Counter()
    for row in result.confusion:
        points[row.result()] += row.points
    stated = {
        (row.model, row.completion, row.tolerance_m): row.test_points
        for row in records
        if row.status == "ok"
    }
    if points != stated or any(row.scene_id != job.scene_id for row in result.confusion):
        return "the scene function's confusion does not count the test points of its records"
    return None


def compute_scenes(
    run: RunDirectory,
    jobs: Sequence[SceneJob],
    finished: dict[str, SceneResult],
    *,
    config: Config,
    scene_function: str,
    progress: Progress,
    resume: str,
    problem_of: Callable[[SceneResult, SceneJob], str | None] = scene_problem,
    engine: Engine | None = None,
) -> dict[str, str]:
    """Compute on workers the scenes that are not finished.

    Parameters
    ----------
    run
        Keeps each scene as it is done.
    finished
        By scene id; what is computed is added.
    scene_function
        ``package.module:name`` of ``(SceneJob, Config) -> SceneResult``.
    resume
        The command that continues the run, for the message of an interruption.
    problem_of
        Says what is wrong with a scene's result, None where nothing is.
    engine
        What computes; by default this machine, with the configuration's workers.

    Returns
    -------
    failures
        Why each failed scene failed, by scene id.
    """
    failures: dict[str, str] = {}
    waiting = [job for job in jobs if job.scene_id not in finished]
    if not waiting:
        return failures
    engine = engine or LocalEngine(workers=config.run.workers)
    work = Work(target=scene_function, result_type=SceneResult, arguments=(config,))
    try:
        with closing(engine.run(work, waiting, logs=run.logs)) as events:
            for event in events:
                match event:
                    case SceneDone(job=job, seconds=seconds) as done:
                        result = _with_timing(done)
                        if problem := problem_of(result, job):
                            failures[job.scene_id] = problem
                            progress.scene_failed(job.scene_id, problem)
                            continue
                        run.keep(job, result)
                        # Without its recording, which is on the disk: a run may hold thousands.
                        finished[job.scene_id] = replace(result, recording=None)
                        progress.scene_done(job.scene_id, seconds)
                        for reason in sorted({r.failure for r in result.records if r.failure}):
                            progress.note(f"{job.scene_id} is scored in part: {reason}")
                    case SceneFailed(job=job, failure=failure):
                        failures[job.scene_id] = failure
                        progress.scene_failed(job.scene_id, failure)
                    case WorkerDied():
                        progress.note(str(event))
    except KeyboardInterrupt:
        # What lies on the disk counts: the interrupt may fall between a file and its entry here.
        kept, _ = run.finished(jobs)
        raise RunInterruptedError(finished=len(kept), scenes=len(jobs), resume=resume) from None
    except DiskError as error:
        raise DiskError(
            f"{error}; {len(finished)} of {len(jobs)} scenes are kept, continue with `{resume}`"
        ) from error
    return failures


def _with_timing(done: SceneDone[SceneJob, SceneResult]) -> SceneResult:
    """Put the scene's own timing, which the worker takes, after those of its stages."""
    whole = Timing(
        scene_id=done.job.scene_id,
        stage="scene",
        model=None,
        seconds=done.seconds,
        peak_memory_mib=done.peak_memory_mib,
    )
    stages = [timing for timing in done.result.timings if timing.stage != whole.stage]
    return replace(done.result, timings=[*stages, whole])


def failed_records(
    failed: Sequence[tuple[SceneJob, int]],
    failures: Mapping[str, str],
    *,
    config: Config,
    wiring: Wiring,
) -> list[Record]:
    """Make the records of lost scenes, which are given with their number of views."""
    if not failed:
        return []
    variants: Sequence[Variant] = load_target(wiring.variants_function)(config)
    return [
        Record.failed(
            job,
            variant=variant,
            views=views,
            tolerance_m=tolerance_m,
            failure=failures[job.scene_id],
        )
        for job, views in failed
        for variant in variants
        for tolerance_m in config.protocol.tolerances_m
    ]


def conclude_run(
    run: RunDirectory,
    finished: Mapping[str, SceneResult],
    lost: Sequence[Record],
    *,
    config: Config,
) -> Table:
    """Write records, confusion, timings and tables of all scenes, finished and lost."""
    records = [*(record for result in finished.values() for record in result.records), *lost]
    write_records(records, run.records_path)
    write_confusion(
        [row for result in finished.values() for row in result.confusion], run.confusion_path
    )
    write_timings(
        [timing for result in finished.values() for timing in result.timings], run.timings_path
    )
    table = tabulate(records, config=config)
    run.write_tables(
        {"md": render_markdown(table), "csv": render_csv(table), "tex": render_latex(table)}
    )
    return table
