"""The gate from end to end on fake scenes: what passes, what fails, what is refused."""

from __future__ import annotations

import json
import os
import pty
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
import typer
from rich.console import Console

from harness import cli_gate
from harness.bench import BenchOptions, run_bench
from harness.errors import InputError
from harness.gate import run as gate_run, timed
from harness.gate.baseline import read_baseline
from harness.gate.calibration import Calibration, Machine, read_calibration, write_calibration
from harness.gate.run import GateOptions, GateResult, run_gate
from harness.gate.text import headline, render_verdict
from harness.runs.job import SceneJob
from harness.runs.records import Record, Variant
from harness.tests.fake_gate import SCENES, WIRING, copied, edit_manifest, make

if TYPE_CHECKING:
    from pathlib import Path

CALIBRATION = Calibration(Machine("a processor", 2, 2), seconds=0.05)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gate") / "run"
    run_bench(BenchOptions(scenes=SCENES, workers=2, out=folder), wiring=WIRING)
    write_calibration(CALIBRATION, folder)
    return folder


@pytest.fixture(scope="module")
def baseline(tmp_path_factory: pytest.TempPathFactory, run: Path) -> Path:
    folder = tmp_path_factory.mktemp("baseline") / "baseline"
    make(folder, run)
    return folder


def judge(baseline: Path, run: Path, **options: Any) -> GateResult:
    return run_gate(GateOptions(against=baseline, run=run, **options), wiring=WIRING)


def refused(baseline: Path, run: Path, **options: Any) -> str:
    with pytest.raises(InputError) as error:
        judge(baseline, run, **options)
    return str(error.value)


def shown(result: GateResult, **options: Any) -> str:
    console = Console(width=160)
    with console.capture() as capture:
        console.print(render_verdict(result, **options))
    return capture.get() + headline(result)


def worse(row: Record, *, by: float, model: str = "metric", scenes: int = 99) -> Record:
    """Lose precision in one model's first scenes."""
    chosen = row.model == model and int(row.scene_id[-4:]) < scenes
    return replace(row, precision=row.precision - by) if chosen and row.precision else row


def test_the_same_answers_pass(baseline: Path, run: Path) -> None:
    result = judge(baseline, run)
    assert result.passed
    assert (result.quality.scenes, result.quality.lost, result.notes) == (2 * SCENES, [], [])
    verdicts = {row.metric: row.verdict for row in result.quality.rows}
    # The fakes have no recall; without positive predictions none would be right.
    assert verdicts["precision"] == verdicts["accuracy"] == "same"
    assert verdicts["recall"] == "unjudged"
    text = shown(result)
    assert text.splitlines()[-1].startswith(f"PASS: 20 scenes of {run} against {baseline} (")
    assert "No scene that both runs scored differs in any metric (--all: the rows)." in text
    rows = shown(result, everything=True)
    assert "bowl box classic" in rows
    assert " same" in rows


def test_two_points_of_one_models_precision_fail(baseline: Path, run: Path, tmp_path: Path) -> None:
    bad = copied(run, tmp_path / "bad", records=lambda row: worse(row, by=0.02))
    result = judge(baseline, bad)
    assert not result.passed
    found = {(row.cell.category, row.cell.model, row.metric) for row in result.quality.worse}
    assert found == {(name, "metric", "precision") for name in ("mug", "bowl", "all")}
    row = result.quality.worse[0]
    assert row.difference == pytest.approx(-0.02)
    assert [item.loss for item in row.worst] == pytest.approx([0.02] * 3)
    text = shown(result)
    assert "Worse than the baseline" in text
    assert "mug box metric, precision: loses most in mug-0000 (0.020), mug-0001 (0.020)" in text
    assert text.splitlines()[-1].startswith("FAIL: ")
    assert text.endswith(": 3 of 42 rows worse")
    # Half a margin is let pass.
    fair = copied(run, tmp_path / "fair", records=lambda row: worse(row, by=0.001))
    assert judge(baseline, fair).passed


