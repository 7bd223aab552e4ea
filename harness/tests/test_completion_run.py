"""The command `completion-report`: its folder, its output, its interruptions, its refusals."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

from harness import cli
from harness.completion import run as reporting
from harness.completion.mean_shape import MeanShape
from harness.completion.run import CompletionOptions, CompletionResult, run_report
from harness.engines.engine import SceneDone, SceneFailed
from harness.engines.worker import load_target
from harness.errors import InputError
from harness.runs import report as measuring
from harness.tests.fake_report import SCENE_FUNCTION
from harness.tests.fake_scenes import MODELS, begun, is_alive

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from pathlib import Path

    from harness.engines.engine import Event, JobT, Result, Work

PIPELINE = '{"completer": "cloud", "completion": {}, "metric": {"table_height_m": 0.0}}'


class HereEngine:
    """Computes scenes in this process, which starts in no time."""

    def __init__(self, **_: object) -> None:
        pass

    def run(
        self, work: Work[Result], jobs: Sequence[JobT], *, logs: Path
    ) -> Generator[Event[JobT, Result]]:
        function = load_target(work.target)
        for job in jobs:
            try:
                yield SceneDone(job, function(job, *work.arguments), 0.1, 1.0)
            except RuntimeError as error:
                yield SceneFailed(job, f"RuntimeError: {error}")


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measuring, "LocalEngine", HereEngine)


@pytest.fixture(autouse=True)
def fake_parts(monkeypatch: pytest.MonkeyPatch, orders: Path) -> None:
    """Everything but the planning, the workers and the writing."""
    monkeypatch.setattr(reporting, "SCENE_FUNCTION", SCENE_FUNCTION)
    monkeypatch.setattr(reporting, "load_objects", lambda _: MODELS)
    monkeypatch.setattr(reporting, "Pipeline", lambda _: None)
    monkeypatch.setattr("harness.config._rust_pipeline_check", lambda _: PIPELINE)
    monkeypatch.setattr(reporting, "mean_shape", lambda name: MeanShape(name, 0, np.zeros((1, 3))))


def report(folder: Path, **options: object) -> CompletionResult:
    return run_report(CompletionOptions(**{"scenes": 2, "out": folder / "out", **options}))  # type: ignore[arg-type]


@pytest.mark.usefixtures("here")
def test_a_report_is_whole(tmp_path: Path) -> None:
    result = report(tmp_path)
    folder = tmp_path / "out"
    assert sorted(path.name for path in folder.iterdir()) == [
        *("logs", "pictures", "report.json", "sheet.png")
    ]
    names = ["bowl-0000.png", "bowl-0001.png", "mug-0000.png", "mug-0001.png"]
    assert sorted(path.name for path in (folder / "pictures").iterdir()) == names
    assert (folder / "report.json").read_text(encoding="utf-8") == result.text
    content = json.loads(result.text)
    assert [scene["scene_id"] for scene in content["scenes"]] == [name[:-4] for name in names]
    settings = content["settings"]
    assert settings["completers"] == [
        {"setting": name, "refine": refine}
        for name in ("cloud", "centersnap")
        for refine in (True, False)
    ]
    assert settings["config"]["scenes"]["views"] == 1
    assert "workers" not in settings["config"]["run"]
    assert (result.scenes, result.failures) == (4, {})


def test_workers_change_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = [report(tmp_path / "two", workers=2).text]
    monkeypatch.setattr(measuring, "LocalEngine", HereEngine)
    texts.append(report(tmp_path / "here").text)
    assert texts[0] == texts[1]


@pytest.mark.usefixtures("here")
def test_options_reach_the_scenes(tmp_path: Path) -> None:
    result = report(
        tmp_path,
        scenes=1,
        views=3,
        seed=9,
        classes=("bowl",),
        completers=("python:my.own", "python:my.own"),
        cluttered=True,
    )
    content = json.loads(result.text)
    config = content["settings"]["config"]
    assert (config["run"]["seed"], config["run"]["classes"]) == (9, ["bowl"])
    assert (config["scenes"]["views"], config["scenes"]["cluttered"]) == (3, True)
    clouds = {row["cloud"] for row in content["scenes"][0]["clouds"]}
    assert {"own", "own, unrefined"} < clouds
    assert len(content["settings"]["completers"]) == 2


@pytest.mark.usefixtures("here")
def test_a_scene_that_fails_is_named_and_the_others_count(tmp_path: Path, orders: Path) -> None:
    (orders / "mug-0001").write_text("no luck", encoding="utf-8")
    result = report(tmp_path)
    assert result.failures == {"mug-0001": "RuntimeError: no luck"}
    assert result.report.clouds[0].scenes == 1
    for name in ("mug-0000", "bowl-0000", "bowl-0001"):
        (orders / name).write_text("no luck", encoding="utf-8")
    with pytest.raises(InputError, match=r"none of 4 scenes could be measured \(.*: no luck\); tr"):
        report(tmp_path / "none")
    assert not (tmp_path / "none" / "out" / "report.json").exists()


def test_an_interrupt_leaves_no_worker_and_no_report(tmp_path: Path, orders: Path) -> None:
    # A shell that starts a command in the background lets it ignore interrupts.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in ("mug-0000", "mug-0001"):
        (orders / name).write_text("sleep", encoding="utf-8")

    def interrupt() -> None:
        while not (orders / "begun").exists() or len(begun(orders)) < 2:
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    out = tmp_path / "out"
    assert (
        cli.main(["completion-report", "--scenes", "2", "--workers", "2", "--out", str(out)]) == 130
    )
    signal.signal(signal.SIGINT, before)
    assert not any(is_alive(pid) for pid, _ in begun(orders))
    assert not (out / "report.json").exists()


@pytest.mark.usefixtures("here")
def test_the_command_prints_tables_or_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["completion-report", "--scenes", "1", "--class", "mug", "--completer", "cloud"]
    assert cli.main([*arguments, "--out", str(tmp_path / "a")]) == 0
    out, err = capsys.readouterr()
    assert "Mug: 1 scenes, 1 objects, 50% of the surface unseen" in out
    assert "cloud - mean shape" in out
    assert f"written to {tmp_path / 'a'}" in out
    assert err.startswith(f"report: {tmp_path / 'a'}\n1/1 mug-0000 in ")
    assert cli.main([*arguments, "--json", "--out", str(tmp_path / "b")]) == 0
    out, _ = capsys.readouterr()
    assert out == (tmp_path / "b" / "report.json").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"classes": ("spoon",)}, "--class spoon: use one of bottle, bowl, camera, can, laptop, m"),
        ({"classes": ("mug", "mug")}, "names a class twice"),
        ({"classes": ("can",)}, "has no object of class 'can' (it holds: bowl, mug)"),
        ({"completers": ()}, "no --completer; name one, such as cloud"),
        (
            {"completers": ("python:my.observed",)},
            "--completer python:my.observed: its rows would be named 'observed' as those of the "
            "baseline 'observed'; give the function another name",
        ),
        (
            {"completers": ("cloud", "python:my.cloud")},
            "--completer python:my.cloud: its rows would be named 'cloud' as those of cloud; give",
        ),
        ({"views": 0}, "--views 0: should be greater than or equal to 1"),
        ({"scenes": 0}, "--scenes 0: should be greater than or equal to 1"),
    ],
)
def test_options_that_are_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        report(tmp_path, **change)
    assert message in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_completer_that_cannot_be_made_is_refused_before_any_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: str) -> None:
        raise ValueError("weights/cloud.safetensors is missing; restore it")

    monkeypatch.setattr(reporting, "Pipeline", refuse)
    with pytest.raises(InputError, match=r"--completer cloud: weights/cloud\.safetensors is mi"):
        report(tmp_path)
    assert not (tmp_path / "out").exists()


def test_a_folder_in_use_or_beyond_reach_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="out exists and is not an empty folder; pass another --o"):
        report(tmp_path)
    with pytest.raises(InputError, match=r"cannot write to .*: Not a directory; pass a writable"):
        report(tmp_path / "out" / "mine.txt")
