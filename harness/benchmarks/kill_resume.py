"""Kill runs with kill -9 at random moments, resume them, and compare with an undisturbed run.

    python -m harness.benchmarks.kill_resume [--kills 20] [--seed 0]

1. A small real benchmark runs undisturbed: its files are the truth, its length gives the moments.
2. For every kill the same benchmark begins in a new folder, as a process of its own, and is killed:
   the parent at a moment drawn evenly over the run; a worker first and then the parent; or the
   parent in the middle of writing a file. Evenly drawn moments hardly ever fall into a write, so
   its steps (a file is opened, synced, renamed, its folder synced) are counted in the undisturbed
   run and one is drawn, every other time among those of the tables.
3. The run is resumed at once, and its records, confusion, tables, recordings and configuration must
   be the same bytes. Exits with 1 where any is not.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from harness.bench import BenchOptions, run_bench
from harness.engines.worker import load_target
from harness.runs.atomic import PARTIAL_SUFFIX

if TYPE_CHECKING:
    from collections.abc import Sequence

REAL = "harness.bench:Wiring"
CONFIG = """\
[run]
scenes = 3

[scenes]
views = 2
width = 320
height = 240

[protocol]
test_points = 200

[pipeline]
segmenter = "oracle"

[pipeline.training]
points = 300

[pipeline.gp]
models = ["classic"]
fit_points = 200
"""
_SITTING = "import sys; from harness.benchmarks.kill_resume import sit; sit(*sys.argv[1:])"
TABLE_FILES = 6
"""Files that are written when all scenes are done: records, confusion, timings, three tables."""
STEPS = 4
"""Steps of writing a file: opened, synced, renamed, its folder synced."""
CLOCKED = ("manifest.json", "timings.parquet", ".lock")
"""Files that hold times."""


@dataclass(frozen=True)
class Subject:
    """What is run.

    Attributes
    ----------
    config
        Its configuration.
    wiring
        ``package.module:name`` of what makes the benchmark's `Wiring`.
    """

    config: Path
    wiring: str = REAL

    def start(
        self, out: Path, *, doom: int = 0, count: Path | None = None
    ) -> subprocess.Popen[bytes]:
        """Begin a run as a process of its own; see `sit`."""
        call = [str(out), str(self.config), self.wiring, str(doom), "" if count is None else count]
        return subprocess.Popen([sys.executable, "-c", _SITTING, *call], stdin=subprocess.DEVNULL)

    def resume(self, out: Path) -> None:
        """Run to the end, here."""
        run_bench(BenchOptions(config=self.config, out=out), wiring=load_target(self.wiring)())


@dataclass(frozen=True)
class Kill:
    """When and whom to kill.

    Attributes
    ----------
    kind
        ``parent``, ``worker`` or ``write``.
    seconds
        After the start; of a worker's death, which the parent's follows after as long again.
    step
        Step of writing.
    """

    kind: str
    seconds: float = 0.0
    step: int = 0

    def __str__(self) -> str:
        if self.kind == "write":
            return f"at step {self.step} of writing"
        also = f", a worker at {self.seconds / 2:.2f} s" if self.kind == "worker" else ""
        return f"at {self.seconds:.2f} s{also}"


@dataclass(frozen=True)
class Trial:
    """What came of a kill.

    Attributes
    ----------
    kept
        Scenes that were on the disk.
    differing
        Files that are not those of the undisturbed run.
    """

    kill: Kill
    kept: int
    differing: Sequence[str]


class NotKilledError(Exception):
    """The run had ended before its moment came."""


def stable_files(folder: Path) -> dict[str, bytes]:
    """Read all files of a run that no clock changes, by their path in it."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and path.name not in CLOCKED
        and path.parent.name not in {"scenes", "logs"}
    }