def test_a_loss_in_some_objects_of_each_class_is_found_in_all_together(
    baseline: Path, run: Path, tmp_path: Path
) -> None:
    def uneven(row: Record) -> Record:
        return worse(row, by=0.04) if int(row.object_name[-1]) % 2 else row

    result = judge(baseline, copied(run, tmp_path / "uneven", records=uneven))
    (row,) = result.quality.worse
    assert (row.cell.category, row.cell.test_set, row.objects) == ("all", "box", 16)
    lost = {item.scene_id: item.loss for item in row.worst}
    assert list(lost.values()) == pytest.approx([0.04] * 3)


def test_quick_judges_the_first_scenes_alone(baseline: Path, run: Path, tmp_path: Path) -> None:
    def late(row: Record) -> Record:
        return row if int(row.scene_id[-4:]) < 8 else worse(row, by=0.3)

    changed = copied(run, tmp_path / "late", records=late)
    assert judge(baseline, changed, quick=True).quality.scenes == 16
    assert judge(baseline, changed, quick=True).passed
    row = judge(baseline, changed).quality.rows[0]
    assert row.scenes == SCENES


def test_a_gate_does_not_pass_because_the_hard_scenes_failed(
    baseline: Path, run: Path, tmp_path: Path
) -> None:
    def fail(row: Record) -> Record | None:
        job = SceneJob(row.scene_id, row.category, row.object_name, row.seed)
        variant = Variant(row.model, row.completion, row.segmenter)
        if row.scene_id == "mug-0002":
            return Record.failed(
                job, variant=variant, views=3, tolerance_m=row.tolerance_m, failure="no luck"
            )
        return None if row.scene_id == "bowl-0001" else row

    result = judge(baseline, copied(run, tmp_path / "lost", records=fail))
    assert not result.passed
    assert not result.quality.worse
    assert [(item.scene_id, item.what, item.why) for item in result.quality.lost] == [
        ("bowl-0001", "vanished", "the run has no such record"),
        ("mug-0002", "failed", "no luck"),
    ]
    text = shown(result)
    assert "  mug-0002 failed: box: no luck" in text
    assert text.endswith(": 2 of 20 scenes lost")


def test_a_slower_stage_fails_by_itself(baseline: Path, run: Path, tmp_path: Path) -> None:
    slow = copied(
        run,
        tmp_path / "slow",
        timings=lambda row: (
            replace(row, seconds=row.seconds * 1.4) if row.stage == "render" else row
        ),
    )
    result = judge(baseline, slow)
    assert result.quality.passed
    assert not result.passed
    assert "  render: 0.500 s -> 0.700 s, 1.40 times (at least 1.40)" in shown(result)
    assert judge(baseline, slow, speed="skip").passed


def test_a_baseline_of_another_machine_judges_quality_alone(run: Path, tmp_path: Path) -> None:
    def elsewhere(manifest: dict[str, Any]) -> None:
        manifest["sessions"][0]["machine"] |= {"cpu": "another", "cores": 64}

    folder = edit_manifest(copied(run, tmp_path / "run"), elsewhere)
    write_calibration(Calibration(Machine("another", 64, 20), seconds=0.01), folder)
    make(tmp_path / "theirs", folder)
    result = judge(tmp_path / "theirs", run)
    assert result.passed
    assert result.speed.refused is not None
    assert (
        "processor another there, a processor here; cores 64 there, 2 here" in result.speed.refused
    )
    (note,) = result.notes
    assert note.startswith("the baseline was made on another machine (another, ")
    assert note.endswith("quality is judged all the same")
    assert refused(tmp_path / "theirs", run, speed="require").startswith(
        "--speed require: the baseline was timed on another machine or with other workers"
    )


def test_a_run_without_a_calibration_is_not_judged_by_its_times(
    baseline: Path, run: Path, tmp_path: Path
) -> None:
    bare = copied(run, tmp_path / "bare")
    (bare / "calibration.json").unlink()
    result = judge(baseline, bare)
    assert result.passed
    assert result.speed.refused == (
        f"{bare} has no calibration; `harness gate` takes one where it runs the benchmark itself"
    )


