"""The committed baseline: what it holds, what it refuses, and what is said of a broken one."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from harness.bench import BenchOptions, run_bench
from harness.errors import InputError
from harness.gate import update
from harness.gate.baseline import read_baseline
from harness.gate.calibration import Calibration, Machine, write_calibration
from harness.results import show_run
from harness.runs.job import SceneJob
from harness.runs.records import SCHEMA_VERSION, Record, Variant, read_records
from harness.tests.fake_gate import SCENES, WIRING, copied, edit_manifest, make

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

CALIBRATION = Calibration(Machine("a processor", 2, 2), seconds=0.05)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gate") / "run"
    run_bench(BenchOptions(scenes=SCENES, workers=2, out=folder), wiring=WIRING)
    write_calibration(CALIBRATION, folder)
    return folder


@pytest.fixture
def baseline(tmp_path: Path, run: Path) -> Path:
    make(tmp_path / "baseline", run)
    return tmp_path / "baseline"


def refused(call: Callable[[], object]) -> str:
    with pytest.raises(InputError) as error:
        call()
    return str(error.value)


def test_a_baseline_is_the_run_in_small_with_its_reason(baseline: Path, run: Path) -> None:
    found = read_baseline(baseline)
    assert found.records == read_records(run / "records.parquet")
    assert found.calibration == CALIBRATION
    (entry,) = found.history
    assert (entry.reason, entry.scenes, entry.failed, entry.changes) == ("a reason", SCENES, 0, [])
    assert sorted(path.name for path in baseline.iterdir()) == [
        "config.toml",
        "history.json",
        "manifest.json",
        "records.parquet",
        "timings.parquet",
    ]
    # It reads as a run.
    assert len(show_run(baseline).rows) == 4


def test_no_text_of_a_baseline_names_a_place_of_this_machine(
    tmp_path: Path, run: Path, baseline: Path
) -> None:
    failure = f"cannot read '{tmp_path}/meshes/mug.obj': no such file"
    broken = copied(run, tmp_path / "broken", records=lambda row: lose(row, failure))
    make(tmp_path / "failed", broken, allow_failed=True)
    (reason,) = {row.failure for row in read_baseline(tmp_path / "failed").records} - {None}
    assert reason == "cannot read 'mug.obj': no such file"
    for folder in (baseline, tmp_path / "failed"):
        for path in folder.iterdir():
            assert str(tmp_path).encode() not in path.read_bytes()


def lose(row: Record, failure: str, *, scenes: tuple[str, ...] = ("mug-0003",)) -> Record:
    if row.scene_id not in scenes:
        return row
    job = SceneJob(row.scene_id, row.category, row.object_name, row.seed)
    variant = Variant(row.model, row.completion, row.segmenter)
    return Record.failed(
        job, variant=variant, views=3, tolerance_m=row.tolerance_m, failure=failure
    )


def test_the_history_tells_what_changed(tmp_path: Path, run: Path, baseline: Path) -> None:
    better = copied(
        run,
        tmp_path / "better",
        records=lambda row: replace(row, accuracy=0.75) if row.model == "metric" else row,
    )
    before = read_baseline(baseline)
    make(baseline, better, reason="  Masks are\n trimmed ")
    first, second = read_baseline(baseline).history
    assert first == before.history[0]
    assert second.reason == "Masks are trimmed"
    assert [(change.cell, change.metric) for change in second.changes] == [
        ("bowl box metric", "accuracy"),
        ("mug box metric", "accuracy"),
    ]
    assert {change.after for change in second.changes} == {0.75}
    assert not list(tmp_path.glob("baseline.*"))


def test_the_configuration_holds_what_was_asked_of_the_pipeline_and_no_default(
    tmp_path: Path, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def with_defaults(text: str) -> str:
        table = {"gp": {"fit_points": 1800, "models": ["metric"]}, "completer": "cloud"}
        return json.dumps(table | json.loads(text))

    folder = tmp_path / "run"
    copied(run, folder)
    asked = {"gp": {"fit_points": 900, "models": ["metric"]}, "completer": "cloud"}
    edit_manifest(folder, lambda manifest: manifest["config"].update(pipeline=asked))
    options = update.UpdateOptions(folder, tmp_path / "new", "a reason", allow_dirty=True)
    update.update_baseline(options, check_pipeline=with_defaults)
    text = (tmp_path / "new" / "config.toml").read_text(encoding="utf-8")
    assert "[pipeline.gp]\nfit_points = 900\n" in text
    assert "models" not in text
    assert "completer" not in text
    assert read_baseline(tmp_path / "new").config.pipeline == asked


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda m: m["sessions"][0]["git"].update(dirty=True),
            "was computed by a checkout with changes that no revision has, or by none, so that "
            "nobody could make its numbers again; commit, run the benchmark again, or pass "
            "--allow-dirty",
        ),
        (
            lambda m: m["sessions"].append(
                m["sessions"][0] | {"git": {"revision": "b", "dirty": False}}
            ),
            "was computed by several revisions, so that nobody could make its numbers again; "
            "commit, run the benchmark again, or pass --allow-dirty",
        ),
        (
            lambda m: m.update(shard={"index": 1, "count": 4}),
            "is part 1/4 of a run; join the parts with `harness merge` first",
        ),
        (
            lambda m: m["config"]["scenes"].update(objects="/data/meshes"),
            "was run with scenes.objects = '/data/meshes', a place on this machine alone; a "
            "baseline is of objects and weights that come with the project",
        ),
        (
            lambda m: m["config"].update(pipeline={"metric": {"weights": "~/w.safetensors"}}),
            "was run with pipeline.metric.weights = '~/w.safetensors', a place on this machine "
            "alone; a baseline is of objects and weights that come with the project",
        ),
    ],
)
def test_a_run_that_cannot_stand_as_a_baseline_is_refused(
    tmp_path: Path, run: Path, change: Callable[[dict[str, Any]], object], message: str
) -> None:
    folder = copied(run, tmp_path / "run")

    def clean(manifest: dict[str, Any]) -> None:
        manifest["sessions"][0]["git"] = {"revision": "a", "dirty": False}
        change(manifest)

    edit_manifest(folder, clean)
    told = refused(lambda: make(tmp_path / "new", folder, allow_dirty=False))
    assert told == f"{folder} {message}"
    assert not (tmp_path / "new").exists()


def test_a_run_with_failed_scenes_is_refused(tmp_path: Path, run: Path) -> None:
    folder = copied(run, tmp_path / "run", records=lambda row: lose(row, "no luck"))
    assert refused(lambda: make(tmp_path / "new", folder)) == (
        f"{folder} has 1 failed scenes (first: mug-0003: no luck); what the baseline lacks the "
        "gate cannot miss: mend them, or pass --allow-failed"
    )
    assert make(tmp_path / "new", folder, allow_failed=True).entry.failed == 1


def test_classes_that_cannot_be_judged_are_refused(tmp_path: Path, run: Path) -> None:
    mugs = tuple(f"mug-{index:04d}" for index in range(SCENES))
    none = copied(run, tmp_path / "none", records=lambda row: lose(row, "x", scenes=mugs))
    assert refused(lambda: make(tmp_path / "new", none, allow_failed=True)) == (
        f"{none} has no scored scene of class 'mug'; the gate cannot judge it: run scenes of it, "
        "or leave it out of run.classes"
    )
    few = copied(run, tmp_path / "few", records=lambda row: lose(row, "x", scenes=mugs[4:8]))
    assert refused(lambda: make(tmp_path / "new", few, allow_failed=True)) == (
        f"{few} has scored scenes of 4 objects of class 'mug', and a verdict needs 5; run more "
        "scenes, of more objects"
    )


def test_no_reason_is_refused(tmp_path: Path, run: Path) -> None:
    assert refused(lambda: make(tmp_path / "new", run, reason=" \n ")) == (
        "--reason is empty; say why the baseline changes, for those who come after"
    )


def test_a_baseline_too_large_to_commit_is_refused(
    tmp_path: Path, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(update, "MOST_BYTES", 2**10)
    told = refused(lambda: make(tmp_path / "new", run))
    assert "and 0.000976562 MiB is the most to commit; run fewer scenes or tolerances" in told
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_baseline_is_not_overwritten(tmp_path: Path, run: Path) -> None:
    other = copied(run, tmp_path / "other")
    assert refused(lambda: make(other, run)) == (
        f"{other} exists and is no baseline (no history.json); pass another --baseline, or delete "
        "it first"
    )
    assert (other / "scenes").is_dir()


def test_without_a_calibration_a_baseline_has_no_speed(tmp_path: Path, run: Path) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / "calibration.json").unlink()
    done = make(tmp_path / "new", folder)
    assert done.notes == [
        f"no speed will be judged: {folder} has no calibration; one by `harness baseline run` has"
    ]
    assert read_baseline(tmp_path / "new").calibration is None


def test_a_baseline_of_an_unsteady_machine_has_no_speed(tmp_path: Path, run: Path) -> None:
    folder = copied(run, tmp_path / "run")
    write_calibration(replace(CALIBRATION, drift=2.5), folder)
    assert make(tmp_path / "new", folder).notes == [
        f"no speed will be judged: {folder} was run on a machine that was not steady (its "
        "calibration took 2.50 times as long after as before); run it again when nothing else runs"
    ]
    assert read_baseline(tmp_path / "new").calibration is None


def mend(folder: Path) -> str:
    return (
        f"restore it with `git checkout -- {folder}`, or make it anew with "
        f"`harness baseline update --from RUN --baseline {folder}`"
    )


def test_a_missing_baseline(tmp_path: Path) -> None:
    folder = tmp_path / "baseline"
    assert refused(lambda: read_baseline(folder)) == (
        f"{folder} holds no baseline (no manifest.json); make one with `harness baseline update "
        f"--from RUN --baseline {folder}`"
    )


@pytest.mark.parametrize("name", ["config.toml", "records.parquet", "timings.parquet"])
def test_an_incomplete_baseline(baseline: Path, name: str) -> None:
    (baseline / name).unlink()
    assert refused(lambda: read_baseline(baseline)) == (
        f"{baseline / name} is missing: the baseline is incomplete; {mend(baseline)}"
    )


def test_a_damaged_baseline(baseline: Path) -> None:
    path = baseline / "records.parquet"
    content = bytearray(path.read_bytes())
    content[100] ^= 1
    path.write_bytes(content)
    assert refused(lambda: read_baseline(baseline)) == (
        f"{path} is damaged: it does not match its checksum; {mend(baseline)}"
    )
    (baseline / "manifest.json").write_text("{", encoding="utf-8")
    assert refused(lambda: read_baseline(baseline)) == (
        f"{baseline / 'manifest.json'} is damaged; {mend(baseline)}"
    )


def test_a_damaged_history(baseline: Path) -> None:
    (baseline / "history.json").write_text("{}", encoding="utf-8")
    assert refused(lambda: read_baseline(baseline)) == (
        f"{baseline} is damaged (history.json is no list); {mend(baseline)}"
    )


def test_a_baseline_of_another_schema(baseline: Path) -> None:
    edit_manifest(baseline, lambda manifest: manifest.update(schema_version=3))
    assert refused(lambda: read_baseline(baseline)) == (
        f"{baseline} was written with record schema 3, this version reads {SCHEMA_VERSION}; run "
        "the benchmark again and make that the baseline with `harness baseline update --from RUN "
        f"--baseline {baseline}`"
    )


def test_a_run_is_no_baseline(run: Path) -> None:
    assert refused(lambda: read_baseline(run)) == (
        f"{run} holds a run and no baseline; make it one with `harness baseline update --from "
        f"{run}`"
    )


def test_an_update_that_was_killed_between_the_two_loses_no_history(
    baseline: Path, run: Path
) -> None:
    baseline.rename(baseline.with_name("baseline.old"))
    baseline.with_name("baseline.new").mkdir()
    make(baseline, run, reason="the next")
    assert [entry.reason for entry in read_baseline(baseline).history] == ["a reason", "the next"]
    assert [path.name for path in baseline.parent.iterdir()] == ["baseline"]


def test_a_damaged_baseline_is_mended_by_the_next_and_keeps_its_history(
    baseline: Path, run: Path
) -> None:
    (baseline / "records.parquet").unlink()
    done = make(baseline, run, reason="the old one was damaged")
    assert done.notes[0].startswith(f"what changed is not told: {baseline / 'records.parquet'} is")
    assert [entry.reason for entry in read_baseline(baseline).history] == [
        "a reason",
        "the old one was damaged",
    ]
