"""The folder of training pictures: same bytes always, continued, repaired, refused."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from safetensors import safe_open

from harness import cli, training_pictures
from harness.errors import InputError
from harness.picture_shards import (
    DamagedShardError,
    ShardKey,
    check_shard,
    shard_metadata,
    write_shard,
)
from harness.runs.atomic import DiskError
from harness.tests.support import full_disk
from harness.training_pictures import PictureOptions, Step, draw_shard, make_pictures
from sim_scenes import load_object_set
from sim_scenes.pictures import GROUP, TrainingPicture, draw_group

if TYPE_CHECKING:
    from pathlib import Path

KEY = ShardKey(objects="ab", seed=3, first=0, count=2)
COUNT = GROUP + 5


def write_meshes(folder: Path, height_m: float = 0.1) -> Path:
    folder.mkdir()
    trimesh.creation.cylinder(radius=0.03, height=height_m, sections=16).export(folder / "tin.ply")
    (folder / "manifest.json").write_text('[{"path": "tin.ply", "category": "can"}]')
    return folder


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_meshes(tmp_path_factory.mktemp("sets") / "meshes")


@pytest.fixture(autouse=True)
def small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a shard be a group, so that a test has several."""
    monkeypatch.setattr(training_pictures, "PICTURES_PER_SHARD", GROUP)


