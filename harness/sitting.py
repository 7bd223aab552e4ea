"""One sitting at a run: compute the scenes that are not finished, keep them, and conclude."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

from harness.engines.engine import Engine, SceneDone, SceneFailed, Work, WorkerDied
from harness.engines.local import LocalEngine
from harness.engines.worker import load_target
from harness.results import tabulate
from harness.runs.atomic import DiskError
from harness.runs.confusion import write_confusion
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

    from harness.bench import Wiring
    from harness.config import Config
    from harness.runs.directory import RunDirectory
    from harness.runs.job import SceneJob
    from harness.runs.progress import Progress
    from harness.table.summary import Table


class RunInterruptedError(Exception):
    """A person stopped the run; its finished scenes are kept."""

    def __init__(self, *, finished: int, scenes: int, resume: str) -> None:
        super().__init__(
            f"interrupted: {finished} of {scenes} scenes are kept; continue with `{resume}`"
        )


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
    files: Mapping[str, str] | None = None,
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
    files
        The sha256 of each mesh by its path, for workers on other machines to check theirs.

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
    work = Work(
        target=scene_function, result_type=SceneResult, arguments=(config,), files=files or {}
    )
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
    # The last of all: with it the run is a finished one.
    write_records(records, run.records_path)
    return table
