"""Worker processes on this machine, and what happens when one of them dies.

1. Each worker is a fresh interpreter with its own limits on threads, set in its environment
   before anything is imported. `multiprocessing`'s spawn imports the parent's main module first,
   which is too late for the limits of OpenMP.
2. A worker has one job at a time. The pipe to it is its lifeline: it leaves at once when the
   parent closes its end or dies, kill -9 included.
3. A worker that dies is noticed by the pipe's end; its job is tried once more in a fresh worker.
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
from typing import TYPE_CHECKING, Any, cast

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
from harness.engines.worker import Done, Raised, Unusable
from harness.runs.atomic import DiskError
from harness.runs.manifest import core_count

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence

_START_WORKER = (
    "import sys; from harness.engines.worker import main; main(int(sys.argv[1]), sys.argv[2])"
)
_FAREWELL_S = 5.0


@dataclass(frozen=True)
class LocalEngine:
    """Computes jobs on worker processes of this machine; see `harness.engines.engine.Engine`.

    Attributes
    ----------
    workers
        Number of processes, by default one per core; never more than there are jobs.
    threads
        Of each. One by default, as a task of a cluster has: so many workers take so many cores,
        and parts of a job that are not threaded leave none idle.
    """

    workers: int | None = None
    threads: int = 1

    def run(
        self, work: Work[Result], jobs: Sequence[JobT], *, logs: Path
    ) -> Generator[Event[JobT, Result]]:
        """See `Engine`; closing the iterator kills the workers."""
        workers = min(self.workers or core_count(), len(jobs))
        crew = _Crew(target=work.target, threads=self.threads, logs=logs)
        waiting = deque(Attempt(job) for job in jobs)
        busy: dict[Connection, tuple[_Worker, Attempt[JobT]]] = {}
        try:
            while waiting or busy:
                while waiting and len(busy) < workers:
                    worker, attempt = crew.start(), waiting.popleft()
                    worker.assign((attempt.job, *work.arguments))
                    busy[worker.connection] = (worker, attempt)
                for connection in wait(list(busy)):
                    worker, attempt = busy.pop(cast("Connection", connection))
                    message = worker.receive()
                    if message is None:
                        reason = crew.bury(worker)
                        again, event = attempt.after_death(
                            reason=reason, where=f"log: {worker.log}"
                        )
                        if again is not None:
                            waiting.appendleft(again)
                        yield event
                        continue
                    if isinstance(message, Unusable):
                        raise UnusableWorkerError(
                            f"workers cannot run scenes: {message.reason}; see {worker.log}"
                        )
                    # The next job before the event: whoever takes that may be slow.
                    if waiting and waiting[0].number == 1:
                        following = waiting.popleft()
                        worker.assign((following.job, *work.arguments))
                        busy[worker.connection] = (worker, following)
                    else:
                        crew.dismiss(worker)
                    yield _event(attempt.job, message, work)
        finally:
            crew.kill()


def _event(
    job: JobT, message: Done | Raised, work: Work[Result]
) -> SceneDone[JobT, Result] | SceneFailed[JobT]:
    if isinstance(message, Raised):
        return SceneFailed(job, message.failure)
    if wrong := work.wrong_type(message.result):
        return SceneFailed(job, wrong)
    return SceneDone(job, message.result, message.seconds, message.peak_memory_mib)


class _Crew:
    """The workers of one call: started, dismissed and buried."""

    def __init__(self, *, target: str, threads: int, logs: Path) -> None:
        self._target = target
        self._threads = threads
        self._logs = logs
        self._alive: list[_Worker] = []
        self._started = 0

    def start(self) -> _Worker:
        self._started += 1
        log = self._logs / f"worker-{os.getpid()}-{self._started}.log"
        ours, theirs = Pipe()
        environment = os.environ | dict.fromkeys(THREAD_LIMITS, str(self._threads))
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

    def dismiss(self, worker: _Worker) -> None:
        """Let an idle worker go."""
        worker.connection.close()
        try:
            worker.process.wait(_FAREWELL_S)
        except subprocess.TimeoutExpired:
            worker.process.kill()
        self.bury(worker)

    def bury(self, worker: _Worker) -> str:
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

    def kill(self) -> None:
        """End whoever is left."""
        for worker in list(self._alive):
            worker.process.kill()
            self.bury(worker)


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
