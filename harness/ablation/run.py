"""Runs an ablation: each cell is a run of its own, computed together with the others by scene.

::

    ABLATION/
      cells/HASH/        one run for each configuration, by its short hash: `harness show`,
                         `compare`, `report` and `figures` read it as any other
      logs/              what workers printed, and tracebacks
      ablation.toml      the file that was asked for
      ablation.parquet   the records of all cells at the tolerance that each reports, with
                         ``cell`` and a ``grid.KEY`` column for every axis
      summary.csv        means, and differences from the first cell, with intervals

A cell is found by the content of its configuration, so that a grid that grows computes only what is
new.
"""

from __future__ import annotations

import time
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from harness.ablation.frame import ablation_frame, read_cell
from harness.ablation.job import CellResults, CellScene, SceneCells
from harness.ablation.spec import find_spec, read_spec
from harness.ablation.summary import Summary, summarise_cells
from harness.bench import Wiring
from harness.config import Override
from harness.engines.engine import SceneDone, SceneFailed, Work, WorkerDied
from harness.engines.local import LocalEngine
from harness.errors import InputError
from harness.runs.atomic import DiskError, write_text
from harness.runs.code import scene_code_digest
from harness.runs.job import SceneJob, object_files, object_identity, plan_jobs
from harness.runs.opening import open_run
from harness.runs.progress import Progress, SilentProgress
from harness.runs.tabular import write_parquet
from harness.sitting import RunInterruptedError, conclude_run, failed_records, scene_problem

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.ablation.spec import AblationSpec, Cell
    from harness.config import Config
    from harness.engines.engine import Engine
    from harness.runs.directory import RunDirectory
    from harness.runs.records import SceneResult

RECORDS = "ablation.parquet"
SUMMARY = "summary.csv"
SPEC = "ablation.toml"


@dataclass(frozen=True)
class AblateOptions:
    """What a person chooses; None leaves a choice to the grid's file.

    Attributes
    ----------
    file
        The grid's file, or the name of a ready one.
    scenes, seed
        In place of the base's ``run.scenes`` and ``run.seed``.
    out
        Folder to write, by default ``results/ablations/NAME``; one in it continues.
    keep_old
        Take what other code computed as it is, in place of a refusal.
    """

    file: str
    scenes: int | None = None
    seed: int | None = None
    out: Path | None = None
    keep_old: bool = False


@dataclass(frozen=True)
class Ablation:
    """A finished ablation.

    Attributes
    ----------
    folder
        Where it was written.
    cells
        In order.
    failures
        Why a scene failed, by cell's index and scene id.
    scenes
        Scenes of all cells, failed ones included.
    computed
        Scenes that this sitting computed; the others were there.
    stages
        How often each stage was computed for them.
    summary
        Means and differences.
    seconds
        Wall time of this sitting.
    """

    folder: Path
    cells: Sequence[Cell]
    failures: Mapping[str, str]
    scenes: int
    computed: int
    stages: Mapping[str, int]
    summary: Summary
    seconds: float

    @property
    def all_failed(self) -> bool:
        """Whether no scene was scored."""
        return len(self.failures) == self.scenes


@dataclass(eq=False)
class _CellRun:
    """A cell's run on disk; `files` are its objects' meshes, with the digest of each."""

    config: Config
    run: RunDirectory
    jobs: Sequence[SceneJob]
    finished: dict[str, SceneResult]
    failures: dict[str, str]
    files: Mapping[str, str]
    changed: bool = False


