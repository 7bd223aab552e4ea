from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from sim_scenes import (
    BopError,
    DepthNoise,
    Intrinsics,
    ObjectSet,
    Scene,
    SceneSpec,
    open_bop,
    read_bop,
    simulate,
    write_bop,
)
from sim_scenes.tests.support import ids

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


@pytest.fixture
def written(tiny_scene: Scene, tmp_path: Path) -> Path:
    """A dataset of one scene, with all our extra keys."""
    root = tmp_path / "set"
    assert write_bop([tiny_scene], root) == []
    return root


def edit(path: Path, change: Callable[[Any], object]) -> None:
    table = json.loads(path.read_text(encoding="utf-8"))
    change(table)
    path.write_text(json.dumps(table), encoding="utf-8")


def make_foreign(root: Path, *, categories: bool = True) -> Path:
    """Strip what other writers do not write; returns the scene's folder."""
    scene = root / "test" / "000000"
    (scene / "scene_source.json").unlink()

    def strip(table: dict[str, Any], keys: list[str]) -> None:
        for entry in table.values():
            for item in entry if isinstance(entry, list) else [entry]:
                for key in keys:
                    item.pop(key, None)

    edit(
        scene / "scene_camera.json",
        lambda t: strip(t, ["world_from_camera", "joint_positions_rad"]),
    )
    edit(scene / "scene_gt.json", lambda t: strip(t, ["world_from_object", "instance_id"]))
    infos = ["name"] if categories else ["name", "category"]
    edit(root / "models" / "models_info.json", lambda t: strip(t, infos))
    return scene


def read_one(root: Path) -> Scene:
    (scene,) = read_bop(root)
    return scene


# --- our own data ---


def test_reading_back_gives_the_same_bits(tiny_scene: Scene, written: Path) -> None:
    back = read_one(written)
    assert back.digest() == tiny_scene.digest()
    assert (back.name, back.seed, back.spec) == ("mug-7", 7, tiny_scene.spec)
    assert back.redraws == ("pyramid toppled",)
    assert back.notes == ()
    for a, b in zip(back.objects, tiny_scene.objects, strict=True):
        assert (a.instance_id, a.name, a.category) == (b.instance_id, b.name, b.category)
        assert a.vertices.tobytes() == b.vertices.tobytes()
        assert a.world_from_object.tobytes() == b.world_from_object.tobytes()
        np.testing.assert_array_equal(a.faces, b.faces)


def test_simulated_scenes_read_back_and_share_models(
    object_set: ObjectSet, small: SceneSpec, tmp_path: Path
) -> None:
    crowded = SceneSpec.clutter("mug", objects=(3, 3), views=1, image_size=(160, 120))
    scenes = [simulate(small, 0, object_set), simulate(crowded, 0, object_set)]
    assert write_bop(iter(scenes), tmp_path / "set", split="val") == []
    assert [scene.digest() for scene in read_bop(tmp_path / "set")] == [s.digest() for s in scenes]
    assert len(list((tmp_path / "set" / "models").glob("*.ply"))) == 3
    assert open_bop(tmp_path / "set").scene_ids == (0, 1)


def test_masks_of_a_simulated_scene_hold_the_visible_part(
    object_set: ObjectSet, tmp_path: Path
) -> None:
    spec = SceneSpec(models=("box",), views=1, image_size=(160, 120), depth_noise=DepthNoise.off())
    scene = simulate(spec, 0, object_set)
    (note,) = write_bop([scene], tmp_path / "set")
    assert note.startswith("scene box-0: depth rounded to 0.1 mm in ")
    folder = tmp_path / "set" / "test" / "000000"
    whole, visible = (
        np.asarray(Image.open(folder / name / "000000_000000.png")) > 0
        for name in ("mask", "mask_visib")
    )
    np.testing.assert_array_equal(visible, scene.frames[0].instance_ids == 1)
    # Nothing stands before the box: the two outlines differ by float32 at the edge, at most.
    assert 0 <= whole.sum() - visible.sum() <= 3


