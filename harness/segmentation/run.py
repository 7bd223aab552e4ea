"""`harness segmentation-report`: plan the scenes, segment them on workers, write and summarise.

::

    OUT/
      report.json       settings, summary, failures; written last
      frames-NAME.png   a segmenter's best, median and worst frames: what it found, with scores, and
                        the true outlines in white
      reliability.png   share of the detections that is right by their score
      logs/             what workers printed, and tracebacks
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

from harness.bench import load_objects
from harness.config import Config, Override, check_test_sets, load_config
from harness.errors import InputError
from harness.native import CLASS_NAMES
from harness.runs.atomic import write_text
from harness.runs.directory import default_folder
from harness.runs.job import plan_jobs
from harness.runs.manifest import describe_session
from harness.runs.progress import Progress, SilentProgress
from harness.runs.report import begin_folder, measure_scenes
from harness.segmentation.loss import TABLE_CLASSES, Loss, PairedScene, losses
from harness.segmentation.numbers import POOLED, Report
from harness.segmentation.pictures import write_reliability, write_sheet
from harness.segmentation.report import report_json
from harness.segmentation.rows import Choice, SceneRows, TimedScene
from harness.segmentation.scene import Plan
from harness.segmentation.segmenter import make_segmenter, segmenter_json
from harness.segmentation.sheet import sheet_rows
from harness.segmentation.summary import summarise

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.runs.job import ObjectModel, SceneJob

SEGMENTERS = ("maskrcnn", "maskrcnn_rgbd")
SCENE_FUNCTION = "harness.segmentation.scene:find_instances"
TIMING_FUNCTION = "harness.segmentation.scene:time_scene"
LOSS_FUNCTION = "harness.segmentation.loss:evaluate_by_each"

TIMING_THREADS = 2
TIMED_SCENES = 1
"""Of each class, single and cluttered, that times are measured on."""


@dataclass(frozen=True)
class SegmentationOptions:
    """What a person chooses; None leaves a choice to the configuration.

    Attributes
    ----------
    objects
        Folder of meshes with a manifest; by default the benchmark's test split.
    scenes
        Scenes of each class, as many single as cluttered; the single ones are the first of a
        benchmark's.
    table
        Scenes of each class of `TABLE_CLASSES` on which the classifiers are run by each segmenter's
        masks and by the true ones.
    segmenters
        As ``pipeline.segmenter`` names them.
    classes
        Classes of the target; by default all that the objects have.
    seed, workers, config
        As for a benchmark.
    out
        Folder to write, new or empty; by default a new one under ``results``.
    """

    objects: Path | None = None
    scenes: int | None = None
    table: int = 0
    segmenters: Sequence[str] = SEGMENTERS
    classes: Sequence[str] = ()
    seed: int | None = None
    workers: int | None = None
    out: Path | None = None
    config: Path | None = None


@dataclass(frozen=True)
class SegmentationResult:
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
    loss: Loss | None
    text: str
    scenes: int
    failures: Mapping[str, str]
    seconds: float


def run_report(
    options: SegmentationOptions, *, progress: Progress | None = None
) -> SegmentationResult:
    """Measure the segmenters and write the report.

    Raises
    ------
    InputError
        Wrong options, configuration or objects; a folder that is taken or cannot be written;
        no scene could be measured.
    """
    start = time.monotonic()
    progress = progress or SilentProgress()
    config = _configuration(options)
    models = load_objects(config.scenes.objects)
    classes = _classes(options, models)
    jobs = plan_both(_of_classes(config, classes), models)
    pairs = plan_table(config, models, classes=classes, scenes=options.table)
    choices = tuple(Choice(name) for name in dict.fromkeys(options.segmenters))
    _check_choices(choices, config=config)
    folder = options.out or _default_folder(config)
    begin_folder(folder, parts=("logs",))
    plan = Plan(choices=choices)
    timed_jobs = [job for job in jobs if int(job.scene_id.split("-")[1]) < TIMED_SCENES]
    with progress.watch(folder=folder, scenes=len(jobs) + len(timed_jobs) + len(pairs), finished=0):
        scenes, failures = measure_scenes(
            jobs,
            target=SCENE_FUNCTION,
            arguments=(config, plan),
            result_type=SceneRows,
            workers=config.run.workers,
            logs=folder / "logs",
            progress=progress,
        )
        # Nothing else runs beside what is timed.
        timed, _ = measure_scenes(
            [
                replace(job, scene_id=f"{job.scene_id}-timed")
                for job in timed_jobs
                if job.scene_id not in failures
            ],
            target=TIMING_FUNCTION,
            arguments=(config, plan),
            result_type=TimedScene,
            workers=1,
            threads=TIMING_THREADS,
            logs=folder / "logs" / "timing",
            progress=progress,
        )
        loss = None
        if pairs:
            compared, lost = measure_scenes(
                pairs,
                target=LOSS_FUNCTION,
                arguments=(config, plan),
                result_type=PairedScene,
                workers=config.run.workers,
                logs=folder / "logs" / "table",
                progress=progress,
            )
            loss = losses(
                compared,
                choices=choices,
                failures=lost,
                tolerance_m=config.protocol.reported_tolerance_m,
                seed=config.run.seed,
            )
    if not scenes:
        scene_id, why = next(iter(failures.items()))
        raise InputError(
            f"none of {len(jobs)} scenes could be measured ({scene_id}: {why}); tracebacks are in "
            f"{folder / 'logs'}"
        )
    report = summarise(
        scenes,
        timed,
        choices=choices,
        least_score=float(config.pipeline["segmentation"]["least_score"]),
        seed=config.run.seed,
    )
    _write_pictures(folder, report, scenes, jobs=jobs, config=config)
    text = report_json(
        report,
        loss,
        failures=failures,
        settings={
            "segmenters": [asdict(item) for item in choices],
            "classes": classes,
            "table_scenes": options.table,
            "config": config.model_dump(mode="json", exclude={"run": {"workers"}}),
            "session": describe_session(),
        },
    )
    write_text(folder / "report.json", text)
    return SegmentationResult(
        folder=folder,
        report=report,
        loss=loss,
        text=text,
        scenes=len(jobs),
        failures=failures,
        seconds=time.monotonic() - start,
    )


def plan_both(config: Config, models: Sequence[ObjectModel]) -> list[SceneJob]:
    """List a run's scenes, and as many of the same targets among other objects."""
    single = [replace(job, cluttered=False) for job in plan_jobs(config, models)]
    return single + [
        replace(job, scene_id=f"{job.scene_id}-cluttered", cluttered=True) for job in single
    ]


