"""A run's folder: what it holds, how it is begun, continued and finished.

::

    RUN/
      manifest.json     what was run: configuration, objects, which shard of them if it is one,
                        sessions (code, packages, machine)
      config.toml       the configuration, defaults written out
      scenes/ID.json    one finished scene each; a failed scene has none, so that resuming tries
                        it again
      recordings/ID.npz what a finished scene looked like and every answer: `harness.recordings`
      logs/             what workers printed, and tracebacks
      records.parquet   one row per scene, model, completion and tolerance
      confusion.parquet one row per scene, model, completion, tolerance, true and predicted category
      timings.parquet   one row per scene and stage
      table.md, table.csv, table.tex

Records and tables depend on the configuration, the objects and the code alone; the clock and the
machine appear in the manifest, the timings and the logs.
"""

from __future__ import annotations

import fcntl
import json
import os
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from harness.config import Config
from harness.errors import InputError
from harness.recordings.file import read_recording
from harness.runs.atomic import (
    PARTIAL_SUFFIX,
    DiskError,
    link_or_copy,
    remove_quietly,
    write_atomically,
    write_text,
)
from harness.runs.fragment import DamagedFragmentError, read_fragment, write_fragment
from harness.runs.manifest import describe_session, differing_code
from harness.runs.shards import Shard

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from harness.recordings.recording import Recording
    from harness.runs.job import SceneJob
    from harness.runs.records import SceneResult

MANIFEST = "manifest.json"
CONFIG = "config.toml"
RECORDS = "records.parquet"
CONFUSION = "confusion.parquet"
TIMINGS = "timings.parquet"

_MANIFEST_TYPES = {"schema_version": int, "config": dict, "objects": list, "sessions": list}


def default_folder(
    config: Config, *, shard: Shard | None = None, now: datetime | None = None
) -> Path:
    """``results/<UTC time>-<short hash of the configuration>``, and which shard it is of."""
    moment = (now or datetime.now(UTC)).strftime("%Y%m%dT%H%M%SZ")
    part = "" if shard is None else f"-{shard.index}-of-{shard.count}"
    return Path("results") / f"{moment}-{config.short_hash()}{part}"