def test_files_are_as_bop_has_them(tiny_scene: Scene, written: Path) -> None:
    folder = written / "test" / "000000"
    camera = json.loads((folder / "scene_camera.json").read_text())["1"]
    assert camera["cam_K"] == [10.1, 0, 3.5, 0, 10.2, 2.5, 0, 0, 1]
    assert camera["depth_scale"] == 0.1
    item = tiny_scene.objects[1]
    truth = json.loads((folder / "scene_gt.json").read_text())["1"][1]
    # BOP's chain: world from camera, camera from model, both in millimetres.
    rotation = np.array(camera["cam_R_w2c"]).reshape(3, 3)
    in_camera = rotation @ item.world_from_object[:3, 3] * 1000 + camera["cam_t_w2c"]
    np.testing.assert_allclose(truth["cam_t_m2c"], in_camera, atol=1e-9)
    assert truth["obj_id"] == 2
    depth = Image.open(folder / "depth" / "000000.png")
    assert depth.mode.startswith("I;16")
    raw = np.asarray(depth)
    assert raw[0, 0] == 0
    np.testing.assert_allclose(raw * 1e-4, np.nan_to_num(tiny_scene.frames[0].depth_m), atol=1e-7)

    info = json.loads((folder / "scene_gt_info.json").read_text())
    # Instance 2 is not seen in the first image.
    assert info["0"][1]["bbox_visib"] == [-1, -1, -1, -1]
    assert info["0"][1]["visib_fract"] == 0
    assert info["1"][1]["bbox_visib"] == [5, 3, 2, 2]
    assert info["1"][1]["px_count_visib"] == 4
    assert info["1"][0]["px_count_valid"] == info["1"][0]["px_count_all"]

    models = json.loads((written / "models" / "models_info.json").read_text())
    assert models["1"]["size_x"] == pytest.approx(90)
    assert models["1"]["diameter"] == pytest.approx(90 * np.sqrt(2))
    assert (written / "dataset_info.md").is_file()
    assert json.loads((written / "camera.json").read_text())["width"] == 8


def test_depth_off_the_grid_is_rounded_and_said(tiny_scene: Scene, tmp_path: Path) -> None:
    frame = tiny_scene.frames[0]
    depth_m = frame.depth_m.copy()
    depth_m[2, 2], depth_m[3, 3] = np.float32(0.50003), np.float32(7.0)
    scene = replace(tiny_scene, frames=(replace(frame, depth_m=depth_m),))
    assert write_bop([scene], tmp_path / "set") == [
        "scene mug-7: depth rounded to 0.1 mm in 1 pixels",
        "scene mug-7: 1 pixels beyond the 16-bit range left without depth",
    ]
    back = read_one(tmp_path / "set").frames[0].depth_m
    assert back[2, 2] == np.float32(0.5)
    assert np.isnan(back[3, 3])


def test_an_existing_dataset_is_not_overwritten(tiny_scene: Scene, written: Path) -> None:
    before = sorted(written.rglob("*"))
    with pytest.raises(BopError, match="exists and is not an empty folder; name a new one"):
        write_bop([tiny_scene], written)
    assert sorted(written.rglob("*")) == before


def test_nothing_is_left_of_a_write_that_fails(tiny_scene: Scene, tmp_path: Path) -> None:
    def scenes() -> Iterator[Scene]:
        yield tiny_scene
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_bop(scenes(), tmp_path / "set")
    assert not list(tmp_path.iterdir())


def test_an_unwritable_folder_is_named(tiny_scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BopError, match=r"file/set: cannot be written .*; choose a folder"):
        write_bop([tiny_scene], tmp_path / "file" / "set")