def run_ablation(
    options: AblateOptions,
    *,
    engine: Engine | None = None,
    progress: Progress | None = None,
    wiring: Wiring | None = None,
) -> Ablation:
    """Run an ablation, or continue it.

    Raises
    ------
    InputError
        A file that spans no grid, a key or value that no configuration takes, objects or a folder
        that cannot be used, workers that cannot start.
    RunInterruptedError
        Ctrl-C.
    """
    start = time.monotonic()
    wiring, progress = wiring or Wiring(), progress or SilentProgress()
    spec = read_spec(find_spec(options.file))
    cells = _cells(spec, options, wiring=wiring)
    folder = options.out or Path("results") / "ablations" / spec.source.stem
    resume = f"harness ablate {options.file} --out {folder}"
    stages: dict[str, int] = {}
    with ExitStack() as sessions:
        runs = _open_cells(
            cells,
            folder=folder,
            keep_old=options.keep_old,
            wiring=wiring,
            sessions=sessions,
            progress=progress,
        )
        logs = folder / "logs"
        logs.mkdir(exist_ok=True)
        total = sum(len(item.jobs) for item in runs.values())
        there = sum(len(item.finished) for item in runs.values())
        with progress.watch(folder=folder, scenes=total, finished=there):
            try:
                _compute(
                    runs,
                    engine=engine or LocalEngine(),
                    logs=logs,
                    progress=progress,
                    stages=stages,
                )
            except KeyboardInterrupt:
                kept = sum(len(item.run.finished(item.jobs)[0]) for item in runs.values())
                raise RunInterruptedError(finished=kept, scenes=total, resume=resume) from None
            except DiskError as error:
                raise DiskError(
                    f"{error}; what is finished is kept, continue with `{resume}`"
                ) from error
        for item in runs.values():
            _conclude(item, wiring=wiring)
        frame = ablation_frame([(cell, read_cell(runs[_key(cell)].run)) for cell in cells])
        summary = summarise_cells(cells, frame, seed=cells[0].config.run.seed)
        write_parquet(frame, folder / RECORDS)
        write_text(folder / SUMMARY, summary.csv())
        _keep_spec(spec, options, folder=folder, progress=progress)
    return Ablation(
        folder=folder,
        cells=cells,
        failures={
            f"cell {cell.index}, {scene_id}": why
            for cell in cells
            for scene_id, why in runs[_key(cell)].failures.items()
        },
        scenes=total,
        computed=sum(len(item.finished) for item in runs.values()) - there,
        stages=stages,
        summary=summary,
        seconds=time.monotonic() - start,
    )


def plan_ablation(options: AblateOptions, *, wiring: Wiring | None = None) -> list[Cell]:
    """Make the cells that an ablation would run; raises like `run_ablation`."""
    return _cells(read_spec(find_spec(options.file)), options, wiring=wiring or Wiring())


def _cells(spec: AblationSpec, options: AblateOptions, *, wiring: Wiring) -> list[Cell]:
    chosen = (
        Override("run.scenes", options.scenes, "--scenes"),
        Override("run.seed", options.seed, "--seed"),
    )
    overrides = tuple(override for override in chosen if override.value is not None)
    return spec.cells(overrides=overrides, check_pipeline=wiring.check_pipeline)


def _keep_spec(
    spec: AblationSpec, options: AblateOptions, *, folder: Path, progress: Progress
) -> None:
    """Keep the grid beside its table, and say where it takes another grid's place."""
    asked = {"--scenes": options.scenes, "--seed": options.seed}
    chosen = " ".join(f"{name} {value}" for name, value in asked.items() if value is not None)
    text = f"# harness ablate {spec.source.stem} {chosen}".rstrip() + "\n"
    text += spec.source.read_text(encoding="utf-8")
    path = folder / SPEC
    if path.is_file() and path.read_text(encoding="utf-8") != text:
        progress.note(
            f"{folder / RECORDS} and {SUMMARY} held another grid, or other scenes of it; they are "
            "replaced, its cells are kept"
        )
    write_text(path, text)


def _key(cell: Cell) -> str:
    return cell.config.short_hash()


