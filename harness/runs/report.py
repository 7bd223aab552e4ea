"""What the reports on single stages share: a new folder, and scenes measured on workers."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, Any, TypeVar

from harness.engines.engine import SceneDone, SceneFailed, Work, WorkerDied
from harness.engines.local import LocalEngine
from harness.errors import InputError
from harness.runs.atomic import DiskError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from harness.runs.job import SceneJob
    from harness.runs.progress import Progress

Rows = TypeVar("Rows")


def begin_folder(folder: Path, *, parts: Sequence[str]) -> None:
    """Make a report's folder and the folders in it.

    Raises
    ------
    InputError
        It is taken, or cannot be written.
    """
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder} exists and is not an empty folder; pass another --out")
        for name in parts:
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DiskError(
            f"cannot write to {folder}: {error.strerror}; pass a writable --out"
        ) from None


def measure_scenes(
    jobs: Sequence[SceneJob],
    *,
    target: str,
    arguments: tuple[Any, ...],
    result_type: type[Rows],
    logs: Path,
    progress: Progress,
    workers: int | None = None,
    threads: int = 1,
) -> tuple[list[Rows], dict[str, str]]:
    """Measure scenes on workers; returns their rows, and why others failed, by scene id.

    Parameters
    ----------
    jobs
        The scenes; their rows come in no fixed order.
    target, arguments, result_type
        The scene function, as `Work` has it.
    logs
        Takes what workers print.
    progress
        Hears of every scene.
    workers
        Processes; by default one per core.
    threads
        Of each of them.
    """
    if not jobs:
        return [], {}
    logs.mkdir(parents=True, exist_ok=True)
    engine = LocalEngine(workers=workers, threads=threads)
    work = Work(target=target, result_type=result_type, arguments=arguments)
    rows: list[Rows] = []
    failures: dict[str, str] = {}
    # Closing the events, as an interrupt does, kills the workers.
    with closing(engine.run(work, jobs, logs=logs)) as events:
        for event in events:
            match event:
                case SceneDone(job=job, result=result, seconds=seconds):
                    rows.append(result)
                    progress.scene_done(job.scene_id, seconds)
                case SceneFailed(job=job, failure=failure):
                    failures[job.scene_id] = failure
                    progress.scene_failed(job.scene_id, failure)
                case WorkerDied():
                    progress.note(str(event))
    return rows, failures