def test_a_full_disk_leaves_nothing(
    tiny_scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_args: object, **_kwargs: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(BopError, match="No space left on device"):
        write_bop([tiny_scene], tmp_path / "set")
    assert not list(tmp_path.iterdir())


# --- foreign data ---


def test_foreign_data_keeps_its_geometry(tiny_scene: Scene, written: Path) -> None:
    make_foreign(written)
    back = read_one(written)
    assert back.name == "000000"
    assert back.spec is None
    assert back.seed is None
    assert [item.name for item in back.objects] == ["obj_000001", "obj_000002"]
    for a, b in zip(back.objects, tiny_scene.objects, strict=True):
        np.testing.assert_allclose(a.world_from_object, b.world_from_object, atol=1e-12)
    for got, put in zip(back.frames, tiny_scene.frames, strict=True):
        np.testing.assert_array_equal(ids(got), ids(put))
        np.testing.assert_array_equal(got.depth_m, put.depth_m)
        np.testing.assert_allclose(got.world_from_camera, put.world_from_camera, atol=1e-12)
        assert got.joint_positions_rad is None


def test_objects_are_followed_by_place_not_by_row(written: Path) -> None:
    scene = make_foreign(written)

    def swap(table: dict[str, Any]) -> None:
        # Two objects of one model, listed in another order in the second image.
        for entry in table.values():
            entry[1]["obj_id"] = 1
        table["1"].reverse()

    edit(scene / "scene_gt.json", swap)
    for name in ("000001_000000.png", "000001_000001.png"):
        (scene / "mask_visib" / name).rename(scene / "mask_visib" / f"was-{name}")
    (scene / "mask_visib" / "was-000001_000000.png").rename(scene / "mask_visib/000001_000001.png")
    (scene / "mask_visib" / "was-000001_000001.png").rename(scene / "mask_visib/000001_000000.png")
    back = read_one(written)
    assert [item.name for item in back.objects] == ["obj_000001", "obj_000001"]
    assert (ids(back.frames[1])[2:4, 2:4] == 1).sum() == 4
    assert ids(back.frames[1])[4, 6] == 2


def test_rounded_rotations_are_taken_for_what_they_mean(written: Path) -> None:
    scene = make_foreign(written)

    def rounded(table: dict[str, Any]) -> None:
        for entry in table.values():
            entry["cam_R_w2c"] = [round(value, 4) for value in entry["cam_R_w2c"]]

    edit(scene / "scene_camera.json", rounded)
    rotation = read_one(written).frames[0].world_from_camera[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)


@pytest.mark.parametrize(
    ("missing", "note"),
    [
        ("scene_gt.json", "there is no scene_gt.json: nothing to score against"),
        ("models", "object 1 is left out: the dataset has no models"),
        ("categories", "object 1 is left out: models_info.json gives it no category"),
    ],
)
def test_frames_without_truth_still_load(written: Path, missing: str, note: str) -> None:
    scene = make_foreign(written, categories=missing != "categories")
    if missing == "models":
        (written / "models").rename(written / "elsewhere")
    elif missing == "scene_gt.json":
        (scene / missing).unlink()
    back = read_one(written)
    assert len(back.frames) == 2
    assert back.objects == ()
    assert all(frame.instance_ids is None for frame in back.frames)
    assert any(text.startswith(note) for text in back.notes)


def test_what_has_a_category_but_no_mesh_keeps_its_masks(tiny_scene: Scene, written: Path) -> None:
    make_foreign(written)
    (written / "models" / "obj_000001.ply").unlink()
    back = read_one(written)
    assert [item.name for item in back.objects] == ["obj_000002"]
    assert (back.objects[0].instance_id, back.bare) == (2, {1: "mug"})
    assert back.categories == {1: "mug", 2: "can"}
    assert back.notes == ("object 1 is not scored: obj_000001.ply is missing",)
    for got, put in zip(back.frames, tiny_scene.frames, strict=True):
        np.testing.assert_array_equal(ids(got), ids(put))


def test_masks_of_one_category_need_no_truth(tiny_scene: Scene, written: Path) -> None:
    scene = make_foreign(written)
    (scene / "scene_gt.json").unlink()
    edit(written / "models" / "models_info.json", lambda t: t["2"].update(category="mug"))
    back = read_one(written)
    assert (back.objects, back.bare) == ((), {1: "mug", 2: "mug"})
    assert back.notes == ("there is no scene_gt.json: nothing to score against",)
    for got, put in zip(back.frames, tiny_scene.frames, strict=True):
        np.testing.assert_array_equal(ids(got), ids(put))
    (scene / "mask_visib").rename(scene / "elsewhere")
    assert all(frame.instance_ids is None for frame in read_one(written).frames)


def test_a_category_can_be_given_to_what_has_none(written: Path) -> None:
    make_foreign(written, categories=False)
    (back,) = open_bop(written, category="bowl")
    assert [item.category for item in back.objects] == ["bowl", "bowl"]
    with pytest.raises(BopError, match="category is 'cup'; choose one of bottle, bowl"):
        open_bop(written, category="cup")


def test_without_masks_the_objects_are_known_but_not_their_pixels(written: Path) -> None:
    scene = make_foreign(written)
    (scene / "mask_visib").rename(scene / "elsewhere")
    back = read_one(written)
    assert len(back.objects) == 2
    assert all(frame.instance_ids is None for frame in back.frames)
    assert back.notes == (
        "there is no folder mask_visib: which pixels are an object's is not known",
    )


def test_one_object_of_unknown_category_becomes_background(written: Path) -> None:
    make_foreign(written)
    edit(written / "models" / "models_info.json", lambda t: t["1"].update(category="duck"))
    back = read_one(written)
    assert [item.category for item in back.objects] == ["can"]
    assert set(np.unique(ids(back.frames[1]))) == {0, 1}
    assert not ids(back.frames[1])[2:3, 2:4].any()


def test_without_world_poses_each_image_is_a_scene(written: Path) -> None:
    scene = make_foreign(written)

    def strip(table: dict[str, Any]) -> None:
        for entry in table.values():
            del entry["cam_R_w2c"], entry["cam_t_w2c"]

    edit(scene / "scene_camera.json", strip)
    scenes = list(read_bop(written))
    assert [item.name for item in scenes] == ["000000-000000", "000000-000001"]
    for item in scenes:
        assert len(item.frames) == 1
        np.testing.assert_array_equal(item.frames[0].world_from_camera, np.eye(4))
        assert item.notes[0].startswith("no camera pose in the world")
        # The objects stand before the camera.
        assert (item.objects[0].world_from_object[2, 3]) > 0.3


def test_grey_jpeg_and_other_depth_scales(tiny_scene: Scene, written: Path) -> None:
    scene = make_foreign(written)
    (scene / "rgb").rename(scene / "gray")
    for path in (scene / "gray").iterdir():
        Image.open(path).convert("L").save(path.with_suffix(".jpg"))
        path.unlink()
    edit(scene / "scene_camera.json", lambda t: t["0"].update(depth_scale=1.0))
    frames = read_one(written).frames
    assert frames[0].rgb.shape == (6, 8, 3)
    np.testing.assert_array_equal(frames[0].rgb[..., 0], frames[0].rgb[..., 2])
    np.testing.assert_allclose(frames[0].depth_m, 10 * tiny_scene.frames[0].depth_m, rtol=1e-6)


def test_an_image_without_depth_is_left_out_and_said(written: Path) -> None:
    scene = make_foreign(written)
    Image.fromarray(np.zeros((6, 8), dtype=np.uint16)).save(scene / "depth" / "000000.png")
    back = read_one(written)
    assert len(back.frames) == 1
    assert "image 0 is left out: it has no depth at all" in back.notes
    Image.fromarray(np.zeros((6, 8), dtype=np.uint16)).save(scene / "depth" / "000001.png")
    with pytest.raises(BopError, match=r"000000/depth: no image of scene 000000 holds any depth"):
        read_one(written)


def test_a_split_can_be_named_or_opened_itself(tiny_scene: Scene, written: Path) -> None:
    assert open_bop(written / "test").read_scene(0)[0].digest() == tiny_scene.digest()
    (written / "test").rename(written / "train_pbr")
    assert open_bop(written).folder.name == "train_pbr"
    (written / "val" / "000003").mkdir(parents=True)
    (written / "val" / "000003" / "scene_camera.json").write_text("{}")
    with pytest.raises(BopError, match="split is None; choose one of train_pbr, val"):
        open_bop(written)
    with pytest.raises(BopError, match="split is 'test'; choose one of train_pbr, val"):
        open_bop(written, split="test")
    assert open_bop(written, split="val").scene_ids == (3,)
    with pytest.raises(BopError, match=r"scene_camera\.json: lists no image"):
        open_bop(written, split="val").read_scene(3)


# --- broken and hostile data ---


def test_a_scene_without_its_cameras_is_listed(written: Path) -> None:
    scenes = written / "test"
    for name in ("000002", "2", "notes", "1" * 200):
        (scenes / name).mkdir()
    (scenes / "000004").write_text("a file")
    dataset = open_bop(written)
    assert dataset.scene_ids == (0, 2)
    expected = r"000002/scene_camera\.json: cannot be read \(No such file or directory\)"
    with pytest.raises(BopError, match=expected):
        dataset.read_scene(2)
    (scenes / "000000" / "scene_camera.json").unlink()
    with pytest.raises(BopError, match="holds no scene"):
        open_bop(written)


def test_folders_that_are_no_dataset(tmp_path: Path) -> None:
    with pytest.raises(BopError, match="is not a folder; name the root of a BOP dataset"):
        open_bop(tmp_path / "nowhere")
    with pytest.raises(
        BopError, match=r"holds no scene, that is no SPLIT/000000/scene_camera\.json"
    ):
        open_bop(tmp_path)


def test_a_scene_that_is_not_there(written: Path) -> None:
    with pytest.raises(BopError, match=r"000005: is missing; the split has 1 scenes, 0 to 0"):
        open_bop(written).read_scene(5)


@pytest.mark.parametrize("name", ["scene_camera.json", "scene_gt.json", "scene_source.json"])
@pytest.mark.parametrize("content", [b'{"0": {', b"\xff\xfe", b"[1, 2]", b"[" * 100_000])
def test_broken_json_names_the_file(written: Path, name: str, content: bytes) -> None:
    path = written / "test" / "000000" / name
    path.write_bytes(content)
    with pytest.raises(BopError, match=rf"{name}: (is not valid JSON|holds a list)"):
        read_one(written)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t["0"].update(depth_scale=-0.1), r"image 0: depth_scale is -0\.1"),
        (
            lambda t: t["0"].update(depth_scale=float("nan")),
            "image 0: depth_scale is nan; it must be",
        ),
        (lambda t: t["0"].update(depth_scale=10**400), "image 0: depth_scale is 1000"),
        (lambda t: t["0"].update(depth_scale=1e6), r"image 0: depth_scale is 1000000\.0"),
        (lambda t: t["0"].pop("depth_scale"), "image 0: depth_scale is missing"),
        (lambda t: t["0"].pop("cam_K"), "image 0: cam_K is missing"),
        (lambda t: t["0"]["cam_K"].pop(), "image 0: cam_K is .* must hold 9 finite numbers"),
        (lambda t: t["1"]["cam_K"].__setitem__(0, 0.0), "image 1: cam_K has focal lengths 0.0"),
        (lambda t: t["1"]["cam_K"].__setitem__(1, 2.0), "image 1: cam_K is .* it must be fx 0 cx"),
        (
            lambda t: t["0"]["world_from_camera"].__setitem__(0, 5),
            "world_from_camera is no rotation",
        ),
        (lambda t: t["0"]["world_from_camera"].__setitem__(15, 2), "its last row is 0 0 0 1"),
        (lambda t: t["0"].update(joint_positions_rad="up"), "joint_positions_rad is 'up'"),
        (lambda t: t.update({"0": 3}), "image 0 is 3; it must be a table"),
        (lambda t: t.update({"-1": {}}), "'-1' is no id"),
        (lambda t: t.update({"../../x": {}}), "'../../x' is no id"),
        (lambda t: t.update({"9" * 5000: {}}), "is no id; keys are whole numbers of 1 to 9 digits"),
        (lambda t: t.update({"999999999": t["0"]}), r"rgb/999999999\.png: is missing"),
    ],
)
def test_hostile_cameras_name_file_and_key(
    written: Path, change: Callable[[Any], object], message: str
) -> None:
    edit(written / "test" / "000000" / "scene_camera.json", change)
    with pytest.raises(BopError, match=message) as caught:
        read_one(written)
    assert str(written) in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda e: e.update(cam_R_m2c=[2, 0, 0, 0, 1, 0, 0, 0, 1]), "cam_R_m2c is no rotation"),
        (lambda e: e.update(cam_R_m2c=[1, 0, 0, 0, 1, 0, 0, 0, -1]), r"determinant -1\)"),
        (lambda e: e.update(cam_t_m2c=[0, 0, float("inf")]), "cam_t_m2c is .* 3 finite numbers"),
        (lambda e: e.update(obj_id=-1), "obj_id is -1; it must be a whole number from 0"),
        (lambda e: e.update(obj_id=True), "obj_id is True"),
        (lambda e: e.update(obj_id="1"), "obj_id is '1'"),
        (lambda e: e.update(instance_id=2), "instance_id is 2; ids count from 1, each once"),
        (lambda e: e.update(instance_id=0), "instance_id is 0; ids count from 1"),
        (lambda e: e.update(instance_id=70000), "instance_id is 70000"),
    ],
)
def test_hostile_poses_name_file_image_and_object(
    written: Path, change: Callable[[Any], object], message: str
) -> None:
    edit(
        written / "test" / "000000" / "scene_gt.json",
        lambda t: (t["1"].reverse(), change(t["1"][1])),
    )
    with pytest.raises(BopError, match=rf"scene_gt\.json: image 1, object 1.*{message}"):
        read_one(written)