def _open_cells(
    cells: Sequence[Cell],
    *,
    folder: Path,
    keep_old: bool,
    wiring: Wiring,
    sessions: ExitStack,
    progress: Progress,
) -> dict[str, _CellRun]:
    """Open the run of every configuration, by its hash; cells of one configuration share it."""
    runs: dict[str, _CellRun] = {}
    models = {}
    said: set[str] = set()
    for cell in cells:
        config = cell.config
        if (known := runs.get(_key(cell))) is not None:
            if known.config.identity() != config.identity():
                raise InputError(
                    f"cell {cell.index} ({cell}) has the short hash of another cell, "
                    f"{_key(cell)}; change any setting of either, such as run.scenes"
                )
            continue
        place = config.scenes.objects
        if place not in models:
            objects = wiring.load_objects(place)
            models[place] = objects, [object_identity(model) for model in objects]
        objects, identities = models[place]
        jobs = plan_jobs(config, objects)
        run = open_run(folder / "cells" / _key(cell), config=config, objects=identities)
        if not keep_old and run.finished(jobs)[0]:
            _check_code(run, cell)
        notes = sessions.enter_context(run.session())
        finished, damaged = run.finished(jobs)
        notes += [f"{scene} is computed again: {why}" for scene, why in damaged.items()]
        for note in notes:
            if note not in said:
                progress.note(note)
        said.update(notes)
        files = object_files(objects, identities)
        runs[_key(cell)] = _CellRun(config, run, jobs, finished, {}, files)
    return runs


def _check_code(run: RunDirectory, cell: Cell) -> None:
    """Refuse to set scenes that other code computed beside those that this code will.

    Raises
    ------
    InputError
        A sitting at the run had other code.
    """
    ours = scene_code_digest()
    for session in run.manifest()["sessions"]:
        if session.get("code") != ours:
            raise InputError(
                f"{run.folder}, cell {cell.index} ({cell}), was computed by other code "
                f"({session.get('code')}, now {ours}); pass another --out, or --keep-old to take "
                "it as it is"
            )


def _waiting(runs: Mapping[str, _CellRun]) -> list[SceneCells]:
    """Gather what is not finished, by scene."""
    parts: dict[str, list[CellScene]] = {}
    for key, item in runs.items():
        for job in item.jobs:
            if job.scene_id not in item.finished:
                parts.setdefault(job.scene_id, []).append(CellScene(key, job, item.config))
    return [SceneCells(scene_id, tuple(found)) for scene_id, found in parts.items()]


def _compute(
    runs: Mapping[str, _CellRun],
    *,
    engine: Engine,
    logs: Path,
    progress: Progress,
    stages: dict[str, int],
) -> None:
    """Compute what is not finished, and keep it scene by scene."""
    waiting = _waiting(runs)
    if not waiting:
        return
    files = {path: digest for item in runs.values() for path, digest in item.files.items()}
    work = Work("harness.ablation.cells:run_cells", CellResults, files=files)
    with closing(engine.run(work, waiting, logs=logs)) as events:
        for event in events:
            match event:
                case SceneDone(job=job, result=found, seconds=seconds):
                    for stage, count in found.computed.items():
                        stages[stage] = stages.get(stage, 0) + count
                    for part in job.parts:
                        _keep(runs[part.cell], part, found, seconds=seconds, progress=progress)
                case SceneFailed(job=job, failure=failure):
                    for part in job.parts:
                        runs[part.cell].failures[job.scene_id] = failure
                        progress.scene_failed(job.scene_id, failure)
                case WorkerDied() as died:
                    progress.note(str(died))


def _keep(
    item: _CellRun, part: CellScene, found: CellResults, *, seconds: float, progress: Progress
) -> None:
    scene_id = part.job.scene_id
    result = found.results.get(part.cell)
    failure = found.failures.get(part.cell, "the worker returned nothing of it")
    if result is not None:
        failure = scene_problem(result, part.job) or ""
    if failure or result is None:
        item.failures[scene_id] = failure
        progress.scene_failed(scene_id, failure)
        return
    item.run.keep(part.job, result)
    item.finished[scene_id] = result
    item.changed = True
    progress.scene_done(scene_id, seconds / max(1, len(found.results)))


def _conclude(item: _CellRun, *, wiring: Wiring) -> None:
    """Write the run's records and tables, unless they stand and are newer than every scene."""
    if not item.failures and not item.changed and item.run.is_concluded():
        return
    failed = [(job, item.config.scenes.views) for job in item.jobs if job.scene_id in item.failures]
    lost = failed_records(failed, item.failures, config=item.config, wiring=wiring)
    conclude_run(item.run, item.finished, lost, config=item.config)
