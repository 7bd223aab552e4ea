from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from harness.assets import (
    BENCHMARK_COUNTS,
    BENCHMARK_SEED,
    Progress,
    generate_assets,
    shows_every_kind,
)
from sim_scenes.objects import CATEGORIES, ObjectError, load_object_set
from sim_scenes.objects.object_set import BENCHMARK_FOLDER

if TYPE_CHECKING:
    from pathlib import Path


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_writes_a_folder_that_objects_takes(tmp_path: Path) -> None:
    seen: list[Progress] = []
    counts = {"mug": 2, "bowl": 1}
    records = generate_assets(tmp_path, seed=5, counts=counts, progress=seen.append)
    assert [record.name for record in records] == [
        "bowl_train_000",
        "mug_train_000",
        "mug_train_001",
    ]
    assert [(step.done, step.total) for step in seen] == [(1, 3), (2, 3), (3, 3)]
    assert set(files(tmp_path)) == {"MANIFEST.json", *(record.path for record in records)}
    found = load_object_set(tmp_path)
    found.check_meshes()
    assert [model.category for model in found.models] == ["bowl", "mug", "mug"]


def test_same_arguments_give_the_same_folder(tmp_path: Path) -> None:
    for name in ("one", "two"):
        generate_assets(tmp_path / name, split="validation", seed=1, per_category=1)
    generate_assets(tmp_path / "other", split="train", seed=1, per_category=1)
    assert files(tmp_path / "one") == files(tmp_path / "two")
    contents = set(files(tmp_path / "one").values())
    assert not contents & set(files(tmp_path / "other").values())


def test_a_broken_run_leaves_no_manifest(tmp_path: Path) -> None:
    generate_assets(tmp_path, seed=1, counts={"can": 1})

    def stop(_: Progress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate_assets(tmp_path, seed=1, counts={"can": 2}, progress=stop)
    assert not (tmp_path / "MANIFEST.json").exists()
    assert not list(tmp_path.rglob("*.partial"))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"split": "exam"}, "no split is named 'exam'; use one of train, validation, test"),
        ({"counts": {"cup": 1}}, "no category is named 'cup'; use one of bottle"),
        ({"counts": {"mug": -1}}, "-1 meshes of category mug; ask for 0 or more"),
        ({"per_category": 0}, "no mesh was asked for; give at least one category"),
        ({"seed": -2}, "seed -2 must not be negative"),
    ],
)
def test_refuses(tmp_path: Path, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ObjectError, match=message):
        generate_assets(tmp_path / "out", **settings)
    assert not list(tmp_path.rglob("*.ply"))


@pytest.mark.parametrize(
    "settings",
    [{"seed": 1, "counts": {"can": 1}}, {"split": "test", "counts": {"can": 1}}],
)
def test_another_set_is_kept(tmp_path: Path, settings: dict[str, Any]) -> None:
    generate_assets(tmp_path, counts={"can": 1})
    before = files(tmp_path)
    expected = r"MANIFEST\.json: lists objects/can/can_train_000\.ply of another set; pass an empty"
    with pytest.raises(ObjectError, match=expected):
        generate_assets(tmp_path, **settings)
    assert files(tmp_path) == before
    # More meshes of the same set lose none.
    generate_assets(tmp_path, counts={"can": 2})
    assert before.keys() < files(tmp_path).keys()


def test_a_manifest_that_would_hide_the_new_one_is_kept(tmp_path: Path) -> None:
    generate_assets(tmp_path, counts={"can": 1})
    (tmp_path / "MANIFEST.json").rename(tmp_path / "manifest.json")
    with pytest.raises(ObjectError, match=r"manifest\.json: lists the meshes of another set; pass"):
        generate_assets(tmp_path, counts={"can": 1})
    (tmp_path / "manifest.json").write_text("{", encoding="utf-8")
    with pytest.raises(ObjectError, match=r"manifest\.json: cannot be read as JSON"):
        generate_assets(tmp_path, counts={"can": 1})


@pytest.mark.parametrize("inner", ["", "deep/er"])
def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path, inner: str) -> None:
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    expected = (
        rf"^cannot write to {file / inner}: Not a directory; pass a folder that can be written"
    )
    with pytest.raises(ObjectError, match=expected):
        generate_assets(file / inner, counts={"can": 1})
    assert files(tmp_path) == {"file": b"mine"}


def test_the_committed_set_is_the_benchmark() -> None:
    models = load_object_set().models
    counts = {name: sum(model.category == name for model in models) for name in CATEGORIES}
    # PyBullet's own mug is one more.
    assert counts == {**BENCHMARK_COUNTS, "mug": BENCHMARK_COUNTS["mug"] + 1}
    assert sum(model.path.stat().st_size for model in models) < 5_000_000
    text = (BENCHMARK_FOLDER / "MANIFEST.json").read_text(encoding="utf-8")
    needed = {"sha256", "category", "extents_m", "license", "watertight", "source"}
    assert all(needed <= set(entry) for entry in json.loads(text))


def test_the_benchmark_s_seed_is_the_smallest_that_shows_every_kind() -> None:
    # By hand: seed 0 draws neither an ear nor a square handle, seed 1 no cereal bowl.
    assert [shows_every_kind(seed) for seed in range(BENCHMARK_SEED + 1)] == [False, False, True]


@pytest.mark.slow
def test_the_committed_set_is_reproduced(tmp_path: Path) -> None:
    generate_assets(tmp_path, benchmark=True)
    made = files(tmp_path)
    assert made == {name: (BENCHMARK_FOLDER / name).read_bytes() for name in made}