def test_some_images_with_and_some_without_a_world_pose(written: Path) -> None:
    scene = make_foreign(written)

    def strip(table: dict[str, Any]) -> None:
        del table["1"]["cam_R_w2c"], table["1"]["cam_t_w2c"]

    edit(scene / "scene_camera.json", strip)
    with pytest.raises(BopError, match="image 1 has no cam_R_w2c and cam_t_w2c while others have"):
        read_one(written)
    edit(scene / "scene_camera.json", lambda t: t["0"].pop("cam_t_w2c"))
    with pytest.raises(BopError, match="image 0: cam_t_w2c is missing"):
        read_one(written)


@pytest.mark.parametrize("name", ["rgb/000001", "depth/000001", "mask_visib/000001_000000"])
def test_missing_and_truncated_images_are_named(written: Path, name: str) -> None:
    path = written / "test" / "000000" / f"{name}.png"
    whole = path.read_bytes()
    for part in (whole[: len(whole) // 2], whole[:20], b"", b"not a picture"):
        path.write_bytes(part)
        with pytest.raises(BopError, match=rf"{name}\.png: is not a readable image"):
            read_one(written)
    path.unlink()
    with pytest.raises(BopError, match=rf"{name}\.png: is missing"):
        read_one(written)


@pytest.mark.parametrize("name", ["depth/000000", "mask_visib/000000_000001"])
def test_sizes_must_agree(written: Path, name: str) -> None:
    path = written / "test" / "000000" / f"{name}.png"
    kind = np.uint16 if "depth" in name else np.uint8
    Image.fromarray(np.ones((5, 8), dtype=kind)).save(path)
    with pytest.raises(BopError, match=rf"{name}\.png: is 8 x 5 pixels; its colour image is 8 x 6"):
        read_one(written)


def test_depth_of_8_bits_is_refused(written: Path) -> None:
    path = written / "test" / "000000" / "depth" / "000000.png"
    Image.fromarray(np.ones((6, 8), dtype=np.uint8)).save(path)
    with pytest.raises(BopError, match=r"000000\.png: has mode L; depth images hold 16 bits"):
        read_one(written)


@pytest.mark.parametrize(
    "content", [b"", b"ply\nformat ascii 1.0\nelement vertex 3\n", b"\x00" * 50]
)
def test_a_broken_model_is_named(written: Path, content: bytes) -> None:
    (written / "models" / "obj_000002.ply").write_bytes(content)
    with pytest.raises(BopError, match=r"obj_000002\.ply: (is not a readable PLY|has no faces)"):
        read_one(written)


def test_a_spec_of_another_version_is_named(written: Path) -> None:
    path = written / "test" / "000000" / "scene_source.json"
    edit(path, lambda t: t["spec"].update(lens="fisheye"))
    with pytest.raises(BopError, match=r"scene_source\.json: spec .* has no setting 'lens'"):
        read_one(written)
    edit(path, lambda t: t.update(seed="seven"))
    with pytest.raises(BopError, match=r"scene_source\.json: seed must be a whole number"):
        read_one(written)


def test_intrinsics_survive(written: Path) -> None:
    assert read_one(written).frames[0].intrinsics == Intrinsics(8, 6, 10.1, 10.2, 3.5, 2.5)
