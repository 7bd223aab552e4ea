"""A fixed workload that tells how fast the machine is at the moment.

The exact GP's posterior on a seeded problem, for that is what most of a benchmark's time goes to.
It runs as scenes do: in as many worker processes at once, each with its share of the cores. What
slows both the workload and the stages, such as other processes or a slower clock, cancels out of
the ratio of their times.
"""

from __future__ import annotations

import json
import statistics
import tempfile
import time
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from harness.engines.engine import SceneDone, SceneFailed, Work
from harness.engines.local import LocalEngine
from harness.errors import InputError
from harness.gate.margins import UNSTEADY
from harness.runs.atomic import write_text
from harness.runs.manifest import describe_session

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

CALIBRATION = "calibration.json"
"""Name of the file in a run's folder."""

TRAINING_POINTS = 1200
TEST_POINTS = 400
REPEATS = 16

_TARGET = f"{__name__}:work"


@dataclass(frozen=True)
class Machine:
    """What must be the same for times to be compared.

    Attributes
    ----------
    cpu
        Model of the processor.
    cores
        Cores that a process may use.
    workers
        Processes that compute scenes at once.
    """

    cpu: str
    cores: int
    workers: int

    @classmethod
    def of_session(cls, machine: Mapping[str, Any], *, workers: int | None, scenes: int) -> Self:
        """Read it from a sitting's ``machine`` in a manifest.

        Parameters
        ----------
        workers
            The configuration's ``run.workers``.
        scenes
            Of the run, for no more workers than these are started.
        """
        cores = int(machine["cores"])
        return cls(str(machine["cpu"]), cores, min(workers or cores, scenes))

    def unlike(self, other: Machine) -> str | None:
        """Say how another machine differs; None where it does not."""
        parts = [
            f"{name} {there} there, {here} here"
            for name, there, here in (
                ("processor", other.cpu, self.cpu),
                ("cores", other.cores, self.cores),
                ("workers", other.workers, self.workers),
            )
            if there != here
        ]
        return "; ".join(parts) or None


def this_machine(*, workers: int | None, scenes: int) -> Machine:
    """Describe this machine as one that computes so many scenes."""
    return Machine.of_session(describe_session()["machine"], workers=workers, scenes=scenes)


@dataclass(frozen=True)
class Calibration:
    """Times of the workload around a run.

    Attributes
    ----------
    seconds
        Median of all repeats.
    drift
        Median after the run over that before it; 1 where it was taken once.
    """

    machine: Machine
    seconds: float
    drift: float = 1.0

    @property
    def steady(self) -> bool:
        """Whether the machine's pace was nearly the same before and after."""
        return 1 / UNSTEADY <= self.drift <= UNSTEADY

    def to_json(self) -> dict[str, Any]:
        """Return what `from_json` reads."""
        return asdict(self)

    @classmethod
    def from_json(cls, value: object) -> Self:
        """Read what `to_json` returned.

        Raises
        ------
        ValueError
            It is none.
        """
        match value:
            case {
                "machine": {"cpu": str(cpu), "cores": int(cores), "workers": int(workers)},
                "seconds": float(seconds),
                "drift": float(drift),
            } if seconds > 0 and drift > 0:
                return cls(Machine(cpu, cores, workers), seconds, drift)
        raise ValueError("no calibration of a machine, seconds and drift")


@dataclass(frozen=True)
class Ticks:
    """Seconds of each repeat in one worker."""

    seconds: tuple[float, ...]


@dataclass(frozen=True)
class _Job:
    scene_id: str


def work(job: _Job) -> Ticks:
    """Do the workload in a worker; the first repeat warms up and is left out."""
    del job
    from harness.native import gp_posterior

    rng = np.random.default_rng(np.random.SeedSequence(7))
    directions = rng.normal(size=(TRAINING_POINTS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    labels = (np.arange(TRAINING_POINTS) % 2).astype(np.uint8)
    radii_m = np.where(labels == 1, 0.04, rng.uniform(0.055, 0.09, size=TRAINING_POINTS))
    test_points = rng.uniform(-0.06, 0.06, size=(TEST_POINTS, 3))
    seconds = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        gp_posterior(
            points=directions * radii_m[:, np.newaxis],
            labels=labels,
            test_points=test_points,
            lengthscales=np.full(2, 0.05),
            outputscales=np.full(2, 4.0),
            means=np.array([-3.0, -4.0]),
        )
        seconds.append(time.perf_counter() - start)
    return Ticks(tuple(seconds[1:]))


def measure(*, workers: int) -> list[float]:
    """Time the workload in so many processes at once; seconds of all repeats."""
    seconds: list[float] = []
    with tempfile.TemporaryDirectory() as logs:
        engine = LocalEngine(workers=workers)
        jobs = [_Job(f"calibration-{index}") for index in range(workers)]
        events = engine.run(Work(target=_TARGET, result_type=Ticks), jobs, logs=Path(logs))
        with closing(events):
            for event in events:
                if isinstance(event, SceneDone):
                    seconds += event.result.seconds
                elif isinstance(event, SceneFailed):
                    raise InputError(
                        f"the calibration workload failed ({event.failure}); pass --speed skip"
                    )
    return seconds


def conclude(before: list[float], after: list[float], *, machine: Machine) -> Calibration:
    """Sum up what `measure` returned before and after a run."""
    return Calibration(
        machine=machine,
        seconds=statistics.median([*before, *after]),
        drift=statistics.median(after) / statistics.median(before),
    )


def write_calibration(found: Calibration, folder: Path) -> None:
    """Keep a run's calibration in its folder."""
    write_text(folder / CALIBRATION, json.dumps(found.to_json(), indent=2) + "\n")


def read_calibration(folder: Path) -> Calibration | None:
    """Read a run's calibration; None where it has none.

    Raises
    ------
    InputError
        The file is damaged.
    """
    path = folder / CALIBRATION
    try:
        return Calibration.from_json(json.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} cannot be read ({error}); delete it, and times are not judged"
        ) from None


def several_sittings(sessions: Sequence[object]) -> str | None:
    """Say that a run's calibration is not of all its scenes; None where it is."""
    if len(sessions) == 1:
        return None
    return (
        f"was worked at in {len(sessions)} sittings, and its calibration is of the last alone; "
        "run it in one for its times to be judged"
    )