@pytest.fixture(scope="module")
def made(meshes: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished folder of one worker; nobody writes to it."""
    out = tmp_path_factory.mktemp("pictures") / "made"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training_pictures, "PICTURES_PER_SHARD", GROUP)
        make_pictures(PictureOptions(meshes, out, COUNT, workers=1))
    return out


def shards(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("shard-*")}


def copy(made: Path, to: Path) -> Path:
    to.mkdir()
    for path in made.iterdir():
        (to / path.name).write_bytes(path.read_bytes())
    return to


def blank(value: int = 0) -> TrainingPicture:
    return TrainingPicture(
        rgb=np.full((240, 320, 3), value, dtype=np.uint8),
        depth=np.full((240, 320), value, dtype=np.uint16),
        instances=np.zeros((240, 320), dtype=np.uint8),
        classes=np.zeros(16, dtype=np.uint8),
    )


def test_a_shard_holds_the_tensors_that_the_training_reads(tmp_path: Path) -> None:
    path = tmp_path / "shard"
    write_shard(path, [blank(7), blank(9)], KEY)
    with safe_open(path, framework="numpy") as file:
        assert dict(file.metadata()) | {"crc32": ""} == {
            "format": "1",
            "seed": "3",
            "first": "0",
            "objects": "ab",
            "crc32": "",
        }
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    assert {name: (a.dtype, a.shape) for name, a in tensors.items()} == {
        "rgb": (np.uint8, (2, 240, 320, 3)),
        "depth": (np.uint16, (2, 240, 320)),
        "instances": (np.uint8, (2, 240, 320)),
        "classes": (np.uint8, (2, 16)),
    }
    assert (tensors["depth"][1] == 9).all()
    check_shard(path, KEY)


def test_the_order_of_a_shards_metadata_does_not_hang_on_the_process(tmp_path: Path) -> None:
    paths = [tmp_path / str(k) for k in range(8)]
    for path in paths:
        # The library's map has another order each time it is made.
        write_shard(path, [blank()], KEY)
    assert len({path.read_bytes() for path in paths}) == 1


@pytest.mark.parametrize("at", [-1, 8, 40, 5000])
def test_a_damaged_byte_is_found(tmp_path: Path, at: int) -> None:
    path = tmp_path / "shard"
    write_shard(path, [blank(), blank()], KEY)
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)
    with pytest.raises(DamagedShardError):
        check_shard(path, KEY)


def test_a_shard_of_other_pictures_is_found(tmp_path: Path) -> None:
    path = tmp_path / "shard"
    write_shard(path, [blank(), blank()], KEY)
    with pytest.raises(DamagedShardError, match="it holds 2 pictures, not 3"):
        check_shard(path, ShardKey("ab", 3, 0, 3))
    with pytest.raises(DamagedShardError, match="'seed': '3'"):
        check_shard(path, ShardKey("ab", 4, 0, 2))
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(DamagedShardError, match="it cannot be read"):
        check_shard(path, KEY)
    assert shard_metadata(path) == {}


def test_a_shard_is_its_groups_pictures(meshes: Path) -> None:
    objects = load_object_set(meshes)
    across = draw_shard(objects, ShardKey("", 0, GROUP - 2, 4))
    groups = [*draw_group(objects, 0, 0)[-2:], *draw_group(objects, 0, 1)[:2]]
    assert [p.rgb.tobytes() for p in across] == [p.rgb.tobytes() for p in groups]


def test_the_manifest_says_what_was_made(meshes: Path, made: Path) -> None:
    values = json.loads((made / "manifest.json").read_text())
    assert {key: values[key] for key in ("format", "seed", "count", "pictures_per_shard")} == {
        "format": 1,
        "seed": 0,
        "count": COUNT,
        "pictures_per_shard": GROUP,
    }
    assert values["objects"]["folder"] == "meshes"
    assert len(values["objects"]["sha256"]) == 64
    assert values["command"].startswith("harness training-pictures --objects ")
    assert f"--count {COUNT} --seed 0" in values["command"]
    assert sorted(shards(made)) == ["shard-00000.safetensors", "shard-00001.safetensors"]


def test_two_workers_make_the_same_bytes(meshes: Path, made: Path, tmp_path: Path) -> None:
    result = make_pictures(PictureOptions(meshes, tmp_path / "two", COUNT, workers=2))
    assert (result.made, result.kept) == (COUNT, 0)
    assert shards(tmp_path / "two") == shards(made)


def test_what_is_whole_is_kept_and_what_is_damaged_made_again(
    meshes: Path, made: Path, tmp_path: Path
) -> None:
    out = copy(made, tmp_path / "out")
    whole, damaged = sorted(out.glob("shard-*"))
    data = bytearray(damaged.read_bytes())
    data[-1000] ^= 1
    damaged.write_bytes(data)
    (out / "shard-00001.safetensors.partial").write_bytes(b"rubbish")
    before = whole.stat().st_mtime_ns
    result = make_pictures(PictureOptions(meshes, out, COUNT, workers=1))
    assert (result.made, result.kept) == (5, GROUP)
    assert result.repaired == {"shard-00001.safetensors": "its checksum is wrong"}
    assert whole.stat().st_mtime_ns == before
    assert shards(out) == shards(made)
    assert not list(out.glob("*.partial"))


def test_a_folder_grows(meshes: Path, made: Path, tmp_path: Path) -> None:
    out = copy(made, tmp_path / "out")
    result = make_pictures(PictureOptions(meshes, out, 2 * GROUP, workers=1))
    assert (result.made, result.kept) == (GROUP, GROUP)
    assert json.loads((out / "manifest.json").read_text())["count"] == 2 * GROUP


def test_interrupted_it_leaves_whole_shards_and_no_manifest(
    meshes: Path, made: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"

    def stop(step: Step) -> None:
        if step.done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_pictures(PictureOptions(meshes, out, COUNT, workers=1), progress=stop)
    assert [path.name for path in out.iterdir()] == ["shard-00000.safetensors"]
    result = make_pictures(PictureOptions(meshes, out, COUNT, workers=1))
    assert (result.made, result.kept) == (5, GROUP)
    assert shards(out) == shards(made)


def test_a_folder_of_other_pictures_is_refused(meshes: Path, made: Path, tmp_path: Path) -> None:
    before = shards(made)
    with pytest.raises(InputError, match=r"shard-00000.* is of seed 0, not 1; pass an empty"):
        make_pictures(PictureOptions(meshes, made, COUNT, seed=1, workers=1))
    others = write_meshes(tmp_path / "others", 0.11)
    (others / "manifest.json").write_text(
        '[{"path": "tin.ply", "category": "can", "name": "other"}]'
    )
    with pytest.raises(InputError, match="is of objects"):
        make_pictures(PictureOptions(others, made, COUNT, workers=1))
    with pytest.raises(InputError, match=r"holds more than 10 pictures .*--count"):
        make_pictures(PictureOptions(meshes, made, GROUP, workers=1))
    assert shards(made) == before


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"count": 0}, "--count is 0; it must lie in 1 to"),
        ({"workers": 0}, "--workers is 0"),
        ({"seed": -1}, "--seed is -1; it must be 0 or more"),
    ],
)
def test_wrong_numbers_are_named(
    meshes: Path, tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    options = PictureOptions(meshes, tmp_path / "out", 5, workers=1)
    with pytest.raises(InputError, match=said):
        make_pictures(replace(options, **change))
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_named(meshes: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot make .*file: .*pass another --out"):
        make_pictures(PictureOptions(meshes, tmp_path / "file", 5, workers=1))


def test_a_mesh_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    folder = write_meshes(tmp_path / "meshes")
    (folder / "tin.ply").write_text("ply, but no more")
    options = PictureOptions(folder, tmp_path / "out", 5, workers=1)
    with pytest.raises(InputError, match=r"--objects: .*tin\.ply: cannot be read as a mesh"):
        make_pictures(options)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_full_disk_leaves_nothing_half_written(
    meshes: Path, tmp_path: Path, workers: int
) -> None:
    out = tmp_path / "out"
    with full_disk(1_000_000), pytest.raises(DiskError, match=r"cannot write .*shard-0000"):
        make_pictures(PictureOptions(meshes, out, COUNT, workers=workers))
    assert list(out.iterdir()) == []


# A shell's background jobs inherit ignored interrupts.
COMMAND = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
from harness import cli, training_pictures
training_pictures.PICTURES_PER_SHARD = {GROUP}
sys.exit(cli.main())
"""


def test_ctrl_c_ends_the_workers_and_the_same_command_continues(
    meshes: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    arguments = ["--objects", str(meshes), "--out", str(out), "--count", "2000", "--workers", "2"]
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "training-pictures", *arguments],
        stderr=subprocess.PIPE,
        text=True,
    )
    end = time.monotonic() + 60
    while not list(out.glob("shard-*.safetensors")) and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(2)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    said = err.splitlines()[-1]
    assert said.startswith("harness: interrupted: whole shards are kept; continue with `harness ")
    assert "--count 2000 --seed 0`" in said
    assert {path.suffix for path in out.iterdir()} == {".safetensors"}


