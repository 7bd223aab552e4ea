"""How a run is begun, or found again and continued."""

from __future__ import annotations

import shutil
from dataclasses import asdict
from typing import TYPE_CHECKING

from harness.config import Config, differing_keys, load_config
from harness.errors import InputError
from harness.runs.atomic import PARTIAL_SUFFIX, DiskError, remove_quietly, write_text
from harness.runs.directory import CONFIG, MANIFEST, RunDirectory, write_manifest
from harness.runs.records import SCHEMA_VERSION

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from harness.runs.shards import Shard

_BEGUN = ("scenes", "logs")
"""Folders that a run begins with."""


def open_run(
    folder: Path, *, config: Config, objects: Sequence[str], shard: Shard | None = None
) -> RunDirectory:
    """Begin a run, or find the one of the same configuration and objects that a folder holds.

    Parameters
    ----------
    folder
        Absent, empty, or holding a run, or what is left of one that was killed at its beginning.
    config
        The run's configuration.
    objects
        What identifies each object of the set, in any order.
    shard
        Which part of the configuration's scenes; None for all of them.

    Raises
    ------
    InputError
        The folder holds something else, or cannot be written.
    """
    existed = begun = False
    try:
        if RunDirectory.is_run(folder):
            run = RunDirectory(folder)
            _check_same(run, config=config, objects=sorted(objects), shard=shard)
            return run
        existed = folder.exists()
        if existed and not (folder.is_dir() and _is_hardly_begun(folder)):
            raise InputError(
                f"{folder} exists and holds no run; pass another --out or empty it first"
            )
        begun = True
        _begin(folder, config=config, objects=sorted(objects), shard=shard)
    except OSError as error:
        if begun:
            _remove_begun(folder, existed=existed)
        raise DiskError(
            f"cannot create a run in {folder}: {error.strerror}; pass a writable --out"
        ) from None
    except DiskError:
        _remove_begun(folder, existed=existed)
        raise
    return RunDirectory(folder)


def _is_hardly_begun(folder: Path) -> bool:
    """Whether a folder is empty, or holds what a run leaves that is killed before its manifest.

    A configuration counts beside the empty folders alone: without them it is a person's own.
    """
    names = {path.name for path in folder.iterdir()}
    made = names & set(_BEGUN)
    if any(not (folder / name).is_dir() or any((folder / name).iterdir()) for name in made):
        return False
    files = {CONFIG, CONFIG + PARTIAL_SUFFIX, MANIFEST + PARTIAL_SUFFIX}
    return names == made or (len(made) == len(_BEGUN) and names - made <= files)


def _begin(folder: Path, *, config: Config, objects: list[str], shard: Shard | None) -> None:
    """Write an empty run; the manifest comes last, for it marks the folder as a run."""
    for name in _BEGUN:
        (folder / name).mkdir(parents=True, exist_ok=True)
    write_text(folder / CONFIG, config.to_toml())
    write_manifest(
        folder,
        {
            "schema_version": SCHEMA_VERSION,
            "seed": config.run.seed,
            "config": config.model_dump(mode="json"),
            "objects": objects,
            "shard": None if shard is None else asdict(shard),
            "sessions": [],
        },
    )


def _check_same(
    run: RunDirectory, *, config: Config, objects: list[str], shard: Shard | None
) -> None:
    manifest = run.manifest()
    if manifest.get("schema_version") != SCHEMA_VERSION:
        raise InputError(
            f"{run.folder} was written with record schema {manifest.get('schema_version')}, this "
            f"version writes {SCHEMA_VERSION}; pass another --out"
        )
    begun_with = run.config()
    # Not checked by the pipeline: what an earlier one wrote without a key is not an edit.
    written = load_config(run.folder / CONFIG, check_pipeline=lambda text: text)
    if keys := differing_keys(ours=written, theirs=begun_with):
        raise InputError(
            f"{run.folder / CONFIG} is not what the run was begun with: {'; '.join(keys)}; "
            "undo the edit, or pass it as --config with another --out"
        )
    if keys := differing_keys(ours=config, theirs=begun_with):
        raise InputError(
            f"{run.folder} holds a run of another configuration: {'; '.join(keys)}; "
            "pass another --out, or --out alone to continue it as it was"
        )
    if config.run.record != begun_with.run.record:
        raise InputError(
            f"{run.folder} was begun with run.record = '{begun_with.run.record}', not "
            f"'{config.run.record}'; pass another --out, or --out alone to continue it as it was"
        )
    if odd := sorted(set(manifest["objects"]) ^ set(objects)):
        raise InputError(
            f"{run.folder} was begun with other objects (first difference: {odd[0]}); "
            "pass another --out"
        )
    if (held := run.shard()) != shard:
        raise InputError(
            f"{run.folder} holds {_part(held)}, not {_part(shard)}; pass another --out, or --out "
            "alone to continue it as it was"
        )


def _part(shard: Shard | None) -> str:
    return "a whole run" if shard is None else f"shard {shard}"


def _remove_begun(folder: Path, *, existed: bool) -> None:
    """Take away what a failed beginning wrote, and the folder if it was not there before."""
    if not existed:
        shutil.rmtree(folder, ignore_errors=True)
        return
    for name in _BEGUN:
        shutil.rmtree(folder / name, ignore_errors=True)
    remove_quietly(folder / CONFIG)
