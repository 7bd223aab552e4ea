"""Runs and baselines without a simulator, for tests of the gate."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

from harness.gate.update import Updated, UpdateOptions, update_baseline
from harness.runs.records import (
    Record,
    Timing,
    read_records,
    read_timings,
    write_records,
    write_timings,
)
from harness.tests import fake_wiring
from harness.tests.fake_scenes import FakeModel

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

MODELS = [FakeModel(f"{name}_{i}", name) for name in ("mug", "bowl") for i in range(8)]
WIRING = replace(fake_wiring.WIRING, load_objects=lambda _: MODELS)
SCENES = 10
"""Scenes of each class: 8 objects, of which two are seen twice."""


def make(folder: Path, run: Path, **options: object) -> Updated:
    """Make a run the baseline, whatever the state of the checkout that tests run in."""
    chosen = UpdateOptions(run=run, baseline=folder, reason="a reason", allow_dirty=True)
    return update_baseline(replace(chosen, **options), check_pipeline=lambda text: text)  # type: ignore[arg-type]


def copied(
    run: Path,
    to: Path,
    *,
    records: Callable[[Record], Record | None] = lambda row: row,
    timings: Callable[[Timing], Timing] = lambda row: row,
) -> Path:
    """Copy a run and change its rows; None loses a record."""
    shutil.copytree(run, to)
    changed = map(records, read_records(to / "records.parquet"))
    write_records([row for row in changed if row is not None], to / "records.parquet")
    rows = map(timings, read_timings(to / "timings.parquet"))
    write_timings(list(rows), to / "timings.parquet")
    return to


def edit_manifest(folder: Path, change: Callable[[dict], object]) -> Path:  # type: ignore[type-arg]
    """Change a manifest in place."""
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    change(manifest)
    path.write_text(json.dumps(manifest), encoding="utf-8")
    return folder