def test_the_command_says_what_it_did(
    meshes: Path, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = copy(made, tmp_path / "out")
    arguments = ["--objects", str(meshes), "--out", str(out), "--count", str(COUNT)]
    assert cli.main(["training-pictures", *arguments]) == 0
    said = capsys.readouterr()
    assert f"0 pictures in 0 s, {COUNT} were there; written to {out}" in said.out
    assert f"{COUNT}/{COUNT} pictures" in said.err


def test_missing_meshes_get_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing, out = str(tmp_path / "none"), str(tmp_path / "out")
    arguments = ["--objects", missing, "--out", out, "--count", "5"]
    assert cli.main(["training-pictures", *arguments]) == 2
    err = capsys.readouterr().err
    assert err == (
        f"harness: --objects: {missing}: no such folder; "
        "pass a folder of meshes with a manifest.json\n"
    )


def test_without_safetensors_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [n for n in sys.modules if n.startswith(("safetensors", "harness.picture_sh"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "harness.training_pictures")
    monkeypatch.setitem(sys.modules, "safetensors", None)
    arguments = ["--objects", str(tmp_path), "--out", str(tmp_path), "--count", "5"]
    assert cli.main(["training-pictures", *arguments]) == 2
    assert "pip install 'credence[train]'" in capsys.readouterr().err
