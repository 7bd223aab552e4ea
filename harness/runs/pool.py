"""Worker processes that compute scenes, and what happens when one of them dies.

1. Each worker is a fresh interpreter with its own limits on threads, set in its environment
   before anything is imported. `multiprocessing`'s spawn imports the parent's main module first,
   which is too late for the limits of OpenMP.
2. A worker has one job at a time. The pipe to it is its lifeline: it leaves at once when the
   parent closes its end or dies, kill -9 included.
3. A worker that dies is noticed by the pipe's end; its scene is tried once more in a fresh worker,
   for the cause may be a passing one such as a lack of memory.
4. A scene that raises is not tried again: a scene is a pure function of its seed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections import deque
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar, cast

from harness.errors import InputError
from harness.runs.atomic import DiskError
from harness.runs.worker import Done, Raised, Unusable

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence

    from harness.runs.job import SceneJob

Result = TypeVar("Result")

ATTEMPTS = 2
"""How often a scene is tried when its worker dies."""

_THREAD_LIMITS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "RAYON_NUM_THREADS",
    "POLARS_MAX_THREADS",
)
_START_WORKER = (
    "import sys; from harness.runs.worker import main; main(int(sys.argv[1]), sys.argv[2])"
)
_FAREWELL_S = 5.0


@dataclass(frozen=True)
class SceneDone(Generic[Result]):
    """A scene was computed."""

    job: SceneJob
    result: Result
    seconds: float
    peak_memory_mib: float


@dataclass(frozen=True)
class SceneFailed:
    """A scene was lost: it raised, or its workers died."""

    job: SceneJob
    failure: str


@dataclass(frozen=True)
class WorkerDied:
    """A worker died at a scene, which is tried again."""

    job: SceneJob
    reason: str
    log: Path


PoolEvent: TypeAlias = SceneDone[Result] | SceneFailed | WorkerDied


class UnusableWorkerError(InputError):
    """No worker can start."""


@dataclass(frozen=True)
class _Attempt:
    job: SceneJob
    number: int = 1


class ScenePool(Generic[Result]):
    """Computes scenes on worker processes.

    Parameters
    ----------
    target
        The scene function as ``package.module:name``; called with a job and `arguments`.
    result_type
        What it returns; anything else fails its scene.
    arguments
        Further arguments of every call; they are pickled.
    workers
        Number of processes.
    cores
        Cores to share among them: each may start ``cores // workers`` threads, one at least.
    log_folder
        Takes what the workers print, a file for each that printed anything.
    """

    def __init__(
        self,
        *,
        target: str,
        result_type: type[Result],
        arguments: tuple[Any, ...],
        workers: int,
        cores: int,
        log_folder: Path,
    ) -> None:
        self._target = target
        self._result_type = result_type
        self._arguments = arguments
        self._workers = workers
        self._threads = max(1, cores // workers)
        self._log_folder = log_folder
        self._alive: list[_Worker] = []
        self._started = 0

    def run(self, jobs: Sequence[SceneJob]) -> Generator[PoolEvent[Result]]:
        """Compute jobs; events come as they happen, in no fixed order.

        Closing the iterator, as an exception in its loop does, kills the workers.

        Raises
        ------
        UnusableWorkerError
            A worker cannot import the scene function.
        """
        waiting = deque(_Attempt(job) for job in jobs)
        busy: dict[Connection, tuple[_Worker, _Attempt]] = {}
        try:
            while waiting or busy:
                while waiting and len(busy) < self._workers:
                    worker, attempt = self._start(), waiting.popleft()
                    worker.assign((attempt.job, *self._arguments))
                    busy[worker.connection] = (worker, attempt)
                for connection in wait(list(busy)):
                    worker, attempt = busy.pop(cast("Connection", connection))
                    message = worker.receive()
                    if message is None:
                        reason = self._bury(worker)
                        if attempt.number < ATTEMPTS:
                            waiting.appendleft(_Attempt(attempt.job, attempt.number + 1))
                            yield WorkerDied(attempt.job, reason, worker.log)
                        else:
                            yield SceneFailed(
                                attempt.job, f"its worker died {ATTEMPTS} times; last: {reason}"
                            )
                        continue
                    if isinstance(message, Unusable):
                        raise UnusableWorkerError(
                            f"workers cannot run scenes: {message.reason}; see {worker.log}"
                        )
                    if waiting and waiting[0].number == 1:
                        following = waiting.popleft()
                        worker.assign((following.job, *self._arguments))
                        busy[worker.connection] = (worker, following)
                    else:
                        self._dismiss(worker)
                    yield self._event(attempt.job, message)
        finally:
            for worker in list(self._alive):
                worker.process.kill()
                self._bury(worker)

    def _event(self, job: SceneJob, message: Done | Raised) -> SceneDone[Result] | SceneFailed:
        if isinstance(message, Raised):
            return SceneFailed(job, message.failure)
        if not isinstance(message.result, self._result_type):
            found, wanted = type(message.result).__name__, self._result_type.__name__
            return SceneFailed(job, f"the scene function returned a {found}, not a {wanted}")
        return SceneDone(job, message.result, message.seconds, message.peak_memory_mib)

    def _start(self) -> _Worker:
        self._started += 1
        log = self._log_folder / f"worker-{os.getpid()}-{self._started}.log"
        ours, theirs = Pipe()
        environment = os.environ | dict.fromkeys(_THREAD_LIMITS, str(self._threads))
        environment["PYTHONPATH"] = os.pathsep.join(entry or str(Path.cwd()) for entry in sys.path)
        descriptor = theirs.fileno()
        try:
            output = log.open("ab")
        except OSError as error:
            raise DiskError(f"cannot write {log}: {error.strerror}; free the disk") from None
        with theirs, output:
            process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START_WORKER, str(descriptor), self._target],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=environment,
                pass_fds=(descriptor,),
                process_group=0,  # a terminal's Ctrl-C reaches the parent alone
            )
        worker = _Worker(process=process, connection=ours, log=log)
        self._alive.append(worker)
        return worker

    def _dismiss(self, worker: _Worker) -> None:
        """Let an idle worker go."""
        worker.connection.close()
        try:
            worker.process.wait(_FAREWELL_S)
        except subprocess.TimeoutExpired:
            worker.process.kill()
        self._bury(worker)

    def _bury(self, worker: _Worker) -> str:
        """Collect a worker that has gone or is going; returns how it ended."""
        worker.connection.close()
        try:
            code = worker.process.wait(_FAREWELL_S)
        except subprocess.TimeoutExpired:
            worker.process.kill()
            code = worker.process.wait()
        self._alive.remove(worker)
        if worker.log.stat().st_size == 0:
            worker.log.unlink()
        return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


@dataclass(frozen=True)
class _Worker:
    process: subprocess.Popen[bytes]
    connection: Connection
    log: Path

    def assign(self, arguments: tuple[Any, ...]) -> None:
        """Send a job; a worker that has died shows at the next `receive`."""
        try:
            self.connection.send(arguments)
        except BrokenPipeError:
            return

    def receive(self) -> Done | Raised | Unusable | None:
        """Take the answer; None when the worker has died."""
        try:
            message: Done | Raised | Unusable = self.connection.recv()
        except (EOFError, OSError):
            return None
        return message
