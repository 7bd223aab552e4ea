"""Whole runs on fake scenes: same bytes however disturbed, and folders that refuse."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from harness.bench import BenchOptions, BenchResult, Wiring, run_bench
from harness.errors import InputError
from harness.results import show_confusion, show_run
from harness.runs.atomic import DiskError
from harness.runs.confusion import read_confusion
from harness.runs.directory import default_folder
from harness.runs.job import object_identity
from harness.runs.manifest import UNKNOWN, git_state
from harness.runs.progress import Progress, SilentProgress
from harness.runs.records import SCHEMA_VERSION, read_records, read_timings
from harness.sitting import RunInterruptedError
from harness.tests import fake_scenes
from harness.tests.fake_scenes import begun, is_alive
from harness.tests.fake_wiring import WIRING

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

STABLE = (
    "records.parquet",
    "confusion.parquet",
    "table.md",
    "table.csv",
    "table.tex",
    "config.toml",
)
SCENES = 2
PARENT = """
from pathlib import Path
import sys
from harness.bench import BenchOptions, run_bench
from harness.tests.fake_wiring import WIRING
run_bench(BenchOptions(scenes=2, workers=2, out=Path(sys.argv[1])), wiring=WIRING)
"""


class Notes(SilentProgress):
    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)


def bench(
    out: Path, *, progress: Progress | None = None, wiring: Wiring = WIRING, **options: Any
) -> BenchResult:
    options = {"scenes": SCENES, "workers": 1, **options}
    return run_bench(BenchOptions(out=out, **options), progress=progress, wiring=wiring)


def stable_bytes(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in STABLE if name != "config.toml"}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> BenchResult:
    """A run that nothing disturbed; tests work on copies of it."""
    return bench(tmp_path_factory.mktemp("finished") / "run")


@pytest.fixture
def undisturbed(finished: BenchResult) -> dict[str, bytes]:
    return stable_bytes(finished.folder)


@pytest.fixture
def folder(finished: BenchResult, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished.folder, tmp_path / "run"))


def test_a_run_holds_what_its_document_says(finished: BenchResult) -> None:
    result = finished
    assert (result.scenes, result.failures, result.all_failed) == (4, {}, False)
    names = {path.name for path in result.folder.iterdir()}
    assert names == {*STABLE, "timings.parquet", "manifest.json", "scenes", "logs", ".lock"}
    scenes = sorted(path.name for path in (result.folder / "scenes").iterdir())
    assert scenes == ["bowl-0000.json", "bowl-0001.json", "mug-0000.json", "mug-0001.json"]
    records = read_records(result.folder / "records.parquet")
    assert len(records) == 4 * 2 * 3
    assert [row.scene_id for row in records[:7]] == ["bowl-0000"] * 6 + ["bowl-0001"]
    confusion = read_confusion(result.folder / "confusion.parquet")
    assert sum(row.points for row in confusion) == sum(row.test_points or 0 for row in records)
    assert {row.tolerance_m for row in show_confusion(result.folder)} == {0.005}
    timings = read_timings(result.folder / "timings.parquet")
    assert [(row.scene_id, row.stage) for row in timings[:2]] == [
        ("bowl-0000", "render"),
        ("bowl-0000", "scene"),
    ]
    assert timings[0].peak_memory_mib is None
    assert (timings[1].peak_memory_mib or 0) > 10
    assert show_run(result.folder) == result.table


def test_the_manifest_says_where_the_numbers_come_from(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["schema_version"] == SCHEMA_VERSION
    assert manifest["seed"] == 0
    assert manifest["config"]["run"]["scenes"] == SCENES
    assert manifest["objects"] == sorted(map(object_identity, fake_scenes.MODELS))
    (session,) = manifest["sessions"]
    assert set(session) == {"started", "git", "code", "python", "packages", "machine"}
    assert session["packages"]["polars"]
    assert session["machine"]["cores"] >= 1
    assert session["machine"]["memory_mib"] > 100


def test_code_outside_a_checkout_has_no_revision(tmp_path: Path) -> None:
    file = tmp_path / "module.py"
    file.write_text("", encoding="utf-8")
    assert git_state(file) == {"revision": UNKNOWN, "dirty": UNKNOWN}


def test_the_number_of_workers_changes_no_byte(
    tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    assert stable_bytes(bench(tmp_path / "two", workers=2).folder) == undisturbed


def test_another_seed_changes_the_records(tmp_path: Path, undisturbed: dict[str, bytes]) -> None:
    other = stable_bytes(bench(tmp_path / "other", seed=1).folder)
    assert other["records.parquet"] != undisturbed["records.parquet"]


def test_a_killed_worker_changes_no_byte(
    tmp_path: Path, orders: Path, undisturbed: dict[str, bytes]
) -> None:
    (orders / "mug-0001").write_text("once die", encoding="utf-8")
    progress = Notes()
    folder = bench(tmp_path / "run", progress=progress).folder
    assert stable_bytes(folder) == undisturbed
    assert len(progress.notes) == 1
    assert "worker killed by SIGKILL at mug-0001; trying it once more" in progress.notes[0]


def test_a_killed_parent_leaves_no_worker_and_its_run_resumes_to_the_same_bytes(
    tmp_path: Path, orders: Path, undisturbed: dict[str, bytes]
) -> None:
    (orders / "bowl-0000").write_text("once sleep", encoding="utf-8")
    (orders / "bowl-0001").write_text("once sleep", encoding="utf-8")
    folder = tmp_path / "run"
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(folder)])
    deadline = time.monotonic() + 30
    while len(list(folder.glob("scenes/*.json"))) < 2 or len(list(orders.iterdir())) > 1:
        assert time.monotonic() < deadline
        assert parent.poll() is None
        time.sleep(0.02)
    workers = {pid for pid, _ in begun(orders)} - {os.getpid()}
    assert any(is_alive(pid) for pid in workers)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    while any(is_alive(pid) for pid in workers):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    (folder / "scenes" / "bowl-0000.json.partial").write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match="is unfinished; finish it with `harness bench --out"):
        show_run(folder)

    (orders / "begun").unlink()
    run_bench(BenchOptions(out=folder), wiring=WIRING)
    assert {scene for _, scene in begun(orders)} == {"bowl-0000", "bowl-0001"}
    assert stable_bytes(folder) == undisturbed
    assert not list(folder.glob("**/*.partial"))
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert len(manifest["sessions"]) == 2


def test_ctrl_c_keeps_the_finished_scenes_and_says_how_to_go_on(
    tmp_path: Path, orders: Path, undisturbed: dict[str, bytes]
) -> None:
    class Impatient(Notes):
        def scene_done(self, scene_id: str, seconds: float) -> None:
            raise KeyboardInterrupt

    folder = tmp_path / "run"
    with pytest.raises(RunInterruptedError) as caught:
        bench(folder, progress=Impatient())
    assert str(caught.value) == (
        f"interrupted: 1 of 4 scenes are kept; continue with `harness bench --out {folder}`"
    )
    assert not any(is_alive(pid) for pid, _ in begun(orders) if pid != os.getpid())
    run_bench(BenchOptions(out=folder), wiring=WIRING)
    assert stable_bytes(folder) == undisturbed


@pytest.mark.parametrize("damage", [b"", b'{"schema_version": 3, "sha256": "0"}\n{}\n'])
def test_a_damaged_scene_is_computed_again_and_said_so(
    folder: Path, undisturbed: dict[str, bytes], damage: bytes
) -> None:
    (folder / "scenes" / "mug-0000.json").write_bytes(damage)
    progress = Notes()
    bench(folder, progress=progress)
    assert [note.split(":")[0] for note in progress.notes] == ["mug-0000 is computed again"]
    assert stable_bytes(folder) == undisturbed


def test_a_failed_scene_is_a_row_and_is_tried_again_by_the_next_sitting(
    tmp_path: Path, orders: Path, undisturbed: dict[str, bytes]
) -> None:
    (orders / "mug-0001").write_text("raise", encoding="utf-8")
    result = bench(tmp_path / "run")
    assert result.failures == {"mug-0001": "RuntimeError: no such luck in mug-0001"}
    assert not result.all_failed
    failed = [
        row for row in read_records(result.folder / "records.parquet") if row.status == "failed"
    ]
    assert [(row.scene_id, row.model, row.tolerance_m) for row in failed] == [
        ("mug-0001", model, tolerance_m)
        for model in ("classic", "metric")
        for tolerance_m in (0.0025, 0.005, 0.01)
    ]
    confused = read_confusion(result.folder / "confusion.parquet")
    assert "mug-0001" not in {row.scene_id for row in confused}
    mug = next(row for row in result.table.rows if row.category == "mug")
    assert (mug.scenes, mug.failed) == (1, 1)
    (orders / "mug-0001").unlink()
    bench(result.folder)
    assert stable_bytes(result.folder) == undisturbed


def test_a_run_whose_scenes_all_fail(tmp_path: Path, orders: Path) -> None:
    for scene in ("mug-0000", "mug-0001", "bowl-0000", "bowl-0001"):
        (orders / scene).write_text("raise", encoding="utf-8")
    assert bench(tmp_path / "run").all_failed


def test_records_of_another_scene_are_refused(tmp_path: Path) -> None:
    wiring = replace(WIRING, scene_function=f"{fake_scenes.__name__}:foreign_records")
    result = bench(tmp_path / "run", wiring=wiring)
    assert set(result.failures.values()) == {"the scene function returned another scene's records"}


def test_a_confusion_that_does_not_count_the_points_is_refused(tmp_path: Path) -> None:
    wiring = replace(WIRING, scene_function=f"{fake_scenes.__name__}:lost_confusion")
    result = bench(tmp_path / "run", wiring=wiring)
    assert set(result.failures.values()) == {
        "the scene function's confusion does not count the test points of its records"
    }


def test_out_alone_continues_with_the_runs_own_configuration(
    folder: Path, undisturbed: dict[str, bytes]
) -> None:
    (folder / "scenes" / "mug-0000.json").unlink()
    assert run_bench(BenchOptions(out=folder, workers=2), wiring=WIRING).scenes == 4
    assert stable_bytes(folder) == undisturbed


def test_another_configuration_is_refused_with_the_keys_that_differ(folder: Path) -> None:
    with pytest.raises(InputError) as caught:
        bench(folder, scenes=3, seed=5)
    assert str(caught.value) == (
        f"{folder} holds a run of another configuration: run.scenes (2 there, 3 asked); "
        "run.seed (0 there, 5 asked); pass another --out, or --out alone to continue it as it was"
    )


def test_a_mesh_that_was_changed_is_another_object(folder: Path, tmp_path: Path) -> None:
    mesh = tmp_path / "mug.obj"
    mesh.write_text("v 0 0 0", encoding="utf-8")
    models = [replace(fake_scenes.MODELS[0], path=mesh), *fake_scenes.MODELS[1:]]
    with pytest.raises(InputError, match=r"begun with other objects .*mug/mug_0 sha256:"):
        bench(folder, wiring=replace(WIRING, load_objects=lambda _: models))


def test_other_objects_and_other_schemas_are_refused(folder: Path) -> None:
    fewer = replace(WIRING, load_objects=lambda _: fake_scenes.MODELS[:-1])
    with pytest.raises(InputError, match=r"begun with other objects .*bowl/bowl_2"):
        bench(folder, wiring=fewer)
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(manifest | {"schema_version": 0}), encoding="utf-8")
    versions = f"written with record schema 0, this version writes {SCHEMA_VERSION}"
    with pytest.raises(InputError, match=versions):
        bench(folder)
    path.write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match=r"manifest.json cannot be read .*choose another folder"):
        bench(folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"schema_version": 3}', "is no run's manifest: no dict 'config'; choose another folder"),
        ("[]", "is no run's manifest: no int 'schema_version'"),
    ],
)
def test_a_manifest_of_something_else_is_refused(folder: Path, text: str, message: str) -> None:
    (folder / "manifest.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        bench(folder)
    with pytest.raises(InputError, match=message):
        show_run(folder)


def test_an_edited_configuration_is_refused_though_it_equals_itself(folder: Path) -> None:
    path = folder / "config.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("test_points = 1000", "test_points = 999"), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        run_bench(BenchOptions(out=folder), wiring=WIRING)
    assert str(caught.value) == (
        f"{path} is not what the run was begun with: protocol.test_points (1000 there, 999 asked); "
        "undo the edit, or pass it as --config with another --out"
    )


def test_a_configuration_of_another_version_is_refused(folder: Path) -> None:
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    manifest["config"]["scenes"]["fog"] = 0.5
    path.write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(InputError, match=r"does not know \(scenes.fog\); read it with the version"):
        show_run(folder)


def test_a_run_keeps_the_pipelines_defaults_and_takes_an_explicit_one(tmp_path: Path) -> None:
    wiring = replace(WIRING, check_pipeline=None)
    folder = bench(tmp_path / "run", wiring=wiring).folder
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    stored = tomllib.loads((folder / "config.toml").read_text(encoding="utf-8"))["pipeline"]
    assert stored == manifest["config"]["pipeline"]
    assert stored["training"]["points"] == 3600
    empty, explicit = tmp_path / "empty.toml", tmp_path / "explicit.toml"
    empty.touch()
    explicit.write_text("[pipeline.training]\npoints = 3600\n", encoding="utf-8")
    assert bench(folder, wiring=wiring, config=explicit).folder == folder
    # A default that is another today than when the run was begun.
    other = replace(WIRING, check_pipeline=lambda text: text.replace("{}", '{"points": 99}'))
    with pytest.raises(InputError, match=r"pipeline.points \(unset there, 99 asked\)"):
        bench(folder, wiring=other, config=empty)


def test_changed_code_is_said(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    manifest["sessions"][0]["python"] = "3.11.0rc1"
    path.write_text(json.dumps(manifest), encoding="utf-8")
    progress = Notes()
    bench(folder, progress=progress)
    assert len(progress.notes) == 1
    assert progress.notes[0].startswith(
        "python changed since the run was last worked at: 3.11.0rc1"
    )


def test_a_run_in_use_is_refused(folder: Path) -> None:

    class Second(Notes):
        def watch(
            self, *, folder: Path, scenes: int, finished: int
        ) -> AbstractContextManager[None]:
            with pytest.raises(InputError, match="is in use by another process"):
                bench(folder)
            return super().watch(folder=folder, scenes=scenes, finished=finished)

    bench(folder, progress=Second())


def test_folders_that_cannot_become_a_run(tmp_path: Path, orders: Path) -> None:
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    with pytest.raises(DiskError, match=r"cannot create a run in .*: Not a directory; pass a writ"):
        bench(file / "run")
    with pytest.raises(InputError, match="file exists and holds no run; pass another --out"):
        bench(file)
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="full exists and holds no run"):
        bench(full)
    assert [path.name for path in full.iterdir()] == ["mine"]
    assert not (orders / "begun").exists()


@pytest.mark.parametrize(
    "left",
    [
        [],
        ["scenes/"],
        ["scenes/", "logs/", "config.toml.partial"],
        ["scenes/", "logs/", "config.toml", "manifest.json.partial"],
    ],
)
def test_what_a_run_leaves_that_is_killed_at_its_beginning_is_begun_again(
    tmp_path: Path, undisturbed: dict[str, bytes], left: list[str]
) -> None:
    leave(tmp_path / "run", left)
    assert stable_bytes(bench(tmp_path / "run").folder) == undisturbed
    assert not list(tmp_path.rglob("*.partial"))


@pytest.mark.parametrize(
    "left", [["config.toml"], ["scenes/", "config.toml"], ["scenes/mine", "logs/"], ["logs"]]
)
def test_what_a_person_left_is_not_taken_for_a_runs(tmp_path: Path, left: list[str]) -> None:
    leave(tmp_path / "run", left)
    with pytest.raises(InputError, match="run exists and holds no run; pass another --out"):
        bench(tmp_path / "run")
    assert all((tmp_path / "run" / name).exists() for name in left)


def leave(folder: Path, names: list[str]) -> None:
    """Make folders, whose names end in a slash, and files."""
    folder.mkdir()
    for name in names:
        path = folder / name
        if name.endswith("/"):
            path.mkdir()
        else:
            path.parent.mkdir(exist_ok=True)
            path.write_text("x", encoding="utf-8")


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes where it likes")
def test_a_folder_without_permission(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(DiskError, match="Permission denied; pass a writable --out"):
        bench(tmp_path / "run")


def full_disk(monkeypatch: pytest.MonkeyPatch, *, after: int) -> None:
    """Let the disk be full after so many files."""
    real, left = os.fsync, [after]

    def fsync(descriptor: int) -> None:
        if left[0] == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        left[0] -= 1
        real(descriptor)

    monkeypatch.setattr("harness.runs.atomic.os.fsync", fsync)


@pytest.mark.parametrize("existed", [False, True])
@pytest.mark.parametrize("after", [0, 2])
def test_a_disk_full_from_the_start_leaves_nothing(
    tmp_path: Path, orders: Path, monkeypatch: pytest.MonkeyPatch, after: int, *, existed: bool
) -> None:
    folder = tmp_path / "run"
    if existed:
        folder.mkdir()
    full_disk(monkeypatch, after=after)
    with pytest.raises(DiskError, match=r"cannot write .*: No space left on device"):
        bench(folder)
    assert folder.exists() == existed
    assert not existed or list(folder.iterdir()) == []
    assert not (orders / "begun").exists()


def test_a_disk_full_in_the_middle_keeps_whole_scenes_only(
    tmp_path: Path, undisturbed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    # Two syncs a file (the file, its folder): configuration, manifest, session, first scene.
    with monkeypatch.context() as patch:
        full_disk(patch, after=8)
        with pytest.raises(DiskError) as caught:
            bench(folder)
    assert "No space left on device" in str(caught.value)
    assert str(caught.value).endswith(
        f"1 of 4 scenes are kept, continue with `harness bench --out {folder}`"
    )
    assert [path.name for path in (folder / "scenes").iterdir()] == ["mug-0000.json"]
    run_bench(BenchOptions(out=folder), wiring=WIRING)
    assert stable_bytes(folder) == undisturbed


def test_show_of_what_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no run; pass the folder"):
        show_run(tmp_path)


def test_quick_and_scenes_exclude_each_other(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--quick means --scenes 8; pass one of the two"):
        bench(tmp_path / "run", quick=True)


def test_the_default_folder_is_named_by_time_and_configuration() -> None:
    from datetime import UTC, datetime

    from harness.config import Config

    name = default_folder(Config(), now=datetime(2025, 3, 1, 12, 30, 5, tzinfo=UTC))
    assert name == Path("results") / f"20250301T123005Z-{Config().short_hash()}"
    assert len(Config().short_hash()) == 8
