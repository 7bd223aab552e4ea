"""A finished scene on disk: one JSON file, whose first line vouches for the second.

Line 1 holds the schema version and the sha256 of line 2; line 2 holds records, timings and
confusion.
Python writes a float so that it reads back as the same bits.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from typing import TYPE_CHECKING

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
    head = json.dumps({"schema_version": SCHEMA_VERSION, "sha256": _sha256(body)})
    write_text(path, f"{head}\n{body}\n")


def read_fragment(path: Path, *, job: SceneJob) -> SceneResult:
    """Read what `write_fragment` kept of a job.

    Raises
    ------
    DamagedFragmentError
        The file is cut short, altered, of another schema, or of another scene.
    """
    try:
        head_line, _, rest = path.read_text(encoding="utf-8").partition("\n")
        head = json.loads(head_line)
        body, _, _ = rest.partition("\n")
        if head["schema_version"] != SCHEMA_VERSION:
            raise DamagedFragmentError(f"schema {head['schema_version']}, not {SCHEMA_VERSION}")
        if head["sha256"] != _sha256(body):
            raise DamagedFragmentError("its content does not match its checksum")
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


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
