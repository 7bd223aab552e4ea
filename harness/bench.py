"""The benchmark: plan the scenes, compute them on workers, score, keep and tabulate the run."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from harness.config import Config, Override, PipelineCheck, check_test_sets, load_config
from harness.engines.choice import EngineName, make_engine
from harness.errors import InputError
from harness.runs.directory import CONFIG, RunDirectory, default_folder
from harness.runs.job import (
    ObjectModel,
    object_files,
    object_identity,
    plan_jobs,
    scene_ids,
)
from harness.runs.opening import open_run
from harness.runs.progress import Progress, SilentProgress
from harness.sitting import (
    compute_scenes,
    conclude_run,
    failed_records,
)

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
        ``scenes.objects``. On Ray `workers` is the most tasks at a time.
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
    objects = [object_identity(model) for model in models]
    run = open_run(
        options.out or default_folder(config, shard=shard),
        config=config,
        objects=objects,
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
                files=object_files(models, objects),
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
