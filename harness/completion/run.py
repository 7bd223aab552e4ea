"""`harness completion-report`: plan the scenes, measure them on workers, write and summarise.

::

    OUT/
      report.json       settings, summary, every scene's rows, failures; written last
      sheet.png         the first scenes' pictures
      pictures/ID.png   observed points red, completed points white, over the true mesh
      logs/             what workers printed, and tracebacks
"""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from harness.bench import load_objects
from harness.completion.mean_shape import mean_shape
from harness.completion.pictures import write_sheet
from harness.completion.report import report_json
from harness.completion.rows import Completer, SceneRows
from harness.completion.scene import Plan, with_completer
from harness.completion.summary import Report, summarise
from harness.config import Config, Override, load_config
from harness.errors import InputError
from harness.native import CLASS_NAMES, Pipeline
from harness.runs.atomic import DiskError, write_text
from harness.runs.directory import default_folder
from harness.runs.job import plan_jobs
from harness.runs.manifest import core_count
from harness.runs.pool import SceneDone, SceneFailed, ScenePool, WorkerDied
from harness.runs.progress import Progress, SilentProgress

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.runs.job import SceneJob

COMPLETERS = ("cloud", "centersnap")
SCENE_FUNCTION = "harness.completion.scene:score_scene"


@dataclass(frozen=True)
class CompletionOptions:
    """What a person chooses; None leaves a choice to the configuration.

    Attributes
    ----------
    objects
        Folder of meshes with a manifest; by default the benchmark's test split.
    scenes
        Scenes of each class; the first of a benchmark's.
    views
        Camera poses of a scene.
    completers
        As ``pipeline.completer`` names them; each runs with and without refinement.
    classes
        Classes of the target.
    seed, workers, config
        As for a benchmark.
    cluttered
        Put other objects around the targets.
    out
        Folder to write, new or empty; by default a new one under ``results``.
    """

    objects: Path | None = None
    scenes: int | None = None
    views: int = 1
    completers: Sequence[str] = COMPLETERS
    classes: Sequence[str] = ()
    seed: int | None = None
    workers: int | None = None
    cluttered: bool = False
    out: Path | None = None
    config: Path | None = None


@dataclass(frozen=True)
class CompletionResult:
    """A finished report.

    Attributes
    ----------
    text
        The content of ``report.json``.
    scenes
        Number of scenes asked for.
    failures
        Why each scene that could not be measured is missing, by id.
    seconds
        Wall time.
    """

    folder: Path
    report: Report
    text: str
    scenes: int
    failures: Mapping[str, str]
    seconds: float


def run_report(
    options: CompletionOptions,
    *,
    progress: Progress | None = None,
    scene_function: str | None = None,
) -> CompletionResult:
    """Measure the completers and write the report.

    Raises
    ------
    InputError
        Wrong options, configuration or objects; a folder that is taken or cannot be written;
        no scene could be measured.
    """
    start = time.monotonic()
    progress = progress or SilentProgress()
    config = _configuration(options)
    jobs = plan_jobs(config, load_objects(config.scenes.objects))
    completers = tuple(
        Completer(name, refine=refine)
        for name in dict.fromkeys(options.completers)
        for refine in (True, False)
    )
    _check_completers(completers, config=config)
    folder = options.out or _default_folder(config)
    _begin(folder)
    plan = Plan(
        completers=completers,
        mean_shapes={category: mean_shape(category) for category in config.run.classes},
        pictures=folder / "pictures",
    )
    with progress.watch(folder=folder, scenes=len(jobs), finished=0):
        scenes, failures = _measure(
            jobs,
            config=config,
            plan=plan,
            logs=folder / "logs",
            progress=progress,
            scene_function=scene_function or SCENE_FUNCTION,
        )
    if not scenes:
        scene_id, why = next(iter(failures.items()))
        raise InputError(
            f"none of {len(jobs)} scenes could be measured ({scene_id}: {why}); tracebacks are in "
            f"{folder / 'logs'}"
        )
    report = summarise(
        scenes, classes=config.run.classes, completers=completers, seed=config.run.seed
    )
    text = report_json(
        report,
        scenes,
        failures=failures,
        settings={
            "completers": [asdict(item) for item in completers],
            "config": config.model_dump(mode="json", exclude={"run": {"workers"}}),
        },
    )
    # The classes in turn.
    measured = sorted(
        (scene.scene_id for scene in scenes), key=lambda name: name.rpartition("-")[::-1]
    )
    write_sheet(folder / "sheet.png", [plan.pictures / f"{name}.png" for name in measured])
    write_text(folder / "report.json", text)
    return CompletionResult(
        folder=folder,
        report=report,
        text=text,
        scenes=len(jobs),
        failures=failures,
        seconds=time.monotonic() - start,
    )


