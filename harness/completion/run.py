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
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from harness.bench import load_objects
from harness.completion.baselines import BASELINES
from harness.completion.mean_shape import mean_shape
from harness.completion.pictures import write_sheet
from harness.completion.report import report_json
from harness.completion.rows import Completer, SceneRows
from harness.completion.scene import Plan, with_completer
from harness.completion.summary import Report, summarise
from harness.config import Config, Override, load_config
from harness.errors import InputError
from harness.native import CLASS_NAMES, Pipeline
from harness.runs.atomic import write_text
from harness.runs.directory import default_folder
from harness.runs.job import plan_jobs
from harness.runs.progress import Progress, SilentProgress
from harness.runs.report import begin_folder, measure_scenes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path


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
    begin_folder(folder, parts=("pictures", "logs"))
    plan = Plan(
        completers=completers,
        mean_shapes={category: mean_shape(category) for category in config.run.classes},
        pictures=folder / "pictures",
    )
    with progress.watch(folder=folder, scenes=len(jobs), finished=0):
        scenes, failures = measure_scenes(
            jobs,
            target=scene_function or SCENE_FUNCTION,
            arguments=(config, plan),
            result_type=SceneRows,
            workers=config.run.workers,
            logs=folder / "logs",
            progress=progress,
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
        Override("pipeline.segmenter", "oracle", "--config"),
    )
    overrides = tuple(override for override in chosen if override.value is not None)
    return load_config(options.config, overrides=overrides)


def _check_completers(completers: Sequence[Completer], *, config: Config) -> None:
    """Refuse names that rows would share, and what no scene could be completed by.

    The latter is such as a network without its weights.
    """
    owners = {name: f"the baseline '{name}'" for name in BASELINES}
    for completer in completers:
        if completer.name in owners:
            raise InputError(
                f"--completer {completer.setting}: its rows would be named '{completer.name}' as "
                f"those of {owners[completer.name]}; give the function another name"
            )
        owners[completer.name] = completer.setting
        try:
            Pipeline(with_completer(config, completer).pipeline_json())
        except (ValueError, OSError) as error:
            raise InputError(f"--completer {completer.setting}: {error}") from error


def _default_folder(config: Config) -> Path:
    folder = default_folder(config)
    return folder.with_name(f"completion-{folder.name}")
