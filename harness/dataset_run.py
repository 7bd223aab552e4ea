"""A BOP dataset, our own or foreign, through the benchmark's map, classifiers and scores.

1. Every scene is read once. One that cannot be read, or that has no masks while the segmenter is
   the oracle, is skipped with its reason.
2. Targets are chosen: the target of a scene that was simulated, every object of a wanted class
   of a foreign one. Each becomes a job of the benchmark's workers; so does a scene without a
   target, which is mapped but not scored.
3. Targets yield the benchmark's records. A scene without truth yields its map:

::

    RUN/maps/SCENE/occupancy.ot         the map as OctoMap writes it
                   map.json             the mapped objects, and why any has no predictions or no
                                        completed shape
                   object_000001.parquet  predictions at points drawn evenly in the box of the
                                        object's observed points, padded: model, x, y, z (metres,
                                        world), class, confidence, score, variance
                   completed_000001.ply the completed shape: x, y, z, spread (metres, world)
    RUN/unscored.json                   the scenes without scores: outcome and reason
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from harness.asked import no_completion
from harness.bench import Wiring
from harness.config import Config, Override, check_test_sets, load_config
from harness.dataset_export import CONFIG_FILE
from harness.dataset_plan import DatasetJob, Plan, dataset_identity, plan_dataset
from harness.errors import InputError
from harness.native import CLASS_NAMES
from harness.runs.atomic import write_text
from harness.runs.directory import CONFIG, RunDirectory, default_folder
from harness.runs.opening import open_run
from harness.runs.progress import Progress, SilentProgress
from harness.runs.records import SceneResult
from harness.runs.tabular import write_parquet
from harness.scene_run import evaluate_scene, map_scene
from harness.sitting import compute_scenes, conclude_run, failed_records, scene_problem
from harness.stages.clock import StageClock
from sim_scenes import BopError, open_bop
from sim_scenes.streams import stream

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.native import MappedObject, Pipeline
    from harness.runs.job import SceneJob
    from harness.table.summary import Table
    from sim_scenes import BopDataset, Scene

PADDING_M = 0.03
"""Padding of an object's observed box, as the protocol pads it for training points."""


@dataclass(frozen=True)
class DatasetOptions:
    """What a person chooses; None leaves a choice to the configuration.

    Attributes
    ----------
    dataset
        Root of a BOP dataset, or of one of its splits.
    out
        The run's folder; by default a new one under ``results``. A folder that holds a run of
        this dataset is continued.
    config
        Configuration file; by default the one that the dataset carries, if it does.
    seed
        Of foreign scenes; simulated ones keep their own.
    workers
        Worker processes.
    category
        Category of the objects that the dataset gives none.
    """

    dataset: Path
    out: Path | None = None
    config: Path | None = None
    seed: int | None = None
    workers: int | None = None
    category: str | None = None


@dataclass(frozen=True)
class Unscored:
    """A scene without scores.

    Attributes
    ----------
    outcome
        ``mapped``, ``skipped``, or ``failed`` where it should have been mapped.
    """

    scene_id: str
    outcome: str
    reason: str


@dataclass(frozen=True)
class DatasetResult:
    """A finished run of a dataset.

    Attributes
    ----------
    folder
        Where the run was written.
    scored
        Number of targets with records.
    failures
        Why each target without them failed, by the records' scene id.
    unscored
        Scenes that had no target.
    seconds
        Wall time of this sitting.
    """

    folder: Path
    table: Table
    scored: int
    failures: Mapping[str, str]
    unscored: Sequence[Unscored]
    seconds: float

    def count(self, outcome: str) -> int:
        """Count the unscored scenes with an outcome."""
        return sum(item.outcome == outcome for item in self.unscored)

    @property
    def nothing_ran(self) -> bool:
        """Whether no target was scored and no scene mapped."""
        return self.scored == 0 and self.count("mapped") == 0


def run_dataset(options: DatasetOptions, *, progress: Progress | None = None) -> DatasetResult:
    """Run a dataset, or continue its run.

    Raises
    ------
    InputError
        A folder that is no dataset; wrong options or configuration; a folder that cannot be
        written; workers that cannot start.
    RunInterruptedError
        Ctrl-C.
    """
    start = time.monotonic()
    progress = progress or SilentProgress()
    try:
        dataset = open_bop(options.dataset.resolve(), category=options.category)
    except BopError as error:
        raise InputError(str(error)) from error
    config = _configuration(options, dataset)
    run = open_run(
        options.out or default_folder(config),
        config=config,
        objects=dataset_identity(dataset, category=options.category),
    )
    with run.session() as notes:
        maps = run.folder.resolve() / "maps"
        plan = plan_dataset(dataset, config=config, category=options.category, maps=maps)
        finished, damaged = run.finished(plan.jobs)
        notes += [f"{scene} is computed again: {why}" for scene, why in damaged.items()]
        with progress.watch(folder=run.folder, scenes=len(plan.jobs), finished=len(finished)):
            for note in (*notes, *plan.notes):
                progress.note(note)
            failures = compute_scenes(
                run,
                plan.jobs,
                finished,
                config=config,
                scene_function=f"{__name__}:run_job",
                progress=progress,
                resume=f"harness run {options.dataset} --out {run.folder}",
                problem_of=_problem,
            )
        return _conclude(run, plan, finished, failures, config=config, start=start)