def test_what_is_set_differently_in_the_pipeline_is_judged_and_told(
    baseline: Path, run: Path, tmp_path: Path
) -> None:
    other = edit_manifest(
        copied(run, tmp_path / "other"),
        lambda manifest: manifest["config"].update(pipeline={"gp": {"fit_points": 900}}),
    )
    result = judge(baseline, other)
    assert result.settings == [("pipeline.gp.fit_points", "unset", 900)]
    assert "  pipeline.gp.fit_points: unset in the baseline, 900 now" in shown(result)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda m: m["config"]["run"].update(scenes=4),
            "{run} has 4 scenes of each class, {baseline} 10; judge a run of as many, or pass "
            "--quick where both have 8",
        ),
        (
            lambda m: m["config"]["run"].update(seed=5),
            "{run} and {baseline} do not ask the same: run.seed is 5 in the run and 0 in the "
            "baseline; run it with --config {baseline}/config.toml",
        ),
        (
            lambda m: m["objects"].append("mug/new sha256:0"),
            "{run} and {baseline} are of different objects (first difference: mug/new sha256:0); "
            "run the benchmark again and make that the baseline with "
            "`harness baseline update --from RUN`",
        ),
        (
            lambda m: m.update(shard={"index": 2, "count": 3}),
            "{run} is part 2/3 of a run; join the parts with `harness merge` first",
        ),
    ],
)
def test_a_run_of_other_scenes_is_refused(
    baseline: Path,
    run: Path,
    tmp_path: Path,
    change: Callable[[dict[str, Any]], object],
    message: str,
) -> None:
    other = edit_manifest(copied(run, tmp_path / "other"), change)
    assert refused(baseline, other) == message.format(run=other, baseline=baseline)


def test_scenes_that_were_drawn_otherwise_are_refused(
    baseline: Path, run: Path, tmp_path: Path
) -> None:
    other = copied(run, tmp_path / "other", records=lambda row: replace(row, redraws=1))
    assert refused(baseline, other).startswith(
        f"bowl-0000 is not the same scene in {baseline} and {other}: its redraws is 0 in the "
        "baseline and 1 now; "
    )


def test_an_unfinished_run_is_refused(baseline: Path, run: Path, tmp_path: Path) -> None:
    other = copied(run, tmp_path / "other")
    (other / "records.parquet").unlink()
    assert refused(baseline, other) == (
        f"{other} is unfinished; finish it with `harness bench --out {other}`"
    )


def test_an_empty_class_is_refused(run: Path, tmp_path: Path) -> None:
    two = edit_manifest(
        copied(run, tmp_path / "two", records=lambda r: None if r.category == "bowl" else r),
        lambda manifest: manifest["config"]["run"].update(classes=["mug"]),
    )
    make(tmp_path / "new", two)
    edit_manifest(
        tmp_path / "new", lambda manifest: manifest["config"]["run"].update(classes=["mug", "bowl"])
    )
    assert refused(tmp_path / "new", run) == (
        f"{tmp_path / 'new'} has no scored scene of class 'bowl'; the gate cannot judge it: run "
        "scenes of it, or leave it out of run.classes"
    )


def test_options_of_a_new_run_and_a_finished_one_exclude_each_other(
    baseline: Path, run: Path
) -> None:
    assert refused(baseline, run, workers=2) == (
        "--run judges a finished run; --out and --workers are for a new one"
    )


