"""What every engine promises: jobs in, events out, in no fixed order.

1. A job that raises fails at once with its reason: a job is a pure function of what it holds.
2. A job whose worker or node dies is tried once more, for the cause may be a passing one such as a
   lack of memory; when its workers have died `ATTEMPTS` times it fails.
3. An engine computes and hands back; it writes nothing but logs. Whoever takes the events keeps
   the results, so that there is one writer wherever the jobs ran.
4. Results do not depend on the engine, on the number of workers or on their threads.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping, Sequence
    from pathlib import Path

ATTEMPTS = 2
"""How often a job is tried when its worker dies."""

THREAD_LIMITS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "RAYON_NUM_THREADS",
    "POLARS_MAX_THREADS",
)
"""Environment variables that limit a worker's threads; they must be set before it starts."""


class Job(Protocol):
    """Something to compute; it is pickled."""

    @property
    def scene_id(self) -> str:
        """Name of the job, unique among those of a call."""
        ...


JobT = TypeVar("JobT", bound=Job)
Result = TypeVar("Result")


@dataclass(frozen=True)
class Work(Generic[Result]):
    """What is done with every job.

    Attributes
    ----------
    target
        The function as ``package.module:name``; called with a job and `arguments`.
    result_type
        What it returns; anything else fails its job.
    arguments
        Further arguments of every call; they are pickled.
    files
        What the function reads besides the code: the sha256 of each file by its absolute path. An
        engine on other machines refuses those where a file is another.
    """

    target: str
    result_type: type[Result]
    arguments: tuple[Any, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict)

    def wrong_type(self, result: object) -> str | None:
        """Say that a result is of another type than promised; None where it is not."""
        if isinstance(result, self.result_type):
            return None
        found, wanted = type(result).__name__, self.result_type.__name__
        return f"the scene function returned a {found}, not a {wanted}"


@dataclass(frozen=True)
class SceneDone(Generic[JobT, Result]):
    """A job was computed.

    Attributes
    ----------
    seconds
        Wall time of the function.
    peak_memory_mib
        Highest resident memory of its process meanwhile, MiB.
    """

    job: JobT
    result: Result
    seconds: float
    peak_memory_mib: float


@dataclass(frozen=True)
class SceneFailed(Generic[JobT]):
    """A job was lost: it raised, or its workers died."""

    job: JobT
    failure: str


@dataclass(frozen=True)
class WorkerDied(Generic[JobT]):
    """A worker died at a job, which is tried again.

    Attributes
    ----------
    reason
        How it ended, such as ``killed by SIGKILL``.
    where
        Where to look for more, such as its log.
    """

    job: JobT
    reason: str
    where: str

    def __str__(self) -> str:
        return f"worker {self.reason} at {self.job.scene_id}; trying it once more ({self.where})"


Event: TypeAlias = SceneDone[JobT, Result] | SceneFailed[JobT] | WorkerDied[JobT]


class UnusableWorkerError(InputError):
    """No worker can start, or run the function."""


class Engine(Protocol):
    """Computes jobs."""

    def run(
        self, work: Work[Result], jobs: Sequence[JobT], *, logs: Path
    ) -> Generator[Event[JobT, Result]]:
        """Compute jobs; events come as they happen, in no fixed order.

        Closing the iterator, as an exception in its loop does, stops the workers: wrap it in
        `contextlib.closing`.

        Parameters
        ----------
        work
            What to do with each job.
        jobs
            What to compute.
        logs
            An existing folder; takes what workers print, and tracebacks.

        Raises
        ------
        UnusableWorkerError
            A worker cannot import the function.
        InputError
            The engine cannot be reached.
        """
        ...


@dataclass(frozen=True)
class Attempt(Generic[JobT]):
    """A job, and which try at it this is."""

    job: JobT
    number: int = 1

    def after_death(
        self, *, reason: str, where: str
    ) -> tuple[Attempt[JobT] | None, WorkerDied[JobT] | SceneFailed[JobT]]:
        """Return the next attempt, if there is one, and what to tell."""
        if self.number < ATTEMPTS:
            return Attempt(self.job, self.number + 1), WorkerDied(self.job, reason, where)
        failure = f"its worker died {ATTEMPTS} times; last: {reason}"
        return None, SceneFailed(self.job, failure)
