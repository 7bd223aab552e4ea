"""A run whose scenes are multiplied: as many as asked, and read like any other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness.bench import BenchOptions, run_bench
from harness.benchmarks.many_records import multiply_run
from harness.errors import InputError
from harness.results import show_run
from harness.runs.confusion import read_confusion
from harness.runs.records import read_records, read_timings
from harness.tests.fake_wiring import WIRING

if TYPE_CHECKING:
    from pathlib import Path


def test_a_multiplied_run_measures_the_same_many_times(tmp_path: Path) -> None:
    once = run_bench(BenchOptions(scenes=3, workers=1, out=tmp_path / "run"), wiring=WIRING)
    many = tmp_path / "many"
    records = read_records(once.folder / "records.parquet")
    assert multiply_run(once.folder, many, records=2 * len(records) + 1) == 3 * len(records)
    found = read_records(many / "records.parquet")
    assert len({(row.scene_id, row.seed) for row in found}) == 3 * 6
    assert len(read_confusion(many / "confusion.parquet")) == 3 * len(
        read_confusion(once.folder / "confusion.parquet")
    )
    assert len(read_timings(many / "timings.parquet")) == 3 * len(
        read_timings(once.folder / "timings.parquet")
    )
    for ours, theirs in zip(show_run(many).rows, once.table.rows, strict=True):
        assert (ours.scenes, ours.objects) == (9, theirs.objects)
        assert ours.values["accuracy"].mean == pytest.approx(theirs.values["accuracy"].mean)
    with pytest.raises(InputError, match="many exists; pass another folder"):
        multiply_run(once.folder, many)
