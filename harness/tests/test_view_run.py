"""Which scene of a run is shown, where, and what is said of one that cannot be."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
import typer
from typer.testing import CliRunner

from harness import cli_view
from harness.config import Config
from harness.errors import InputError
from harness.recordings.file import encode
from harness.runs.job import SceneJob
from harness.runs.opening import open_run
from harness.runs.records import Record, Variant, write_records
from harness.tests.fake_view import read_rows, record, recording
from harness.tests.support import full_disk
from harness.view.run import ViewOptions, ViewResult, view_scene

if TYPE_CHECKING:
    from pathlib import Path

FAILED = Record.failed(
    SceneJob("mug-0002", "mug", "mug two", 6),
    variant=Variant("metric"),
    views=2,
    tolerance_m=0.005,
    failure="no arrangement is reachable",
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A finished run of three recorded scenes and a failed one."""
    run = open_run(tmp_path / "main", config=Config(), objects=["mug one"])
    run.recordings.mkdir()
    for scene_id in ("bowl-0000", "mug-0000", "mug-0001"):
        content = encode(replace(recording(), scene_id=scene_id))
        (run.recordings / f"{scene_id}.npz").write_bytes(content)
    write_records([record(), record(tolerance_m=0.01, auroc=0.625), FAILED], run.records_path)
    return run.folder


def options(folder: Path, **change: Any) -> ViewOptions:
    whole: dict[str, Any] = {
        "run": folder,
        "scene": "mug-0000",
        "save": folder.parent / "scene.rrd",
    }
    return ViewOptions(**(whole | change))


def said(refused: pytest.ExceptionInfo[InputError]) -> str:
    return str(refused.value)


def nothing(_: str) -> None:
    return


def test_a_scene_becomes_a_file(folder: Path) -> None:
    result = view_scene(options(folder), say=nothing)
    file = folder.parent / "scene.rrd"
    assert result == ViewResult(
        scene_id="mug-0000",
        model="metric",
        views=2,
        size_bytes=file.stat().st_size,
        file=file,
        note=None,
    )
    rows = read_rows(file)
    assert rows["/__properties"][0].values == {"RecordingInfo:name": ["main mug-0000 metric"]}
    (text,) = rows["/about"][0].values["TextDocument:text"]
    assert "| **metric** | 0.500 | 0.500 | 0.500 | - |" in text
    assert "0.625" not in text
    assert [path.name for path in sorted(folder.parent.iterdir())] == ["main", "scene.rrd"]


def test_a_number_with_a_class_names_a_scene(folder: Path) -> None:
    result = view_scene(options(folder, scene="1", of_class="mug", model="classic"), say=nothing)
    assert (result.scene_id, result.model) == ("mug-0001", "classic")


def test_an_unfinished_run_is_shown_without_metrics(folder: Path) -> None:
    (folder / "records.parquet").unlink()
    result = view_scene(options(folder), say=nothing)
    assert result.note == (
        f"{folder} is unfinished, so that it has no metrics; finish it with "
        f"`harness bench --out {folder}`"
    )
    (text,) = read_rows(folder.parent / "scene.rrd")["/about"][0].values["TextDocument:text"]
    assert text.endswith(f"{result.note}\n")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"scene": "mug-0009"},
            "{run} has no recording of scene mug-0009; nearest: mug-0001, mug-0000, bowl-0000; "
            "it has 3, bowl-0000 to mug-0001",
        ),
        (
            {"scene": "mug-0002"},
            "{run} has no recording of scene mug-0002, which failed (no arrangement is "
            "reachable); nearest: mug-0001, mug-0000, bowl-0000; it has 3, bowl-0000 to mug-0001",
        ),
        (
            {"scene": "../mug-0000"},
            "{run} has no recording of scene ../mug-0000; nearest: mug-0000, mug-0001, bowl-0000; "
            "it has 3, bowl-0000 to mug-0001",
        ),
        (
            {"scene": "3"},
            "--scene 3: say of which class, such as --class mug or --scene mug-0003",
        ),
        (
            {"scene": "3", "of_class": "cup"},
            "--class cup: use one of bottle, bowl, camera, can, laptop, mug",
        ),
        ({"of_class": "bowl"}, "--class bowl: goes with a number, and --scene is mug-0000"),
        (
            {"model": "nearest"},
            "--model nearest: {run} asked no such model; use one of metric, classic",
        ),
        ({"serve": True}, "--save and --serve: choose one"),
        ({"save": None, "serve": True, "port": 0}, "--port 0: use a number from 1 to 65534"),
    ],
)
def test_what_cannot_be_shown_is_said(folder: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as refused:
        view_scene(options(folder, **change), say=nothing)
    assert said(refused) == message.format(run=folder)


def test_a_name_that_no_viewer_knows_is_refused(folder: Path) -> None:
    with pytest.raises(InputError) as refused:
        view_scene(options(folder, save=folder / "x.npz"), say=nothing)
    assert said(refused) == (
        f"--save {folder / 'x.npz'}: end the name in .rrd, by which the viewer knows it"
    )


def test_a_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no run; pass the folder that `harness bench`"):
        view_scene(options(tmp_path), say=nothing)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        (
            "nothing",
            'it recorded none; run it again, into another folder, with `[run] record = "all"`',
        ),
        ("all", "resume it with `harness bench --out {run}`"),
    ],
)
def test_a_run_without_recordings_says_what_to_do(tmp_path: Path, text: str, remedy: str) -> None:
    config = Config.model_validate({"run": {"record": text}})
    run = open_run(tmp_path / "bare", config=config, objects=["mug one"]).folder
    with pytest.raises(InputError) as refused:
        view_scene(options(run), say=nothing)
    assert said(refused) == f"{run} holds no recordings: {remedy.format(run=run)}"


