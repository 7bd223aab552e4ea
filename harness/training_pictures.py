"""Training pictures for the segmentation network, written as a folder of shards.

A shard is a pure function of the mesh set, the seed and its number, so a folder that was begun is
continued: its whole shards are kept, damaged ones are made again, and no byte depends on the
number of workers.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import shlex
import signal
import threading
import time
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.errors import InputError
from harness.picture_shards import (
    FORMAT,
    PICTURES_PER_SHARD,
    DamagedShardError,
    ShardKey,
    check_shard,
    shard_metadata,
    shard_path,
    write_shard,
)
from harness.runs.atomic import PARTIAL_SUFFIX, remove_quietly, write_text
from harness.runs.manifest import core_count, git_state
from sim_scenes import ObjectSet, SceneError, SimulatorMissing, load_object_set
from sim_scenes.objects import ObjectError
from sim_scenes.objects.manifest import find_manifest, sha256_of
from sim_scenes.pictures import GROUP, TrainingPicture, draw_group

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

MANIFEST = "manifest.json"
# PyBullet keeps a little of every mesh; a fresh process now and then gives it back.
SHARDS_PER_PROCESS = 40
MOST_WORKERS = 256


@dataclass(frozen=True)
class PictureOptions:
    """What a person chooses.

    Attributes
    ----------
    objects
        Folder of meshes with a manifest.
    out
        Folder to write; one that holds pictures of the same meshes and seed is continued.
    count
        Number of pictures.
    seed
        Which pictures.
    workers
        Processes; by default one per core.
    """

    objects: Path
    out: Path
    count: int
    seed: int = 0
    workers: int | None = None

    def command(self) -> list[str]:
        """Words of the command line that makes the same pictures."""
        return [
            *("harness", "training-pictures"),
            *("--objects", str(self.objects), "--out", str(self.out)),
            *("--count", str(self.count), "--seed", str(self.seed)),
        ]


@dataclass(frozen=True)
class Step:
    """How far the pictures have come."""

    done: int
    total: int


@dataclass
class PictureResult:
    """A finished folder.

    Attributes
    ----------
    made, kept
        Pictures that this call drew, and those that were there.
    repaired
        Why each damaged shard was made again, by file name.
    seconds
        Wall time of this call.
    """

    folder: Path
    made: int = 0
    kept: int = 0
    repaired: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0


@dataclass(frozen=True)
class _Job:
    objects: Path
    path: Path
    key: ShardKey


def make_pictures(
    options: PictureOptions, *, progress: Callable[[Step], None] | None = None
) -> PictureResult:
    """Draw the pictures that are not there yet.

    Parameters
    ----------
    options
        What to draw, and where to.
    progress
        Called after each shard.

    Raises
    ------
    InputError
        Wrong options, unusable meshes, a folder that holds something else or cannot be written.
    """
    start = time.monotonic()
    workers = core_count() if options.workers is None else options.workers
    for name, value, most in (("count", options.count, 10**7), ("workers", workers, MOST_WORKERS)):
        if not 1 <= value <= most:
            raise InputError(f"--{name} is {value}; it must lie in 1 to {most}")
    if options.seed < 0:
        raise InputError(f"--seed is {options.seed}; it must be 0 or more")
    jobs = _plan(options)
    result = PictureResult(options.out)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make {options.out}: {error.strerror}; pass another --out") from (
            error
        )
    _check_folder(options, jobs[0].key)
    for partial in options.out.glob(f"*{PARTIAL_SUFFIX}"):
        remove_quietly(partial)
    waiting = [job for job in jobs if not _is_there(job, result)]
    result.kept = options.count - sum(job.key.count for job in waiting)

    def done(job: _Job) -> None:
        result.made += job.key.count
        if progress is not None:
            progress(Step(result.kept + result.made, options.count))

    if progress is not None:
        progress(Step(result.kept, options.count))
    _run(waiting, workers=workers, done=done)
    _write_manifest(options, jobs[0].key)
    result.seconds = time.monotonic() - start
    return result


def draw_shard(objects: ObjectSet, key: ShardKey) -> list[TrainingPicture]:
    """Draw the pictures of a shard."""
    groups = range(key.first // GROUP, -(-(key.first + key.count) // GROUP))
    pictures = [picture for group in groups for picture in draw_group(objects, key.seed, group)]
    skipped = key.first - groups.start * GROUP
    return pictures[skipped : skipped + key.count]


def _plan(options: PictureOptions) -> list[_Job]:
    try:
        load_object_set(options.objects)
        digest = sha256_of(find_manifest(options.objects).read_bytes())
    except ObjectError as error:
        raise InputError(f"--objects: {error}") from error
    firsts = range(0, options.count, PICTURES_PER_SHARD)
    return [
        _Job(
            options.objects.resolve(),
            shard_path(options.out, number),
            ShardKey(
                digest,
                options.seed,
                first,
                min(PICTURES_PER_SHARD, options.count - first),
            ),
        )
        for number, first in enumerate(firsts)
    ]


def _check_folder(options: PictureOptions, key: ShardKey) -> None:
    """Refuse a folder of other pictures, or of more than are asked for."""
    remedy = "pass an empty folder as --out, or delete those pictures"
    shards = sorted(options.out.glob("shard-*.safetensors"))
    wanted = {name: key.metadata()[name] for name in ("format", "seed", "objects")}
    for path in shards:
        # What cannot be read is made again, not refused.
        found = shard_metadata(path)
        for name, value in wanted.items():
            if found and found.get(name) != value:
                raise InputError(f"{path} is of {name} {found.get(name)}, not {value}; {remedy}")
    last = shard_path(options.out, (options.count - 1) // PICTURES_PER_SHARD)
    if shards and shards[-1].name > last.name:
        raise InputError(
            f"{options.out} holds more than {options.count} pictures ({shards[-1].name}); "
            f"ask for as many with --count, {remedy}"
        )


def _is_there(job: _Job, result: PictureResult) -> bool:
    if not job.path.exists():
        return False
    try:
        check_shard(job.path, job.key)
    except DamagedShardError as error:
        result.repaired[job.path.name] = str(error)
        return False
    return True


def _write_manifest(options: PictureOptions, key: ShardKey) -> None:
    values: dict[str, Any] = {
        "format": FORMAT,
        "seed": options.seed,
        "count": options.count,
        "pictures_per_shard": PICTURES_PER_SHARD,
        "objects": {"folder": options.objects.resolve().name, "sha256": key.objects},
        "git": git_state(Path(__file__)),
        "command": shlex.join(options.command()),
    }
    write_text(options.out / MANIFEST, json.dumps(values, indent=2) + "\n")


def _run(jobs: list[_Job], *, workers: int, done: Callable[[_Job], None]) -> None:
    if min(workers, len(jobs)) <= 1:
        for job in jobs:
            _make(job)
            done(job)
        return
    wave = workers * SHARDS_PER_PROCESS
    for first in range(0, len(jobs), wave):
        _run_wave(jobs[first : first + wave], workers=workers, done=done)


def _run_wave(jobs: list[_Job], *, workers: int, done: Callable[[_Job], None]) -> None:
    """Run jobs in fresh processes (the pool's own way to renew them may hang in Python 3.11)."""
    with _pool(min(workers, len(jobs))) as pool:
        running = {pool.submit(_make, job): job for job in jobs}
        try:
            while running:
                finished, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    job = running.pop(future)
                    future.result()
                    done(job)
        except BrokenProcessPool as error:
            raise InputError(
                "a worker was killed, for memory perhaps; run the command again with fewer "
                "--workers: it continues"
            ) from error


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Lend processes that, after Ctrl-C too, finish the shards they are at and then go."""
    pool = ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
    )
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _start_worker() -> None:
    # A terminal's Ctrl-C reaches every process; the parent alone answers it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End this process when the parent is killed; it would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@lru_cache(maxsize=1)
def _objects_of(folder: Path, process: int) -> ObjectSet:
    del process
    return load_object_set(folder)


def _make(job: _Job) -> None:
    try:
        pictures = draw_shard(_objects_of(job.objects, os.getpid()), job.key)
    except (ObjectError, SceneError) as error:
        raise InputError(f"--objects: {error}") from error
    except SimulatorMissing as error:
        raise InputError(str(error)) from error
    write_shard(job.path, pictures, job.key)