@pytest.fixture
def ticks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Calibrations that are taken, each of 0.05 s: how many workers each had."""
    taken: list[int] = []

    def measure(*, workers: int) -> list[float]:
        taken.append(workers)
        return [0.05]

    here = CALIBRATION.machine
    for module in (timed, gate_run):
        monkeypatch.setattr(module, "this_machine", lambda **_: here)
    monkeypatch.setattr(timed, "measure", measure)
    return taken


def test_the_gate_runs_the_benchmark_as_the_baseline_was(
    baseline: Path, tmp_path: Path, ticks: list[int]
) -> None:
    out = tmp_path / "new"
    options = GateOptions(against=baseline, quick=True, out=out, speed="require")
    result = run_gate(options, wiring=WIRING)
    assert result.passed
    assert (result.run, result.quality.scenes, ticks) == (out, 16, [2, 2])
    assert read_calibration(out) == CALIBRATION
    assert result.speed.refused is None
    assert {row.verdict for row in result.quality.rows if row.metric == "precision"} == {"same"}


def test_times_that_could_not_be_compared_are_refused_before_the_benchmark(
    run: Path, tmp_path: Path, ticks: list[int]
) -> None:
    bare = copied(run, tmp_path / "bare")
    (bare / "calibration.json").unlink()
    make(tmp_path / "untimed", bare)
    with pytest.raises(InputError, match=r"--speed require: .*untimed has no calibration; make it"):
        run_gate(GateOptions(against=tmp_path / "untimed", speed="require"), wiring=WIRING)
    write_calibration(replace(CALIBRATION, machine=Machine("another", 2, 2)), bare)
    make(tmp_path / "theirs", bare)
    with pytest.raises(InputError, match="--speed require: the baseline was timed on another"):
        run_gate(GateOptions(against=tmp_path / "theirs", speed="require"), wiring=WIRING)
    assert ticks == []


Harness = Callable[..., tuple[int, str]]


@pytest.fixture
def harness(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Harness:
    monkeypatch.setattr(cli_gate, "wiring", WIRING)
    app = typer.Typer()
    app.registered_commands += cli_gate.commands.registered_commands
    app.registered_groups += cli_gate.commands.registered_groups

    def harness(*arguments: object) -> tuple[int, str]:
        code = app([str(argument) for argument in arguments], standalone_mode=False)
        return int(code), capsys.readouterr().out

    return harness


def test_the_command_says_so_and_exits_so(
    harness: Harness, baseline: Path, run: Path, tmp_path: Path
) -> None:
    code, out = harness("gate", "--against", baseline, "--run", run)
    assert code == 0
    assert f"PASS: 20 scenes of {run} against {baseline} (" in out
    bad = copied(run, tmp_path / "bad", records=lambda row: worse(row, by=0.02))
    code, out = harness("gate", "--against", baseline, "--run", bad, "--all")
    assert code == 1
    assert "AUROC" in out
    code, out = harness("gate", "--against", baseline, "--run", bad, "--json")
    told = json.loads(out)
    assert (code, told["passed"], len(told["quality"]["rows"])) == (1, False, 42)
    assert told["quality"]["rows"][0].keys() >= {"cell", "difference", "verdict", "worst"}


def test_the_baseline_is_replaced_and_shown_by_commands(
    harness: Harness, run: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "baseline"
    code, out = harness(
        "baseline", "update", "--from", run, "--baseline", folder, "--reason", "The first",
        "--allow-dirty",
    )  # fmt: skip
    assert code == 0
    assert f"{folder} is now {run}, " in out
    code, out = harness("baseline", "show", "--baseline", folder)
    assert code == 0
    assert f"{folder}: 10 scenes of each of mug, bowl, 120 records\n" in out
    assert "timed on a processor, 2 cores, 2 workers" in out
    assert out.rstrip().endswith(": The first")
    _, out = harness("baseline", "show", "--baseline", folder, "--json")
    assert json.loads(out)["history"][0]["reason"] == "The first"


def test_a_reason_is_asked_for_on_a_terminal_alone(
    harness: Harness, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = (
        "baseline", "update", "--from", run, "--baseline", tmp_path / "new", "--allow-dirty"
    )  # fmt: skip
    with pytest.raises(InputError, match='no reason is given; pass --reason "TEXT"'):
        harness(*command)
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        os.write(ours, b"Masks are trimmed\n")
        code, out = harness(*command)
    os.close(ours)
    assert code == 0
    assert "Why does the baseline change?" in out
    assert read_baseline(tmp_path / "new").history[0].reason == "Masks are trimmed"


def test_a_run_to_become_the_baseline_has_a_calibration(
    harness: Harness, tmp_path: Path, ticks: list[int]
) -> None:
    code, out = harness(
        "baseline", "run", "--scenes", "1", "--workers", "2", "--out", tmp_path / "run"
    )
    assert code == 0
    assert (
        f"2 scenes, 0 failed; make it the baseline: harness baseline update --from {tmp_path}"
        in out
    )
    assert read_calibration(tmp_path / "run") == CALIBRATION
    assert ticks == [2, 2]


def test_a_folder_of_other_code_is_not_judged_for_this(
    baseline: Path, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = copied(run, tmp_path / "out")
    monkeypatch.setattr("harness.gate.run.scene_code_digest", lambda: "another")
    with pytest.raises(InputError, match=r"holds a run of other code .* now another\), which says"):
        run_gate(GateOptions(against=baseline, out=out), wiring=WIRING)