def _configuration(options: CompletionOptions) -> Config:
    if not options.completers:
        raise InputError(f"no --completer; name one, such as {COMPLETERS[0]}")
    unknown = [name for name in options.classes if name not in CLASS_NAMES[1:]]
    if unknown:
        raise InputError(f"--class {unknown[0]}: use one of {', '.join(CLASS_NAMES[1:])}")
    objects = None if options.objects is None else str(options.objects.resolve())
    chosen = (
        Override("run.scenes", options.scenes, "--scenes"),
        Override("run.seed", options.seed, "--seed"),
        Override("run.workers", options.workers, "--workers"),
        Override("run.classes", tuple(options.classes) or None, "--class"),
        Override("scenes.views", options.views, "--views"),
        Override("scenes.objects", objects, "--objects"),
        Override("scenes.cluttered", options.cluttered or None, "--cluttered"),
        Override("pipeline.completer", options.completers[0], "--completer"),
        Override("pipeline.segmenter", "oracle", "--config"),
    )
    overrides = tuple(override for override in chosen if override.value is not None)
    return load_config(options.config, overrides=overrides)


def _check_completers(completers: Sequence[Completer], *, config: Config) -> None:
    """Refuse what no scene could be completed by, such as a network without its weights."""
    for completer in completers:
        try:
            Pipeline(with_completer(config, completer).pipeline_json())
        except (ValueError, OSError) as error:
            raise InputError(f"--completer {completer.setting}: {error}") from error


def _default_folder(config: Config) -> Path:
    folder = default_folder(config)
    return folder.with_name(f"completion-{folder.name}")


def _begin(folder: Path) -> None:
    """Make the folders of a report."""
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder} exists and is not an empty folder; pass another --out")
        for name in ("pictures", "logs"):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DiskError(
            f"cannot write to {folder}: {error.strerror}; pass a writable --out"
        ) from None


def _measure(
    jobs: Sequence[SceneJob],
    *,
    config: Config,
    plan: Plan,
    logs: Path,
    progress: Progress,
    scene_function: str,
) -> tuple[list[SceneRows], dict[str, str]]:
    """Measure scenes on workers; returns their rows, and why others failed, by scene id."""
    cores = core_count()
    pool = ScenePool(
        target=scene_function,
        arguments=(config, plan),
        workers=min(config.run.workers or cores, len(jobs)),
        cores=cores,
        log_folder=logs,
        result_type=SceneRows,
    )
    scenes: list[SceneRows] = []
    failures: dict[str, str] = {}
    # Closing the events, as an interrupt does, kills the workers.
    with closing(pool.run(jobs)) as events:
        for event in events:
            match event:
                case SceneDone(job=job, result=result, seconds=seconds):
                    scenes.append(result)
                    progress.scene_done(job.scene_id, seconds)
                case SceneFailed(job=job, failure=failure):
                    failures[job.scene_id] = failure
                    progress.scene_failed(job.scene_id, failure)
                case WorkerDied(job=job, reason=reason, log=log):
                    progress.note(
                        f"worker {reason} at {job.scene_id}; trying it once more (log: {log})"
                    )
    return scenes, failures
