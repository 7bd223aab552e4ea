"""A finished run made the baseline, with the reason why."""

from __future__ import annotations

import json
import shutil
from collections import defaultdict
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from statistics import fmean
from typing import TYPE_CHECKING, Any

import tomli_w

from harness.errors import InputError
from harness.gate.acceptance import (
    asked_table,
    check_objects,
    failures,
    provenance,
    reported,
    without_places,
)
from harness.gate.baseline import (
    BASELINE,
    HISTORY,
    Baseline,
    Change,
    Entry,
    digest,
    read_baseline,
    read_history,
)
from harness.gate.calibration import Calibration, read_calibration, several_sittings
from harness.protocol import test_set_of
from harness.results import finished_run
from harness.runs.atomic import DiskError, write_text
from harness.runs.directory import CONFIG, MANIFEST, RECORDS, TIMINGS, RunDirectory
from harness.runs.records import (
    SCHEMA_VERSION,
    Record,
    read_records,
    read_timings,
    write_records,
    write_timings,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.config import Config, PipelineCheck

MAIN_METRICS = ("precision", "accuracy", "aurc")
"""What the history tells of a change."""

TOLD = 0.0005
"""Least change that it tells."""

MOST_BYTES = 2 * 2**20
"""A baseline is committed, and every version of it stays in the repository."""

_SESSION = ("started", "git", "code", "python", "packages", "machine")


@dataclass(frozen=True)
class UpdateOptions:
    """What a person chooses.

    Attributes
    ----------
    run
        Folder of the finished run.
    baseline
        Folder of the baseline.
    reason
        Why it is replaced.
    allow_dirty
        Take a run whose code is no revision.
    allow_failed
        Take a run with failed scenes.
    """

    run: Path
    baseline: Path
    reason: str
    allow_dirty: bool = False
    allow_failed: bool = False


@dataclass(frozen=True)
class Updated:
    """A baseline that was written.

    Attributes
    ----------
    notes
        What a person should know.
    """

    folder: Path
    entry: Entry
    size_bytes: int
    notes: Sequence[str]


def update_baseline(
    options: UpdateOptions, *, check_pipeline: PipelineCheck | None = None
) -> Updated:
    """Make a finished run the baseline.

    Raises
    ------
    InputError
        No reason; an unfinished run, one that is a part, of a dirty checkout or with failed scenes;
        classes with too few objects; a run whose configuration names folders of this machine.
    """
    reason = " ".join(options.reason.split())
    if not reason:
        raise InputError(
            "--reason is empty; say why the baseline changes, for those who come after"
        )
    run = finished_run(options.run)
    if (shard := run.shard()) is not None:
        raise InputError(
            f"{run.folder} is part {shard} of a run; join the parts with `harness merge` first"
        )
    config, records = run.config(), read_records(run.records_path)
    sessions = run.manifest()["sessions"]
    revision, dirty = provenance(run.folder, sessions, allowed=options.allow_dirty)
    failed = failures(run.folder, records, allowed=options.allow_failed)
    check_objects(run.folder, reported(records, config), classes=config.run.classes)
    asked = asked_table(run.folder, config, check_pipeline=check_pipeline)
    calibration, notes = _calibration(run.folder, sessions)
    before, history, unread = _before(options.baseline)
    entry = Entry(
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        revision=revision,
        dirty=dirty,
        reason=reason,
        scenes=config.run.scenes,
        failed=failed,
        changes=_changes(before, records, config=config),
    )
    manifest = {
        "schema_version": SCHEMA_VERSION,
        "seed": config.run.seed,
        "config": config.model_dump(mode="json"),
        "objects": run.manifest()["objects"],
        "sessions": [_session(item) for item in sessions],
    }
    files = {
        CONFIG: _HEAD + tomli_w.dumps(asked),
        HISTORY: json.dumps([asdict(item) for item in (*history, entry)], indent=1) + "\n",
    }
    size = _write(
        options.baseline,
        run,
        manifest=manifest,
        records=records,
        texts=files,
        calibrated=calibration,
    )
    return Updated(options.baseline, entry, size, [*unread, *notes])


_HEAD = """# What `harness gate` runs: the baseline's scenes and protocol in full, and of the
# pipeline what was asked for beside its defaults. Written by `harness baseline update`.
"""


def _before(folder: Path) -> tuple[Baseline | None, Sequence[Entry], list[str]]:
    """Read the baseline that is to be replaced, its history, and what a person should know.

    One that is damaged or of another schema is replaced too, for that is how it is mended. One
    that an update was killed at is put back first.
    """
    if not folder.exists() and (old := _beside(folder, "old")).exists():
        old.rename(folder)
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return None, [], []
    if not (folder / HISTORY).is_file():
        raise InputError(
            f"{folder} exists and is no baseline (no {HISTORY}); pass another --baseline, or "
            "delete it first"
        )
    try:
        before = read_baseline(folder)
    except InputError as error:
        try:
            history = read_history(folder)
        except (OSError, ValueError, TypeError, KeyError):
            return None, [], [f"the history is lost, for {folder / HISTORY} cannot be read"]
        return None, history, [f"what changed is not told: {error}"]
    return before, before.history, []


def _session(found: Mapping[str, Any]) -> dict[str, Any]:
    """Take of a sitting what matters elsewhere: the system's kind, not its build."""
    kept = {key: found.get(key) for key in _SESSION}
    machine = dict(found.get("machine", {}))
    machine["system"] = str(machine.get("system", "unknown")).partition("-")[0]
    return kept | {"machine": machine}


def _calibration(folder: Path, sessions: Sequence[object]) -> tuple[Calibration | None, list[str]]:
    """Find the calibration around a run; without one, say why no speed is judged."""
    found = read_calibration(folder)
    if found is None:
        why = "has no calibration; one by `harness baseline run` has"
    elif (problem := several_sittings(sessions)) is not None:
        why = problem
    elif not found.steady:
        why = (
            f"was run on a machine that was not steady (its calibration took {found.drift:.2f} "
            "times as long after as before); run it again when nothing else runs"
        )
    else:
        return found, []
    return None, [f"no speed will be judged: {folder} {why}"]


def _changes(before: Baseline | None, records: Sequence[Record], *, config: Config) -> list[Change]:
    """List changes of the main metrics' means, by cell."""
    if before is None:
        return []
    theirs = _means(reported(before.records, before.config))
    ours = _means(reported(records, config))
    return [
        Change(*key, before=round(theirs[key], 6), after=round(ours[key], 6))
        for key in sorted(theirs.keys() & ours.keys())
        if abs(ours[key] - theirs[key]) >= TOLD
    ]


def _means(records: Sequence[Record]) -> dict[tuple[str, str], float]:
    """Mean of each main metric, by cell and metric."""
    values: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for record in records:
        cell = f"{record.category} {test_set_of(record.completion)} {record.model}"
        for metric in MAIN_METRICS:
            if (value := getattr(record, metric)) is not None:
                values[cell, metric].append(value)
    return {key: fmean(found) for key, found in values.items()}


def _beside(folder: Path, suffix: str) -> Path:
    return folder.with_name(f"{folder.name}.{suffix}")


def _write(
    folder: Path,
    run: RunDirectory,
    *,
    manifest: dict[str, Any],
    records: Sequence[Record],
    texts: Mapping[str, str],
    calibrated: Calibration | None,
) -> int:
    """Write a baseline beside the old one and put it in its place; returns its bytes."""
    made, old = _beside(folder, "new"), _beside(folder, "old")
    try:
        for left in (made, old):
            shutil.rmtree(left, ignore_errors=True)
        made.mkdir(parents=True)
        write_records(map(without_places, records), made / RECORDS)
        write_timings(read_timings(run.timings_path), made / TIMINGS)
        for name, text in texts.items():
            write_text(made / name, text)
        manifest[BASELINE] = {
            "files": {name: digest(made / name) for name in (RECORDS, TIMINGS)},
            "calibration": None if calibrated is None else calibrated.to_json(),
        }
        write_text(made / MANIFEST, json.dumps(manifest, indent=1) + "\n")
        size = sum(path.stat().st_size for path in made.iterdir())
        if size > MOST_BYTES:
            shutil.rmtree(made)
            raise InputError(
                f"{run.folder} would make a baseline of {size / 2**20:.1f} MiB, and "
                f"{MOST_BYTES / 2**20:g} MiB is the most to commit; run fewer scenes or tolerances"
            )
        if folder.exists():
            folder.rename(old)
        made.rename(folder)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise DiskError(
            f"cannot write the baseline {folder}: {error.strerror}; free the disk or pass another "
            "--baseline"
        ) from None
    return size
