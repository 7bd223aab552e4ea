"""Shards joined to the run that one machine would have made, byte for byte.

Their finished scenes and recordings are taken over by hard links, or copies on another disk; what
failed in a shard is failed in the whole, which `harness bench --out` tries again. The times of
stages, and the sittings in the manifest, are those of the shards.
"""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

from harness.config import Config, differing_keys
from harness.errors import InputError
from harness.runs.directory import RunDirectory
from harness.runs.job import SceneJob, scene_ids
from harness.runs.manifest import differing_code
from harness.runs.opening import open_run
from harness.runs.records import SCHEMA_VERSION, Record, SceneResult, read_records
from harness.sitting import conclude_run

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.runs.shards import Shard
    from harness.table.summary import Table


@dataclass(frozen=True)
class MergeResult:
    """A run made of shards.

    Attributes
    ----------
    folder
        Where it was written.
    shards
        Number of them.
    scenes
        Number of scenes, failed ones included.
    failures
        Why each failed scene failed, by scene id.
    notes
        What a person should know: code or packages that differ between the shards.
    seconds
        Wall time.
    """

    folder: Path
    table: Table
    shards: int
    scenes: int
    failures: Mapping[str, str]
    notes: Sequence[str]
    seconds: float


@dataclass(frozen=True)
class _Part:
    """A shard that is whole.

    Attributes
    ----------
    finished
        By scene id.
    lost
        Records of the scenes that failed.
    """

    run: RunDirectory
    finished: dict[str, SceneResult]
    lost: list[Record]


def merge_shards(folders: Sequence[Path], *, out: Path) -> MergeResult:
    """Join all shards of one plan.

    Parameters
    ----------
    folders
        Of the finished shards, in any order.
    out
        Folder to write: absent, empty, or holding what an interrupted merge left.

    Raises
    ------
    InputError
        No shards, or shards of different plans; missing, double, unfinished or damaged ones; a
        folder that cannot be written.
    """
    start = time.monotonic()
    runs = _in_order(folders)
    config = runs[0].config()
    parts = [_read(run, config=config) for run in runs]
    run = open_run(out, config=config, objects=runs[0].manifest()["objects"])
    notes = _unlike_code(runs)
    with run.session():
        run.adopt(runs, [sorted(part.finished) for part in parts])
        found = {name: result for part in parts for name, result in part.finished.items()}
        lost = [record for part in parts for record in part.lost]
        table = conclude_run(run, found, lost, config=config)
    return MergeResult(
        folder=out,
        table=table,
        shards=len(parts),
        scenes=len(scene_ids(config)),
        failures={record.scene_id: record.failure or "" for record in lost},
        notes=notes,
        seconds=time.monotonic() - start,
    )


def _in_order(folders: Sequence[Path]) -> list[RunDirectory]:
    """Find the shards' runs in the order of the shards; they must be all of one plan's."""
    found: dict[Shard, RunDirectory] = {}
    first: RunDirectory | None = None
    for folder in folders:
        run, shard = _shard(folder)
        first = first or run
        _check_same_plan(first, run)
        if shard in found:
            raise InputError(
                f"{found[shard].folder} and {folder} are both shard {shard}; pass one of them"
            )
        found[shard] = run
    if first is None:
        raise InputError("no shard to merge; pass the folders of all of them")
    count = next(iter(found)).count
    have = {shard.index for shard in found}
    if missing := [f"{index}/{count}" for index in range(1, count + 1) if index not in have]:
        raise InputError(
            f"shard{'s' * (len(missing) > 1)} {', '.join(missing)} of {first.folder}'s plan "
            f"{'are' if len(missing) > 1 else 'is'} missing; pass their folders too, or compute "
            f"them with `harness bench --config {first.folder / 'config.toml'} --shard "
            f"{missing[0]}`"
        )
    return [found[shard] for shard in sorted(found)]


def _shard(folder: Path) -> tuple[RunDirectory, Shard]:
    if not RunDirectory.is_run(folder):
        raise InputError(f"{folder} holds no run; pass the folder of `harness bench --shard`")
    run = RunDirectory(folder)
    version = run.manifest().get("schema_version")
    if version != SCHEMA_VERSION:
        raise InputError(
            f"{folder} was written with record schema {version}, this version merges "
            f"{SCHEMA_VERSION}; compute the shard again, or merge with the version that wrote it"
        )
    if (shard := run.shard()) is None:
        raise InputError(
            f"{folder} holds a whole run, not a shard; pass folders of `harness bench --shard`"
        )
    return run, shard


def _check_same_plan(first: RunDirectory, other: RunDirectory) -> None:
    shards = [run.shard() for run in (first, other)]
    counts = [shard.count for shard in shards if shard is not None]
    between = f"{first.folder} and {other.folder} are shards of different plans"
    remedy = "pass shards of one plan"
    if keys := differing_keys(ours=other.config(), theirs=first.config()):
        raise InputError(f"{between}: {'; '.join(_sided(key) for key in keys)}; {remedy}")
    objects = [set(run.manifest()["objects"]) for run in (first, other)]
    if odd := sorted(objects[0] ^ objects[1]):
        raise InputError(f"{between}: of other objects (first difference: {odd[0]}); {remedy}")
    if counts[0] != counts[-1]:
        raise InputError(f"{between}: of {counts[0]} parts and of {counts[-1]}; {remedy}")


def _unlike_code(runs: Sequence[RunDirectory]) -> list[str]:
    """Say which shards other code computed than the first, which may change bits."""
    sittings = [run.manifest()["sessions"] for run in runs]
    return [
        f"{run.folder} was computed with other {what} than {runs[0].folder}: {change}"
        for run, sitting in zip(runs[1:], sittings[1:], strict=True)
        for what, change in differing_code(sittings[0][-1], sitting[-1]).items()
    ]


def _sided(key: str) -> str:
    """Name the sides of a difference for two folders."""
    return key.replace(" there, ", " in the first, ").replace(" asked)", " in the second)")


def _read(run: RunDirectory, *, config: Config) -> _Part:
    """Read a shard, every scene of it."""
    remedy = f"finish it with `harness bench --out {run.folder}`"
    shard = run.shard()
    if shard is None or not run.records_path.exists():
        raise InputError(f"{run.folder} is unfinished; {remedy}")
    by_scene: defaultdict[str, list[Record]] = defaultdict(list)
    for record in read_records(run.records_path):
        by_scene[record.scene_id].append(record)
    planned = shard.take(scene_ids(config))
    if odd := sorted(set(planned) ^ by_scene.keys()):
        raise InputError(
            f"{run.folder} does not hold the scenes of shard {shard} (first difference: {odd[0]}); "
            f"{remedy}"
        )
    finished, damaged = run.finished([_job(by_scene[name][0], config) for name in planned])
    for name, why in damaged.items():
        raise InputError(f"{run.folder}: {name} is damaged ({why}); {remedy}")
    lost: list[Record] = []
    for name in planned:
        if name in finished:
            continue
        if any(record.status == "ok" for record in by_scene[name]):
            raise InputError(f"{run.folder}: the file of {name} is missing; {remedy}")
        lost += by_scene[name]
    return _Part(run, finished, lost)


def _job(record: Record, config: Config) -> SceneJob:
    return SceneJob(
        scene_id=record.scene_id,
        category=record.category,
        object_name=record.object_name,
        seed=record.seed,
        cluttered=config.scenes.cluttered,
    )
