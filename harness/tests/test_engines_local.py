"""Worker processes: what is reported of deaths and exceptions, and that none is left behind."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections import Counter
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from harness.config import Config
from harness.engines.engine import (
    Event,
    SceneDone,
    SceneFailed,
    UnusableWorkerError,
    Work,
    WorkerDied,
)
from harness.engines.local import LocalEngine
from harness.runs.job import SceneJob
from harness.runs.records import SceneResult
from harness.tests import fake_scenes
from harness.tests.fake_scenes import begun, is_alive

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from pathlib import Path

JOBS = [SceneJob(f"mug-{i:04d}", "mug", "mug_0", seed=i) for i in range(5)]


SceneEvent = Event[SceneJob, SceneResult]


def compute(
    jobs: Sequence[SceneJob],
    folder: Path,
    *,
    function: str = "run_scene",
    workers: int = 2,
    threads: int = 1,
) -> Generator[SceneEvent]:
    logs = folder / "logs"
    logs.mkdir(exist_ok=True)
    work = Work(f"{fake_scenes.__name__}:{function}", SceneResult, (Config(),))
    return LocalEngine(workers=workers, threads=threads).run(work, jobs, logs=logs)


def test_every_job_is_computed_once_on_as_many_processes_as_asked(
    orders: Path, tmp_path: Path
) -> None:
    events = list(compute(JOBS, tmp_path, workers=2))
    assert sorted(event.job.scene_id for event in events) == [job.scene_id for job in JOBS]
    for event in events:
        assert isinstance(event, SceneDone)
        assert event.result == fake_scenes.run_scene(event.job, Config())
        assert event.seconds >= 0
        assert 10 < event.peak_memory_mib < 10_000
    pids = {pid for pid, _ in begun(orders)} - {os.getpid()}
    assert len(pids) == 2
    assert not any(is_alive(pid) for pid in pids)
    assert list((tmp_path / "logs").iterdir()) == []


@pytest.mark.parametrize(
    ("order", "reason"), [("die", "killed by SIGKILL"), ("exit", "exit code 3")]
)
def test_a_dead_workers_scene_is_retried_once_in_a_fresh_worker(
    orders: Path, tmp_path: Path, order: str, reason: str
) -> None:
    (orders / "mug-0001").write_text(f"once {order}", encoding="utf-8")
    events = list(compute(JOBS, tmp_path, workers=1))
    deaths = [event for event in events if isinstance(event, WorkerDied)]
    assert [(event.job, event.reason) for event in deaths] == [(JOBS[1], reason)]
    assert {event.job for event in events if isinstance(event, SceneDone)} == set(JOBS)
    first, second = (pid for pid, scene in begun(orders) if scene == "mug-0001")
    assert first != second


def test_a_scene_that_kills_two_workers_fails_and_the_others_go_on(
    orders: Path, tmp_path: Path
) -> None:
    (orders / "mug-0001").write_text("die", encoding="utf-8")
    events = list(compute(JOBS, tmp_path, workers=2))
    failed = [event for event in events if isinstance(event, SceneFailed)]
    assert [(event.job, event.failure) for event in failed] == [
        (JOBS[1], "its worker died 2 times; last: killed by SIGKILL")
    ]
    assert len([event for event in events if isinstance(event, SceneDone)]) == len(JOBS) - 1
    assert Counter(scene for _, scene in begun(orders))["mug-0001"] == 2


def test_an_exception_fails_its_scene_without_retry_and_leaves_its_traceback(
    orders: Path, tmp_path: Path
) -> None:
    (orders / "mug-0001").write_text("raise", encoding="utf-8")
    events = list(compute(JOBS, tmp_path, workers=1))
    failed = [event for event in events if isinstance(event, SceneFailed)]
    assert [(event.job, event.failure) for event in failed] == [
        (JOBS[1], "RuntimeError: no such luck in mug-0001")
    ]
    assert len(begun(orders)) == len(JOBS)
    (log,) = (tmp_path / "logs").iterdir()
    assert "Traceback" in log.read_text(encoding="utf-8")


def test_a_function_that_returns_something_else(tmp_path: Path) -> None:
    (event,) = compute(JOBS[:1], tmp_path, function="returns_nothing")
    assert event == SceneFailed(
        JOBS[0], "the scene function returned a NoneType, not a SceneResult"
    )


def test_a_function_that_cannot_be_imported_stops_the_run(tmp_path: Path) -> None:
    with pytest.raises(UnusableWorkerError, match="workers cannot run scenes: AttributeError"):
        list(compute(JOBS, tmp_path, function="no_such_function"))


@pytest.mark.parametrize(("workers", "threads"), [(1, 3), (2, 1), (2, 3)])
def test_a_workers_threads_do_not_depend_on_their_number(
    tmp_path: Path, workers: int, threads: int
) -> None:
    events = compute(JOBS[:2], tmp_path, function="thread_limits", workers=workers, threads=threads)
    limits = {event.failure for event in events if isinstance(event, SceneFailed)}
    assert limits == {f"RuntimeError: {threads} {threads}"}


def test_leaving_early_leaves_no_process(orders: Path, tmp_path: Path) -> None:
    (orders / "mug-0001").write_text("sleep", encoding="utf-8")
    with closing(compute(JOBS, tmp_path, workers=2)) as events:
        next(events)
    pids = {pid for pid, _ in begun(orders)}
    assert pids
    assert not any(is_alive(pid) for pid in pids)


def test_a_worker_killed_from_outside_in_the_middle_of_a_scene(
    orders: Path, tmp_path: Path
) -> None:
    (orders / "mug-0000").write_text("once sleep", encoding="utf-8")
    events = compute(JOBS[:1], tmp_path, workers=1)

    def kill_once_begun() -> None:
        while not (orders / "begun").exists() or (orders / "mug-0000").exists():
            time.sleep(0.01)
        os.kill(begun(orders)[0][0], signal.SIGKILL)

    killer = threading.Thread(target=kill_once_begun, daemon=True)
    killer.start()
    first, second = events
    killer.join()
    assert isinstance(first, WorkerDied)
    assert first.reason == "killed by SIGKILL"
    assert isinstance(second, SceneDone)
