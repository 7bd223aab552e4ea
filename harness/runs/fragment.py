"""A finished scene on disk: one JSON file, whose first line vouches for the second.

Line 1 holds the schema version, the sha256 of line 2 and that of the scene's recording, if it has
one; line 2 holds records, timings and confusion.
Python writes a float so that it reads back as the same bits.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from harness.runs.atomic import write_text
from harness.runs.confusion import Confusion
from harness.runs.records import SCHEMA_VERSION, Record, SceneResult, Timing

if TYPE_CHECKING:
    from pathlib import Path

    from harness.runs.job import SceneJob


class DamagedFragmentError(Exception):
    """A file that does not hold the whole result of its scene."""


def write_fragment(path: Path, result: SceneResult) -> None:
    """Keep a scene's result."""
    body = json.dumps(
        {
            "records": [asdict(record) for record in result.records],
            "timings": [asdict(timing) for timing in result.timings],
            "confusion": [asdict(row) for row in result.confusion],
        },
        allow_nan=False,
    )
    head: dict[str, Any] = {"schema_version": SCHEMA_VERSION, "sha256": _sha256(body.encode())}
    if result.recording is not None:
        head["recording_sha256"] = _sha256(result.recording)
    write_text(path, f"{json.dumps(head)}\n{body}\n")


def read_fragment(path: Path, *, job: SceneJob, recording: Path) -> SceneResult:
    """Read what `write_fragment` kept of a job.

    Parameters
    ----------
    path
        The fragment.
    job
        The scene that it must be of.
    recording
        File of the scene's recording; one that was kept is checked, not read in.

    Raises
    ------
    DamagedFragmentError
        The file is cut short, altered, of another schema, or of another scene; the recording is
        missing or another.
    """
    try:
        head_line, _, rest = path.read_text(encoding="utf-8").partition("\n")
        head = json.loads(head_line)
        body, _, _ = rest.partition("\n")
        if head["schema_version"] != SCHEMA_VERSION:
            raise DamagedFragmentError(f"schema {head['schema_version']}, not {SCHEMA_VERSION}")
        if head["sha256"] != _sha256(body.encode()):
            raise DamagedFragmentError("its content does not match its checksum")
        kept = head.get("recording_sha256")
        if kept is not None and not _is_whole(recording, kept):
            raise DamagedFragmentError("its recording is missing or another")
        content = json.loads(body)
        result = SceneResult(
            records=[Record(**row) for row in content["records"]],
            timings=[Timing(**row) for row in content["timings"]],
            confusion=[Confusion(**row) for row in content["confusion"]],
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DamagedFragmentError(f"{type(error).__name__}: {error}") from None
    if any((row.scene_id, row.seed) != (job.scene_id, job.seed) for row in result.records):
        raise DamagedFragmentError("it holds another scene's result")
    return result


def _is_whole(recording: Path, sha256: str) -> bool:
    if not recording.is_file():
        return False
    with recording.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() == sha256


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
