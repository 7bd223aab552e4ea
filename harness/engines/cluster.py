"""A Ray cluster: every job is a task of one CPU; this process alone takes and keeps the results.

1. A task is submitted without Ray's own retries: deaths of workers and nodes are counted here, as
   `LocalEngine` counts them.
2. So many tasks wait at the cluster that no CPU idles, and no more: a plan may hold 100,000.
3. The nodes need the caller's code, packages and meshes under the same paths: one checkout or
   image. Each task compares them before it computes, so that nodes that join later are seen too.
4. A task has the limits on threads of a local worker with one core, set before its process starts.
"""

from __future__ import annotations

import logging
import os
import pickle
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic

from harness.engines.address import import_ray
from harness.engines.engine import (
    THREAD_LIMITS,
    Attempt,
    Event,
    JobT,
    Result,
    SceneDone,
    SceneFailed,
    UnusableWorkerError,
    Work,
)
from harness.engines.identity import code_identity
from harness.engines.worker import Raised, Unusable
from harness.errors import InputError
from harness.runs.atomic import DiskError

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from pathlib import Path

PATIENCE_S = 300.0
"""How long a cluster may have no CPU at all: one that scales needs minutes for its first node."""
_LOOK_S = 1.0
"""How often to look how large the cluster is, seconds."""
_QUEUED_PER_CPU = 2
"""Tasks at the cluster for each CPU: one that runs, and one that waits to follow it."""

_DEATHS = {
    "WorkerCrashedError": "crashed",
    "NodeDiedError": "lost with its node",
    "OutOfMemoryError": "killed by Ray for want of memory",
    "ObjectLostError": "lost with its node before the result was fetched",
}


@dataclass(frozen=True)
class RayEngine:
    """Computes jobs on a Ray cluster; see `harness.engines.engine.Engine`.

    Attributes
    ----------
    address
        As `harness.engines.address.check_address` accepts it.
    workers
        Most tasks at the cluster at a time, by default as many as keep its CPUs busy.
    """

    address: str
    workers: int | None = None

    def run(
        self, work: Work[Result], jobs: Sequence[JobT], *, logs: Path
    ) -> Generator[Event[JobT, Result]]:
        """See `Engine`; closing the iterator cancels the tasks and leaves the cluster."""
        ray = import_ray()
        try:
            ray.init(
                address=self.address,
                log_to_driver=False,
                logging_level=logging.ERROR,
                runtime_env={"env_vars": dict.fromkeys(THREAD_LIMITS, "1")},
            )
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise InputError(f"cannot join the Ray cluster at {self.address}: {error}") from error
        try:
            yield from _Tasks(self, work, ray=ray, logs=logs).events(jobs)
        finally:
            ray.shutdown()


class _Tasks(Generic[Result]):
    """The tasks of one call."""

    def __init__(self, engine: RayEngine, work: Work[Result], *, ray: Any, logs: Path) -> None:
        self._engine = engine
        self._work = work
        self._ray = ray
        self._log = logs / f"ray-{os.getpid()}.log"
        self._identity = code_identity()
        self._files = dict(work.files)
        task = ray.remote(num_cpus=1, max_retries=0, scheduling_strategy="SPREAD")
        self._task = task(_by_value())
        self._looked = self._had_cpu = time.monotonic()
        self._limit = self._look()

    def events(self, jobs: Sequence[JobT]) -> Generator[Event[JobT, Result]]:
        """Compute jobs."""
        waiting = deque(Attempt(job) for job in jobs)
        pending: dict[Any, Attempt[JobT]] = {}
        try:
            while waiting or pending:
                if time.monotonic() - self._looked > _LOOK_S:
                    self._limit = self._look()
                while waiting and len(pending) < self._limit:
                    attempt = waiting.popleft()
                    packed = pickle.dumps((self._work.target, attempt.job, self._work.arguments))
                    task = self._task.remote(self._identity, self._files, packed)
                    pending[task] = attempt
                ready, _ = self._ray.wait(list(pending), num_returns=1, timeout=_LOOK_S)
                for reference in ready:
                    attempt = pending.pop(reference)
                    answer = self._fetch(reference)
                    if isinstance(answer, _Death):
                        again, event = attempt.after_death(
                            reason=answer.reason, where=f"Ray cluster {self._engine.address}"
                        )
                        if again is not None:
                            waiting.appendleft(again)
                        yield event
                    else:
                        yield self._event(attempt.job, answer)
        finally:
            for reference in pending:
                self._ray.cancel(reference, force=True)

    def _fetch(self, reference: Any) -> Any:
        """Take a task's answer, or how it died."""
        exceptions = self._ray.exceptions
        try:
            return self._ray.get(reference)
        except exceptions.RayTaskError as error:
            trace = str(error)
            return Raised(" ".join(trace.splitlines()[-1:]), trace)
        except (exceptions.RuntimeEnvSetupError, exceptions.TaskUnschedulableError) as error:
            raise UnusableWorkerError(
                f"the Ray cluster at {self._engine.address} cannot start workers: {_brief(error)}"
            ) from error
        except exceptions.RayError as error:
            kinds = (kind.__name__ for kind in type(error).__mro__)
            reason = next((_DEATHS[kind] for kind in kinds if kind in _DEATHS), None)
            if reason is None:
                raise InputError(
                    f"lost the Ray cluster at {self._engine.address} ({_brief(error)}); when it "
                    "answers again, run the command once more with the same --out to continue"
                ) from error
            return _Death(reason)

    def _event(self, job: JobT, answer: Any) -> SceneDone[JobT, Result] | SceneFailed[JobT]:
        if isinstance(answer, Unusable | str):
            reason = answer.reason if isinstance(answer, Unusable) else answer
            raise UnusableWorkerError(
                f"the Ray cluster at {self._engine.address} cannot run scenes: {reason}"
            )
        if isinstance(answer, Raised):
            self._write(job.scene_id, answer.trace)
            return SceneFailed(job, answer.failure)
        if wrong := self._work.wrong_type(answer.result):
            return SceneFailed(job, wrong)
        return SceneDone(job, answer.result, answer.seconds, answer.peak_memory_mib)

    def _look(self) -> int:
        """How many tasks the cluster should hold."""
        self._looked = time.monotonic()
        cpus = int(self._ray.cluster_resources().get("CPU", 0))
        if cpus:
            self._had_cpu = self._looked
        elif self._looked - self._had_cpu > PATIENCE_S:
            raise InputError(
                f"the Ray cluster at {self._engine.address} has had no CPU for {PATIENCE_S:.0f} s; "
                "start a node with `ray start --address`, then run the command again to continue"
            )
        return self._engine.workers or max(1, cpus * _QUEUED_PER_CPU)

    def _write(self, scene_id: str, trace: str) -> None:
        try:
            with self._log.open("a", encoding="utf-8") as file:
                file.write(f"{scene_id}\n{trace}\n")
        except OSError as error:
            raise DiskError(f"cannot write {self._log}: {error.strerror}; free the disk") from None


@dataclass(frozen=True)
class _Death:
    reason: str


def _by_value() -> Any:
    """Make the task's function; Ray sends an inner function as code, so nodes can lack ours."""

    def scene(expected: dict[str, str], files: dict[str, str], packed: bytes) -> Any:
        try:
            from harness.engines.remote import serve
        except ImportError as error:
            import platform

            return (
                f"node {platform.node()} cannot import our code ({error}); give it the same "
                "checkout, built wheel and virtual environment"
            )
        return serve(expected, files, packed)

    return scene


def _brief(error: Exception) -> str:
    """Name an error of Ray, whose messages run over many lines, by its first sentence."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