def test_a_damaged_recording_is_named(folder: Path) -> None:
    file = folder / "recordings" / "mug-0000.npz"
    file.write_bytes(file.read_bytes()[:500])
    with pytest.raises(InputError) as refused:
        view_scene(options(folder), say=nothing)
    assert said(refused).startswith(f"{file} is damaged (")
    assert not (folder.parent / "scene.rrd").exists()


def test_a_recording_of_another_scene_is_named(folder: Path) -> None:
    (folder / "recordings" / "mug-0000.npz").replace(folder / "recordings" / "mug-0001.npz")
    with pytest.raises(InputError, match=r"mug-0001\.npz is of scene mug-0000; delete it"):
        view_scene(options(folder, scene="mug-0001"), say=nothing)


def test_a_recording_without_a_view_is_named(folder: Path) -> None:
    file = folder / "recordings" / "mug-0000.npz"
    file.write_bytes(encode(replace(recording(), views=())))
    with pytest.raises(InputError) as refused:
        view_scene(options(folder), say=nothing)
    assert said(refused) == (
        f"{file} is damaged (it holds 0 views and {len(recording().objects)} objects); delete it "
        f"and resume the run with `harness bench --out {folder}`"
    )


@pytest.mark.parametrize("finished", [True, False])
def test_a_run_of_another_record_schema_is_refused(folder: Path, *, finished: bool) -> None:
    manifest = folder / "manifest.json"
    old = json.loads(manifest.read_text("utf-8")) | {"schema_version": 3}
    manifest.write_text(json.dumps(old), "utf-8")
    if not finished:
        (folder / "records.parquet").unlink()
    with pytest.raises(InputError, match="main was written with record schema 3, this version"):
        view_scene(options(folder), say=nothing)


def test_damaged_records_are_named(folder: Path) -> None:
    (folder / "records.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, match=r"records\.parquet is damaged"):
        view_scene(options(folder), say=nothing)


def test_without_the_package_the_command_that_installs_it_is_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError) as refused:
        view_scene(options(folder), say=nothing)
    assert said(refused) == (
        "package 'rerun-sdk' is not installed; `pip install 'credence[view]'` has it"
    )


def test_a_full_disk_leaves_an_earlier_file_whole(folder: Path) -> None:
    view_scene(options(folder), say=nothing)
    before = (folder.parent / "scene.rrd").read_bytes()
    with full_disk(4096), pytest.raises(InputError, match=r"cannot write .*scene\.rrd"):
        view_scene(options(folder), say=nothing)
    assert (folder.parent / "scene.rrd").read_bytes() == before
    assert not list(folder.parent.glob("*.partial"))


app = typer.Typer()
app.registered_commands += cli_view.commands.registered_commands


def test_the_command_says_what_it_wrote(folder: Path) -> None:
    file = folder.parent / "x.rrd"
    arguments = [str(folder), "--scene", "0", "--class", "mug", "--save", str(file)]
    printed = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert (printed.exit_code, printed.stdout) == (
        0,
        f"{file}: {file.stat().st_size / 1e6:.1f} MB; `rerun {file}` shows it\n",
    )
    printed = CliRunner().invoke(app, [*arguments, "--json"], catch_exceptions=False)
    assert json.loads(printed.stdout) == {
        "scene_id": "mug-0000",
        "model": "metric",
        "views": 2,
        "size_bytes": file.stat().st_size,
        "file": str(file),
        "note": None,
    }