def try_kill(subject: Subject, kill: Kill, *, folder: Path, truth: dict[str, bytes]) -> Trial:
    """Begin a run in a folder, kill it, resume it and compare.

    Raises
    ------
    NotKilledError
        The run had ended before.
    """
    process = subject.start(folder, doom=kill.step if kill.kind == "write" else 0)
    if kill.kind == "worker":
        time.sleep(kill.seconds / 2)
        for pid in workers_of(process.pid)[:1]:
            os.kill(pid, signal.SIGKILL)
        time.sleep(kill.seconds / 2)
    elif kill.kind == "parent":
        time.sleep(kill.seconds)
    if kill.kind != "write":
        process.kill()
    if process.wait() != -signal.SIGKILL:
        raise NotKilledError(f"the run ended with code {process.returncode} before it was killed")
    kept = len(list((folder / "scenes").glob("*.json")))
    subject.resume(folder)
    found = stable_files(folder)
    differing = [
        name for name in sorted(found.keys() | truth.keys()) if found.get(name) != truth.get(name)
    ]
    return Trial(kill, kept, differing)


def workers_of(parent: int) -> list[int]:
    """Find the worker processes of a run."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            status = (entry / "stat").read_text(encoding="ascii", errors="replace")
            command = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if int(status.rpartition(")")[2].split()[1]) == parent and b"engines.worker" in command:
            found.append(int(entry.name))
    return found


def sit(out: str, config: str, wiring: str, doom: str, count: str) -> None:  # noqa: PLR0917
    """Run once in this process, whose writing is watched; its arguments are a command line's.

    Parameters
    ----------
    out, config, wiring
        As of `Subject`.
    doom
        Number of the step of writing at which to die; 0 for none.
    count
        File that takes the number of steps; empty for none.
    """
    steps, sync = 0, os.fsync

    def step() -> None:
        nonlocal steps
        steps += 1
        if steps == int(doom):
            os.kill(os.getpid(), signal.SIGKILL)

    def listen(event: str, arguments: tuple[Any, ...]) -> None:
        if event in {"open", "os.rename"} and str(arguments[0]).endswith(PARTIAL_SUFFIX):
            step()

    def stepping_sync(descriptor: int) -> None:
        step()
        sync(descriptor)

    sys.addaudithook(listen)
    os.fsync = cast("Any", stepping_sync)
    Subject(Path(config), wiring).resume(Path(out))
    if count:
        Path(count).write_text(str(steps), encoding="ascii")


def draw_kill(random: np.random.Generator, *, seconds: float, steps: int) -> Kill:
    """Draw whom to kill, and when in a run of so many seconds and steps of writing."""
    kind = random.choice(["parent", "worker", "write"])
    if kind != "write":
        return Kill(str(kind), seconds=float(random.uniform(0.0, seconds)))
    first = steps - TABLE_FILES * STEPS if random.integers(2) else 0
    return Kill("write", step=int(random.integers(first, steps)) + 1)


def run_trials(subject: Subject, *, kills: int, seed: int, folder: Path) -> list[Trial]:
    """Kill and resume as often as asked; folders of runs that came out the same are removed."""
    start = time.monotonic()
    count = folder / "steps"
    if subject.start(folder / "truth", count=count).wait() != 0:
        raise SystemExit("the undisturbed run failed")
    seconds, steps = time.monotonic() - start, int(count.read_text(encoding="ascii"))
    truth = stable_files(folder / "truth")
    print(f"undisturbed: {seconds:.1f} s, {steps} steps of writing, {len(truth)} files")
    random = np.random.default_rng(np.random.SeedSequence(seed))
    trials: list[Trial] = []
    while len(trials) < kills:
        kill = draw_kill(random, seconds=seconds, steps=steps)
        run = folder / f"run-{len(trials) + 1}"
        try:
            trial = try_kill(subject, kill, folder=run, truth=truth)
        except NotKilledError as late:
            print(f"{kill.kind} {kill}: {late}; drawn again")
            shutil.rmtree(run)
            continue
        trials.append(trial)
        outcome = f"DIFFERENT: {', '.join(trial.differing)}" if trial.differing else "same bytes"
        print(f"{len(trials)} {kill.kind} {kill}: {trial.kept} scenes kept, {outcome}", flush=True)
        if not trial.differing:
            shutil.rmtree(run)
    return trials


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="kill-resume-"))
    config = folder / "config.toml"
    config.write_text(CONFIG, encoding="utf-8")
    trials = run_trials(Subject(config), kills=options.kills, seed=options.seed, folder=folder)
    same = sum(not trial.differing for trial in trials)
    print(f"{same} of {len(trials)} killed runs resumed to the same bytes")
    if same < len(trials):
        print(f"the others are in {folder}")
        return 1
    shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
