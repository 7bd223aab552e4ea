"""What a run must be to stand as a baseline: whole, of one revision, of no machine's own places."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from harness.config import load_config
from harness.errors import InputError
from harness.gate.margins import LEAST_OBJECTS
from harness.runs.directory import MANIFEST

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.config import Config, PipelineCheck
    from harness.runs.records import Record

_ABSOLUTE = re.compile(r"(?:^|(?<=[\s'\"=(:]))(?:~|[A-Za-z]:)?[/\\](?:[^\s'\"/\\:]+[/\\])*")


def provenance(
    folder: Path, sessions: Sequence[Mapping[str, Any]], *, allowed: bool
) -> tuple[str, bool]:
    """Revision of a run's code, and whether that is not all of it."""
    states = [(str(item["git"]["revision"]), item["git"]["dirty"] is False) for item in sessions]
    if not states:
        raise InputError(f"{folder / MANIFEST} names no sitting; run the benchmark again")
    revision = states[-1][0]
    problem = None
    if any(not clean for _, clean in states):
        problem = "was computed by a checkout with changes that no revision has, or by none"
    elif len({name for name, _ in states}) > 1:
        problem = "was computed by several revisions"
    if problem and not allowed:
        raise InputError(
            f"{folder} {problem}, so that nobody could make its numbers again; commit, run the "
            "benchmark again, or pass --allow-dirty"
        )
    return revision, problem is not None


def failures(folder: Path, records: Sequence[Record], *, allowed: bool) -> int:
    """Count scenes that failed, in whole or in part."""
    failed = {record.scene_id: record.failure for record in records if record.status == "failed"}
    if failed and not allowed:
        first = min(failed)
        raise InputError(
            f"{folder} has {len(failed)} failed scenes (first: {first}: {failed[first]}); what the "
            "baseline lacks the gate cannot miss: mend them, or pass --allow-failed"
        )
    return len(failed)


def check_objects(folder: Path, records: Sequence[Record], *, classes: Sequence[str]) -> None:
    """Refuse records by which a class cannot be judged.

    Raises
    ------
    InputError
        A class is empty, or its scored scenes have too few objects.
    """
    for category in classes:
        of_class = [item for item in records if item.category == category]
        names = {item.object_name for item in of_class if item.status == "ok"}
        if not names:
            raise InputError(
                f"{folder} has no scored scene of class '{category}'; the gate cannot judge it: "
                "run scenes of it, or leave it out of run.classes"
            )
        if len(names) < LEAST_OBJECTS:
            raise InputError(
                f"{folder} has scored scenes of {len(names)} objects of class '{category}', and a "
                f"verdict needs {LEAST_OBJECTS}; run more scenes, of more objects"
            )


def reported(records: Sequence[Record], config: Config) -> list[Record]:
    """Take the records of the reported tolerance."""
    tolerance_m = config.protocol.reported_tolerance_m
    return [record for record in records if record.tolerance_m == tolerance_m]


def asked_table(
    folder: Path, config: Config, *, check_pipeline: PipelineCheck | None
) -> dict[str, Any]:
    """Return the configuration as a table, of the pipeline only what differs from its defaults."""
    table: dict[str, Any] = tomllib.loads(config.to_toml())
    defaults = load_config(None, check_pipeline=check_pipeline).pipeline
    table["pipeline"] = _beyond(table.get("pipeline", {}), defaults)
    for key, value in _strings(table):
        if _ABSOLUTE.search(value):
            raise InputError(
                f"{folder} was run with {key} = {value!r}, a place on this machine alone; a "
                "baseline is of objects and weights that come with the project"
            )
    return table


def _beyond(table: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a table that differ from its defaults."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        usual = defaults.get(key)
        if isinstance(value, dict) and isinstance(usual, dict):
            if inner := _beyond(value, usual):
                found[key] = inner
        elif value != usual:
            found[key] = value
    return found


def _strings(value: object, key: str = "") -> list[tuple[str, str]]:
    """Texts in a table, with their dotted keys."""
    if isinstance(value, str):
        return [(key, value)]
    items: list[tuple[object, object]] = []
    if isinstance(value, dict):
        items = list(value.items())
    elif isinstance(value, list):
        items = list(enumerate(value))
    return [found for name, item in items for found in _strings(item, f"{key}.{name}".strip("."))]


def without_places(record: Record) -> Record:
    """Cut folders out of a failure's text: no other machine has them."""
    if record.failure is None:
        return record
    return replace(record, failure=_ABSOLUTE.sub("", record.failure))