def run_job(job: DatasetJob, config: Config) -> SceneResult:
    """Score a target, or map a scene; the workers' function."""
    clock = StageClock(job.scene_id)
    with clock.stage("read"):
        dataset = open_bop(job.split, category=job.given_category)
        scene = dataset.read_scene(job.number)[job.part]
    if job.instance_id is None:
        _write_map(scene, job=job, config=config, clock=clock)
        return SceneResult(records=[], timings=clock.timings)
    first = sorted(scene.objects, key=lambda item: item.instance_id != job.instance_id)
    scene = replace(scene, objects=tuple(first))
    return evaluate_scene(scene, job=job, config=config, clock=clock)


def _configuration(options: DatasetOptions, dataset: BopDataset) -> Config:
    carried = dataset.folder.parent / CONFIG_FILE
    path = options.config
    if path is None and options.out is not None and RunDirectory.is_run(options.out):
        path = options.out / CONFIG
    elif path is None and carried.is_file():
        path = carried
    chosen = (
        Override("run.seed", options.seed, "--seed"),
        Override("run.workers", options.workers, "--workers"),
    )
    overrides = tuple(override for override in chosen if override.value is not None)
    config = load_config(path, overrides=overrides)
    return check_test_sets(config)


def _problem(result: SceneResult, job: SceneJob) -> str | None:
    mapped_only = isinstance(job, DatasetJob) and job.instance_id is None
    return None if mapped_only else scene_problem(result, job)


def _write_map(scene: Scene, *, job: DatasetJob, config: Config, clock: StageClock) -> None:
    """Map a scene and write the map and what the classifiers say about each object."""
    pipeline = map_scene(scene, config=config)
    folder = job.maps / job.scene_id
    folder.mkdir(parents=True, exist_ok=True)
    pipeline.occupancy().write_ot(folder / "occupancy.ot")
    entries = []
    for item in pipeline.objects():
        entry: dict[str, Any] = {
            "id": item.id,
            "category": item.category,
            "score": item.score,
            "points": len(item.points_world),
            "centroid_world": item.centroid_world.tolist(),
        }
        name = f"object_{item.id:06d}.parquet"
        try:
            write_parquet(_predict(pipeline, item, job=job, config=config), folder / name)
            entry["predictions"] = name
        except ValueError as error:
            entry["without_predictions"] = str(error)
        if (completion := pipeline.completion(item.id)) is not None:
            entry["completed"] = f"completed_{item.id:06d}.ply"
            completion.write_ply(folder / entry["completed"])
        elif pipeline.completer != "none":
            entry["without_completion"] = no_completion(pipeline, item.id)
        entries.append(entry)
    write_text(folder / "map.json", json.dumps({"objects": entries}, indent=2) + "\n")
    for stage, model, seconds in pipeline.timings():
        clock.add(stage, seconds, model=model)


def _predict(
    pipeline: Pipeline, item: MappedObject, *, job: DatasetJob, config: Config
) -> pl.DataFrame:
    """Ask every model about points in the object's padded observed box."""
    low = item.points_world.min(axis=0) - PADDING_M
    high = item.points_world.max(axis=0) + PADDING_M
    random = stream(job.seed, f"prediction points/{item.id}")
    points = random.uniform(low, high, size=(config.protocol.test_points, 3))
    training = pipeline.training_set(item.id, seed=job.seed)
    tables = []
    for model in pipeline.models:
        predictions = pipeline.classify(item.id, training, points, model=model)
        columns = {
            "model": np.full(len(points), model),
            **{axis: points[:, column] for column, axis in enumerate("xyz")},
            "class": np.array(CLASS_NAMES)[predictions.classes],
            "confidence": predictions.confidence,
            "score": predictions.score,
            "variance": predictions.variance,
        }
        tables.append(pl.DataFrame(columns))
    return pl.concat(tables)


def _conclude(
    run: RunDirectory,
    plan: Plan,
    finished: Mapping[str, SceneResult],
    failures: Mapping[str, str],
    *,
    config: Config,
    start: float,
) -> DatasetResult:
    """Write records, timings, tables and the list of what has no scores."""
    targets = [job for job in plan.jobs if job.instance_id is not None]
    to_map = {job.scene_id for job in plan.jobs if job.instance_id is None}
    failed = [(job, job.views) for job in targets if job.scene_id in failures]
    lost = failed_records(failed, failures, config=config, wiring=Wiring())
    table = conclude_run(run, finished, lost, config=config)
    unscored = [
        Unscored(scene_id, "skipped", reason)
        if scene_id not in to_map
        else Unscored(scene_id, "failed", failures[scene_id])
        if scene_id in failures
        else Unscored(scene_id, "mapped", reason)
        for scene_id, reason in plan.reasons.items()
    ]
    rows = [asdict(item) for item in unscored]
    write_text(run.folder / "unscored.json", json.dumps(rows, indent=2) + "\n")
    return DatasetResult(
        folder=run.folder,
        table=table,
        scored=len(targets) - len(failed),
        failures={job.scene_id: failures[job.scene_id] for job, _ in failed},
        unscored=unscored,
        seconds=time.monotonic() - start,
    )