def plan_table(
    config: Config, models: Sequence[ObjectModel], *, classes: Sequence[str], scenes: int
) -> list[SceneJob]:
    """List the scenes that the classifiers are run on: the first of a benchmark's."""
    chosen = [name for name in TABLE_CLASSES if name in classes]
    if scenes == 0 or not chosen:
        return []
    config = _of_classes(config, chosen)
    run = config.run.model_copy(update={"scenes": scenes})
    return plan_jobs(config.model_copy(update={"run": run}), models)


def _configuration(options: SegmentationOptions) -> Config:
    if not options.segmenters:
        raise InputError(f"no --segmenter; name one, such as {SEGMENTERS[0]}")
    if options.table < 0:
        raise InputError(f"--table {options.table}: ask for 1 scene or more, or leave it out")
    unknown = [name for name in options.classes if name not in CLASS_NAMES[1:]]
    if unknown:
        raise InputError(f"--class {unknown[0]}: use one of {', '.join(CLASS_NAMES[1:])}")
    objects = None if options.objects is None else str(options.objects.resolve())
    chosen = (
        Override("run.scenes", options.scenes, "--scenes"),
        Override("run.seed", options.seed, "--seed"),
        Override("run.workers", options.workers, "--workers"),
        Override("run.classes", tuple(options.classes) or None, "--class"),
        Override("scenes.objects", objects, "--objects"),
        Override("pipeline.segmenter", options.segmenters[0], "--segmenter"),
    )
    overrides = tuple(override for override in chosen if override.value is not None)
    config = load_config(options.config, overrides=overrides)
    return check_test_sets(config) if options.table else config


def _classes(options: SegmentationOptions, models: Sequence[ObjectModel]) -> tuple[str, ...]:
    if options.classes:
        return tuple(options.classes)
    return tuple(name for name in CLASS_NAMES[1:] if any(item.category == name for item in models))


def _of_classes(config: Config, classes: Sequence[str]) -> Config:
    run = config.run.model_copy(update={"classes": tuple(classes)})
    return config.model_copy(update={"run": run})


def _check_choices(choices: Sequence[Choice], *, config: Config) -> None:
    """Refuse names that rows would share, and segmenters that no scene could be segmented by."""
    by_name: dict[str, str] = {}
    for item in choices:
        if by_name.setdefault(item.name, item.setting) != item.setting:
            raise InputError(
                f"--segmenter {item.setting}: its rows would be named '{item.name}' as those of "
                f"{by_name[item.name]}; give the function another name"
            )
        try:
            make_segmenter(segmenter_json(config, item.setting))
        except (ValueError, OSError) as error:
            raise InputError(f"--segmenter {item.setting}: {error}") from error


def _write_pictures(
    folder: Path,
    report: Report,
    scenes: Sequence[SceneRows],
    *,
    jobs: Sequence[SceneJob],
    config: Config,
) -> None:
    for name in dict.fromkeys(item.segmenter for item in report.qualities):
        rows = sheet_rows(report, scenes, segmenter=name, jobs=jobs, config=config)
        write_sheet(folder / f"frames-{name}.png", rows)
    diagrams = [item for item in report.calibrations if item.headline and item.scenes == POOLED]
    names = dict.fromkeys(item.segmenter for item in diagrams)
    write_reliability(
        folder / "reliability.png",
        [[item for item in diagrams if item.segmenter == name] for name in names],
    )


def _default_folder(config: Config) -> Path:
    folder = default_folder(config)
    return folder.with_name(f"segmentation-{folder.name}")
