"""Records and timings: what they refuse, and their files."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from harness.errors import InputError
from harness.runs.confusion import CONFUSION_SCHEMA, Confusion, read_confusion, write_confusion
from harness.runs.fragment import DamagedFragmentError, read_fragment, write_fragment
from harness.runs.job import SceneJob
from harness.runs.records import (
    COUNTS,
    METRICS,
    RECORD_SCHEMA,
    SCHEMA_VERSION,
    TIMING_SCHEMA,
    Record,
    SceneResult,
    Timing,
    Variant,
    read_records,
    read_timings,
    write_records,
    write_timings,
)
from harness.tests.fake_scenes import fake_confusion, fake_record

JOB = SceneJob("mug-0000", "mug", "mug_0", seed=2**63 - 1)
RECORD = fake_record(JOB, variant=Variant("classic"), tolerance_m=0.005)
NO_RECORDING = Path("none.npz")
TIMING = Timing(scene_id="mug-0000", stage="gp fit", model="classic", seconds=0.25)


def test_the_schema_is_that_of_the_fields() -> None:
    assert list(RECORD_SCHEMA) == [item.name for item in dataclasses.fields(Record)]
    assert {RECORD_SCHEMA[name] for name in METRICS} == {pl.Float64()}
    assert {RECORD_SCHEMA[name] for name in COUNTS} == {pl.Int64()}
    assert RECORD_SCHEMA["failure"] == pl.String()
    assert TIMING_SCHEMA["peak_memory_mib"] == pl.Float64()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"precision": float("nan")}, "precision is nan; an undefined value is None"),
        ({"brier": float("inf")}, "brier is inf"),
        ({"brier": 1}, "brier is 1 of type int; it must be float"),
        ({"tp": np.int64(3)}, "of type int64; it must be int"),
        ({"model": None}, "model is None of type NoneType; it must be str"),
        ({"status": "fine"}, "status 'fine' is neither 'ok' nor 'failed'"),
        ({"status": "failed"}, "a failure is stated exactly where status is 'failed'"),
        ({"failure": "no"}, "a failure is stated exactly where status is 'failed'"),
        ({"fp": None}, "do not add up"),
        ({"test_points": 999}, "do not add up to test_points = 999"),
    ],
)
def test_a_record_refuses_what_it_cannot_mean(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match="mug-0000") as caught:
        dataclasses.replace(RECORD, **change)
    assert message in str(caught.value)


def test_a_failed_record_has_neither_counts_nor_metrics() -> None:
    record = Record.failed(
        JOB, variant=Variant("classic"), views=3, tolerance_m=0.005, failure="lost"
    )
    assert (record.status, record.failure) == ("failed", "lost")
    assert all(getattr(record, name) is None for name in (*COUNTS, *METRICS))


def test_parquet_round_trip_in_the_order_of_keys(tmp_path: Path) -> None:
    jobs = [JOB, SceneJob("bowl-0001", "bowl", "bowl_1", seed=5)]
    records = [
        fake_record(job, variant=Variant(model), tolerance_m=tolerance_m)
        for job in jobs
        for model in ("metric", "classic")
        for tolerance_m in (0.01, 0.0025)
    ]
    path = tmp_path / "records.parquet"
    write_records(records, path)
    assert read_records(path) == sorted(records, key=Record.key)
    assert read_records(path)[0].scene_id == "bowl-0001"
    before = path.read_bytes()
    write_records(reversed(records), path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["records.parquet"]


def test_all_null_columns_keep_their_type(tmp_path: Path) -> None:
    path = tmp_path / "records.parquet"
    failed = Record.failed(
        JOB, variant=Variant("classic"), views=3, tolerance_m=0.005, failure="lost"
    )
    write_records([failed], path)
    assert pl.read_parquet(path).schema == RECORD_SCHEMA
    assert read_records(path) == [failed]


def test_timings_keep_the_order_of_the_stages(tmp_path: Path) -> None:
    stages = [dataclasses.replace(TIMING, stage=stage) for stage in ("render", "map", "gp fit")]
    path = tmp_path / "timings.parquet"
    write_timings(stages, path)
    assert read_timings(path) == stages


def test_confusion_round_trip_in_the_order_of_keys(tmp_path: Path) -> None:
    rows = fake_confusion(RECORD)
    path = tmp_path / "confusion.parquet"
    write_confusion(reversed(rows), path)
    assert read_confusion(path) == sorted(rows, key=Confusion.key)
    assert sum(row.points for row in rows) == RECORD.test_points
    assert pl.read_parquet(path).columns == list(CONFUSION_SCHEMA)
    before = path.read_bytes()
    write_confusion(rows, path)
    assert path.read_bytes() == before
    write_confusion([], path)
    assert pl.read_parquet(path).schema == CONFUSION_SCHEMA
    with pytest.raises(ValueError, match=r"mug-0000: points is 1\.0 of type float; it must be"):
        dataclasses.replace(rows[0], points=1.0)  # type: ignore[arg-type]


def test_files_of_records_that_cannot_be_read(tmp_path: Path) -> None:
    path = tmp_path / "records.parquet"
    with pytest.raises(InputError, match="is missing; finish the run"):
        read_records(path)
    write_records([RECORD], path)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(InputError, match=r"records.parquet is damaged \(.*\); delete it"):
        read_records(path)
    pl.DataFrame({"scene_id": ["a"]}).write_parquet(path)
    with pytest.raises(InputError, match="has other columns than this version's"):
        read_records(path)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"precision": float("nan")}, "mug-0000: precision is nan"),
        ({"brier": float("-inf")}, "mug-0000: brier is -inf"),
        ({"model": None}, "mug-0000: model is null"),
        ({"status": "fine"}, "mug-0000: its status is neither 'ok' nor 'failed'"),
        ({"status": "failed"}, "mug-0000: a failure is stated exactly where status is 'failed'"),
        ({"failure": "no"}, "mug-0000: a failure is stated exactly where status is 'failed'"),
        ({"fp": None}, "mug-0000: tp, tn, fp, fn do not add up to test_points"),
        ({"test_points": 999}, "mug-0000: tp, tn, fp, fn do not add up to test_points"),
    ],
)
def test_a_file_holds_no_record_that_would_be_refused(
    tmp_path: Path, change: dict[str, Any], problem: str
) -> None:
    path = tmp_path / "records.parquet"
    good = {**dataclasses.asdict(RECORD), "scene_id": "bowl-0000"}
    rows = [good, dataclasses.asdict(RECORD) | change]
    pl.DataFrame(rows, schema=RECORD_SCHEMA).write_parquet(path)
    with pytest.raises(InputError) as caught:
        read_records(path)
    assert str(caught.value) == (
        f"{path} holds what no run writes ({problem}); delete it and resume the run with "
        f"`harness bench --out {tmp_path}`"
    )


def test_a_failed_record_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "records.parquet"
    failed = Record.failed(
        JOB, variant=Variant("metric"), views=3, tolerance_m=0.005, failure="lost"
    )
    write_records([RECORD, failed], path)
    assert read_records(path) == [RECORD, failed]
    # Rows share the strings that they repeat.
    first, second = read_records(path)
    assert first.scene_id is second.scene_id


def test_fragment_round_trip_is_exact(tmp_path: Path) -> None:
    third = dataclasses.replace(RECORD, auroc=1 / 3, brier=5e-324)
    path = tmp_path / "mug-0000.json"
    result = SceneResult([third], [TIMING], fake_confusion(third))
    write_fragment(path, result)
    assert read_fragment(path, job=JOB, recording=NO_RECORDING) == result


def test_a_fragment_that_was_cut_or_altered_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "mug-0000.json"
    write_fragment(path, SceneResult([RECORD], [TIMING]))
    whole = path.read_bytes()
    for length in (0, 5, whole.index(b"\n"), len(whole) // 2, len(whole) - 2):
        path.write_bytes(whole[:length])
        with pytest.raises(DamagedFragmentError):
            read_fragment(path, job=JOB, recording=NO_RECORDING)
    path.write_bytes(whole.replace(b'"tp": ', b'"tp": 1'))
    with pytest.raises(DamagedFragmentError, match="checksum"):
        read_fragment(path, job=JOB, recording=NO_RECORDING)
    stated = b'"schema_version": %d'
    path.write_bytes(whole.replace(stated % SCHEMA_VERSION, stated % 1))
    with pytest.raises(DamagedFragmentError, match=f"schema 1, not {SCHEMA_VERSION}"):
        read_fragment(path, job=JOB, recording=NO_RECORDING)
    path.write_bytes(whole)
    with pytest.raises(DamagedFragmentError, match="another scene's result"):
        read_fragment(path, job=dataclasses.replace(JOB, seed=1), recording=NO_RECORDING)
