"""The committed baseline: what it holds, how it is read, and what is wrong with it.

::

    results/baseline/
      manifest.json     as a run's: configuration, objects, sessions; and of the baseline: checksums
                        and the calibration that its times are held by
      config.toml       what the gate runs: scenes and protocol in full, of the pipeline what was
                        asked for, so that a revision's new defaults are measured
      records.parquet   timings.parquet
      history.json      when, from which revision and why it was made, and what changed each time

It reads as a finished run, so that `harness show` and `harness compare` take it.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from harness.errors import InputError
from harness.gate.calibration import Calibration
from harness.runs.directory import CONFIG, MANIFEST, RECORDS, TIMINGS, RunDirectory
from harness.runs.records import SCHEMA_VERSION, Record, Timing, read_records, read_timings

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from harness.config import Config

HISTORY = "history.json"
BASELINE = "baseline"
"""Key of the manifest under which a baseline states what a run does not."""


@dataclass(frozen=True)
class Change:
    """A metric's mean before and after a baseline was replaced."""

    cell: str
    metric: str
    before: float
    after: float


@dataclass(frozen=True)
class Entry:
    """A line of the history.

    Attributes
    ----------
    date
        UTC, ISO 8601.
    revision
        The git revision that computed the records.
    dirty
        Whether its checkout held changes that no revision has.
    scenes
        Of each class.
    failed
        Number of scenes that failed, in whole or in part.
    changes
        Of the main metrics, against the baseline before.
    """

    date: str
    revision: str
    dirty: bool
    reason: str
    scenes: int
    failed: int
    changes: Sequence[Change]

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> Self:
        """Read an entry's JSON object."""
        return cls(**{**value, "changes": [Change(**change) for change in value["changes"]]})


@dataclass(frozen=True)
class Baseline:
    """A baseline that was read.

    Attributes
    ----------
    config
        The configuration that made it, whole.
    objects
        What identifies the meshes.
    calibration
        None where its times cannot be held against others.
    """

    folder: Path
    config: Config
    objects: Sequence[str]
    records: Sequence[Record]
    timings: Sequence[Timing]
    calibration: Calibration | None
    history: Sequence[Entry]

    @property
    def config_path(self) -> Path:
        """What the gate runs."""
        return self.folder / CONFIG


def read_baseline(folder: Path) -> Baseline:
    """Read a baseline.

    Raises
    ------
    InputError
        There is none, or it is incomplete, damaged, or of another record schema.
    """
    if not RunDirectory.is_run(folder):
        raise InputError(
            f"{folder} holds no baseline (no {MANIFEST}); make one with `harness baseline update "
            f"--from RUN --baseline {folder}`"
        )
    mend = (
        f"restore it with `git checkout -- {folder}`, or make it anew with "
        f"`harness baseline update --from RUN --baseline {folder}`"
    )
    run = RunDirectory(folder)
    try:
        manifest = run.manifest()
    except InputError:
        raise InputError(f"{folder / MANIFEST} is damaged; {mend}") from None
    if (written := manifest["schema_version"]) != SCHEMA_VERSION:
        raise InputError(
            f"{folder} was written with record schema {written}, this version reads "
            f"{SCHEMA_VERSION}; run the benchmark again and make that the baseline with `harness "
            f"baseline update --from RUN --baseline {folder}`"
        )
    stated = manifest.get(BASELINE)
    if not isinstance(stated, dict):
        raise InputError(
            f"{folder} holds a run and no baseline; make it one with "
            f"`harness baseline update --from {folder}`"
        )
    for name in (CONFIG, RECORDS, TIMINGS, HISTORY):
        path = folder / name
        if not path.is_file():
            raise InputError(f"{path} is missing: the baseline is incomplete; {mend}")
        known = stated.get("files", {}).get(name)
        if name in (RECORDS, TIMINGS) and known != digest(path):
            raise InputError(f"{path} is damaged: it does not match its checksum; {mend}")
    try:
        history = read_history(folder)
        found = stated.get("calibration")
        calibration = None if found is None else Calibration.from_json(found)
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(f"{folder} is damaged ({error}); {mend}") from None
    return Baseline(
        folder=folder,
        config=run.config(),
        objects=manifest["objects"],
        records=read_records(run.records_path),
        timings=read_timings(run.timings_path),
        calibration=calibration,
        history=history,
    )


def digest(path: Path) -> str:
    """Checksum of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_history(folder: Path) -> list[Entry]:
    """Read a baseline's history.

    Raises
    ------
    OSError, ValueError, TypeError, KeyError
        The file cannot be read, or holds something else.
    """
    value: object = json.loads((folder / HISTORY).read_text(encoding="utf-8"))
    if not isinstance(value, list):
        raise TypeError(f"{HISTORY} is no list")
    return [Entry.from_json(item) for item in value]