class RunDirectory:
    """A run's folder on disk.

    Parameters
    ----------
    folder
        A folder that `is_run` accepts; use `open_run` to begin or to continue one.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.records_path = folder / RECORDS
        self.confusion_path = folder / CONFUSION
        self.timings_path = folder / TIMINGS
        self.logs = folder / "logs"
        self.recordings = folder / "recordings"
        self._scenes = folder / "scenes"

    @staticmethod
    def is_run(folder: Path) -> bool:
        """Whether a run was begun in a folder."""
        return (folder / MANIFEST).is_file()

    def config(self) -> Config:
        """Read the configuration that the run was begun with."""
        try:
            return Config.model_validate(self.manifest()["config"])
        except ValidationError as error:
            key = ".".join(str(part) for part in error.errors()[0]["loc"])
            raise InputError(
                f"{self.folder / MANIFEST} holds a configuration that this version does not know "
                f"({key}); read it with the version that it names"
            ) from None

    def manifest(self) -> dict[str, Any]:
        """Read the run's manifest."""
        path, remedy = self.folder / MANIFEST, "choose another folder or delete this one"
        try:
            manifest: object = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path} cannot be read ({error}); {remedy}") from None
        found = manifest if isinstance(manifest, dict) else {}
        for key, kind in _MANIFEST_TYPES.items():
            if not isinstance(found.get(key), kind):
                raise InputError(
                    f"{path} is no run's manifest: no {kind.__name__} '{key}'; {remedy}"
                )
        if odd := next(_odd_parts(found), None):
            raise InputError(f"{path} is no run's manifest: {odd}; {remedy}")
        return found

    def shard(self) -> Shard | None:
        """Read which part of its configuration's scenes the run is; None where it is all."""
        stated = self.manifest().get("shard")
        return None if stated is None else Shard(stated["index"], stated["count"])

    def keep(self, job: SceneJob, result: SceneResult) -> None:
        """Write a finished scene, its recording before what vouches for it."""
        if result.recording is not None:
            data = result.recording
            self.recordings.mkdir(exist_ok=True)
            write_atomically(self._recording(job.scene_id), lambda file: file.write(data))
        write_fragment(self._fragment(job), result)

    def recorded(self) -> list[str]:
        """List the scenes that have a recording, sorted."""
        return sorted(path.stem for path in self.recordings.glob("*.npz"))

    def without_recordings(self) -> str:
        """Say why the run has no recordings, and what to do."""
        if "baseline" in self.manifest():
            return (
                "a baseline keeps none; pass a run, such as that of "
                f"`harness bench --config {self.folder / CONFIG}`"
            )
        if self.config().run.record == "nothing":
            return (
                'it recorded none; run it again, into another folder, with `[run] record = "all"`'
            )
        return f"resume it with `harness bench --out {self.folder}`"

    def recording(self, scene_id: str) -> Recording:
        """Read a scene's recording.

        Raises
        ------
        InputError
            The run has none of the scene, or it is damaged.
        """
        recording = read_recording(self._recording(scene_id))
        if recording.scene_id != scene_id:
            raise InputError(
                f"{self._recording(scene_id)} is of scene {recording.scene_id}; delete it and "
                "resume the run with `harness bench --out`"
            )
        return recording

    def finished(self, jobs: Sequence[SceneJob]) -> tuple[dict[str, SceneResult], dict[str, str]]:
        """Scenes that are finished, and what is wrong with those whose files are damaged.

        Both by scene id; a damaged file is removed by the next `keep` of its scene.
        """
        results: dict[str, SceneResult] = {}
        damaged: dict[str, str] = {}
        for job in jobs:
            path = self._fragment(job)
            if not path.exists():
                continue
            try:
                recording = self._recording(job.scene_id)
                results[job.scene_id] = read_fragment(path, job=job, recording=recording)
            except DamagedFragmentError as error:
                damaged[job.scene_id] = str(error)
        return results, damaged

    def adopt(self, parts: Sequence[RunDirectory], scenes: Sequence[Sequence[str]]) -> None:
        """Take over scenes of other runs, with their recordings and the sittings they came from.

        Parameters
        ----------
        parts
            The other runs.
        scenes
            Ids of the finished scenes to take over from each.
        """
        manifest = self.manifest()
        theirs = [sitting for part in parts for sitting in part.manifest()["sessions"]]
        manifest["sessions"] = [*theirs, manifest["sessions"][-1]]
        write_manifest(self.folder, manifest)
        for part, names in zip(parts, scenes, strict=True):
            for name in names:
                # As in `keep`: the recording before what vouches for it.
                if (recording := part._recording(name)).is_file():
                    self.recordings.mkdir(exist_ok=True)
                    link_or_copy(recording, self._recording(name))
                link_or_copy(part._scenes / f"{name}.json", self._scenes / f"{name}.json")

    def is_concluded(self) -> bool:
        """Whether the records, which are written last, are newer than every finished scene."""
        if not self.records_path.exists():
            return False
        scenes = (path.stat().st_mtime_ns for path in self._scenes.glob("*.json"))
        return self.records_path.stat().st_mtime_ns >= max(scenes, default=0)

    def write_tables(self, texts: Mapping[str, str]) -> None:
        """Write ``table.<suffix>`` for each suffix."""
        for suffix, text in texts.items():
            write_text(self.folder / f"table.{suffix}", text)

    @contextmanager
    def session(self) -> Iterator[list[str]]:
        """One sitting at the run: no other process may work at it meanwhile.

        Yields what differs from the sitting before, for a person to know.
        """
        try:
            lock = (self.folder / ".lock").open("w", encoding="ascii")
        except OSError as error:
            raise DiskError(f"cannot write to {self.folder}: {error.strerror}") from None
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InputError(
                    f"{self.folder} is in use by another process; wait for it or pass another --out"
                ) from None
            self._remove_partial_files()
            yield self._note_session()

    def _note_session(self) -> list[str]:
        manifest, session = self.manifest(), describe_session()
        before = manifest["sessions"][-1:]
        manifest["sessions"].append(session)
        write_manifest(self.folder, manifest)
        return [
            f"{what} changed since the run was last worked at: {change}"
            for last in before
            for what, change in differing_code(last, session).items()
        ]

    def _remove_partial_files(self) -> None:
        """Remove what a killed writer left."""
        for folder in (self.folder, self._scenes, self.recordings):
            for path in folder.glob(f"*{PARTIAL_SUFFIX}"):
                remove_quietly(path)

    def _fragment(self, job: SceneJob) -> Path:
        return self._scenes / f"{job.scene_id}.json"

    def _recording(self, scene_id: str) -> Path:
        return self.recordings / f"{scene_id}.npz"


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write what a run was begun with, and its sittings."""
    write_text(folder / MANIFEST, json.dumps(manifest, indent=2) + os.linesep)


def _odd_parts(manifest: Mapping[str, Any]) -> Iterator[str]:
    """Complaints about what a manifest's sessions and shard hold."""
    for session in manifest["sessions"]:
        if not isinstance(session, dict):
            yield f"a session is {session!r}"
            continue
        for name in ("git", "packages", "machine"):
            if not isinstance(session.get(name, {}), dict):
                yield f"a session's {name} is {session[name]!r}"
    shard = manifest.get("shard")
    if shard is None:
        return
    numbers = [shard.get(name) for name in ("index", "count")] if isinstance(shard, dict) else []
    if len(numbers) < 2 or not all(type(number) is int for number in numbers):
        yield f"shard is {shard!r}"
