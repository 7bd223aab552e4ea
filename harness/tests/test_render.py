"""The pictures of a scene: whole files, in the folder that was asked for, or one line why not."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NoReturn, cast

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from PIL import Image

from harness import cli
from harness.config import load_config
from harness.errors import InputError
from harness.pictures import CLASS_COLOURS, fit_width, label
from harness.render import (
    RenderOptions,
    ScenePictures,
    colour_depth,
    depth_range,
    overlay_mask,
    render_pictures,
    run_render,
    segment_views,
    true_masks,
)
from harness.runs.atomic import DiskError
from harness.runs.job import SceneJob
from harness.scene_run import map_scene, simulate_job
from harness.surface_picture import COMPLETED_COLOUR, OBSERVED_COLOUR
from harness.tests.fake_completer import FakeCompletions, fake_completion
from harness.tests.support import full_disk
from sim_scenes import Frame, Intrinsics, Scene, SceneError, SceneObject

if TYPE_CHECKING:
    from pathlib import Path

    from harness.native import Pipeline
    from harness.segmentation.pictures import Instance

SETTINGS = (
    "[scenes]\nwidth = 160\nheight = 120\nviews = 2\n"
    '[pipeline]\ncompleter = "none"\nsegmenter = "oracle"\n'
)
NAMES = [
    "map_classes.png",
    "map_rgb.png",
    "montage.png",
    *(f"view{view}_{what}.png" for view in (0, 1) for what in ("depth", "found", "mask", "rgb")),
]


@pytest.fixture(scope="module")
def options(tmp_path_factory: pytest.TempPathFactory) -> RenderOptions:
    folder = tmp_path_factory.mktemp("render")
    (folder / "small.toml").write_text(SETTINGS, encoding="utf-8")
    return RenderOptions(scene="mug-0000", config=folder / "small.toml", out=folder / "a" / "b")


@pytest.fixture(scope="module")
def pictures(options: RenderOptions) -> ScenePictures:
    return run_render(options)


def test_the_pictures_are_whole_and_nothing_else_is_there(pictures: ScenePictures) -> None:
    assert sorted(path.name for path in pictures.folder.iterdir()) == NAMES
    assert sorted(pictures.files) == sorted(pictures.folder.iterdir())
    assert pictures.montage == pictures.folder / "montage.png"
    for path in pictures.files:
        with Image.open(path) as image:
            assert image.mode == "RGB"
            assert np.asarray(image).std() > 0
            if path.name.startswith("view"):
                assert image.size == (160, 120)


def test_the_mask_is_drawn_in_the_category_s_colour(pictures: ScenePictures) -> None:
    rgb = np.asarray(Image.open(pictures.folder / "view0_rgb.png")).astype(int)
    mask = np.asarray(Image.open(pictures.folder / "view0_mask.png")).astype(int)
    # A mug is vermilion: there red outweighs blue; elsewhere the picture is grey.
    coloured = mask[..., 0] != mask[..., 2]
    assert 100 < coloured.sum() < 160 * 120 / 2
    assert_array_equal(mask[~coloured][:, 0], rgb[~coloured].mean(axis=-1).astype(int))
    assert (mask[coloured][:, 0] > mask[coloured][:, 2]).all()


def test_drawing_again_replaces_the_files_by_the_same_bytes(
    options: RenderOptions, pictures: ScenePictures
) -> None:
    before = {path.name: path.read_bytes() for path in pictures.files}
    (pictures.folder / "mine.txt").write_text("mine", encoding="utf-8")
    again = run_render(options)
    assert {path.name: path.read_bytes() for path in again.files} == before
    (pictures.folder / "mine.txt").unlink()


def test_a_full_disk_leaves_whole_pictures_only(options: RenderOptions, tmp_path: Path) -> None:
    config = load_config(options.config)
    job = SceneJob(scene_id="mug-0000", category="mug", object_name="mug_pybullet", seed=11)
    scene = simulate_job(job, config)
    pipeline = map_scene(scene, config=config)
    instances = segment_views(scene, config=config)
    sound = render_pictures(scene, pipeline, instances=instances, folder=tmp_path / "sound")
    before = {path.name: path.read_bytes() for path in sound.files}
    sizes = sorted(map(len, before.values()))
    assert sizes[-1] == len(before["montage.png"])
    for folder, left in (("sound", NAMES), ("fresh", [n for n in NAMES if n != "montage.png"])):
        with (
            full_disk(sizes[-1] - 1),
            pytest.raises(DiskError, match=r"cannot write .*montage\.png: File too large; free or"),
        ):
            render_pictures(scene, pipeline, instances=instances, folder=tmp_path / folder)
        assert sorted(path.name for path in (tmp_path / folder).iterdir()) == left
        for name in left:
            assert (tmp_path / folder / name).read_bytes() == before[name]


def test_completed_shapes_get_two_panels_and_a_cloud_each(
    options: RenderOptions, tmp_path: Path
) -> None:
    config = load_config(options.config)
    job = SceneJob("mug-0000", "mug", "mug_pybullet", seed=11, cluttered=True)
    scene = simulate_job(job, config)
    pipeline = map_scene(scene, config=config)
    first, *others = pipeline.objects()
    vertices, _ = scene.objects[0].mesh_world()
    completing = FakeCompletions(
        completed={first.id: fake_completion(vertices[:400])}, pipeline=pipeline
    )
    pictures = render_pictures(
        scene,
        cast("Pipeline", completing),
        instances=segment_views(scene, config=config),
        folder=tmp_path,
    )
    names = [*NAMES, "completed_back.png", "completed_front.png", f"completed-{first.id}.ply"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert pictures.clouds == (tmp_path / f"completed-{first.id}.ply",)
    assert pictures.clouds[0].read_text(encoding="utf-8") == "400 points"
    assert pictures.uncompleted == {
        item.id: f"object {item.id} has no completion: 3 of its pixels have a valid depth"
        for item in others
    }
    with (
        Image.open(tmp_path / "completed_front.png") as front,
        Image.open(pictures.montage) as all_,
    ):
        colours = np.asarray(front).reshape(-1, 3)
        assert (colours == OBSERVED_COLOUR).all(axis=1).sum() > 100
        assert (colours == COMPLETED_COLOUR).all(axis=1).sum() > 100
        assert all_.size == (480, 2 * 120 + 180 + 180)


def test_what_the_segmenter_found_is_drawn_with_its_scores(
    options: RenderOptions, tmp_path: Path
) -> None:
    config = load_config(options.config)
    job = SceneJob("mug-0000", "mug", "mug_pybullet", seed=11)
    scene = simulate_job(job, config)
    pipeline = map_scene(scene, config=config)
    found = segment_views(scene, config=config)
    assert [[(item.category, item.score) for item in view] for view in found] == [
        [("mug", 1.0)]
    ] * len(scene.frames)
    for frame, (item,) in zip(scene.frames, found, strict=True):
        (mask,) = true_masks(frame, scene)
        assert_array_equal(item.mask, mask)
    render_pictures(scene, pipeline, instances=found, folder=tmp_path / "oracle")
    learned = cast("Pipeline", FakeCompletions(segmenter="net", pipeline=pipeline))
    nothing: list[list[Instance]] = [[] for _ in scene.frames]
    render_pictures(scene, learned, instances=nothing, folder=tmp_path / "net")
    with (
        Image.open(tmp_path / "oracle" / "view0_found.png") as oracle,
        Image.open(tmp_path / "net" / "view0_found.png") as net,
    ):
        vermilion = (np.asarray(oracle) == np.array(CLASS_COLOURS["mug"])).all(axis=2)
        outline = (np.asarray(net) != scene.frames[0].rgb).any(axis=2)
    assert vermilion.sum() > 100
    # A network that finds nothing has its picture hold the true outline alone.
    assert 0 < outline.sum() < found[0][0].mask.sum() / 2
    assert (np.asarray(net)[outline] == 255).all()


@pytest.mark.parametrize("inner", ["", "deep/er"])
def test_a_folder_that_cannot_be_made_gets_one_line(
    options: RenderOptions,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    inner: str,
) -> None:
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    out = file / inner if inner else file
    arguments = ["render", "--scene", "mug-0000", "--config", str(options.config)]
    assert cli.main([*arguments, "--out", str(out)]) == 2
    stdout, stderr = capsys.readouterr()
    assert stdout == ""
    assert stderr.startswith(f"harness: cannot write to {out}: ")
    assert stderr.endswith("; pass a writable --out\n")
    assert stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert file.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("scene", ["mug", "cup-1", "mug--1", "mug-x", "free-0001", ""])
def test_a_scene_that_no_run_has_is_refused(scene: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"give a class and a number, such as mug-0003 \(classes"):
        run_render(RenderOptions(scene=scene, out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_scene_that_cannot_be_drawn_is_said(
    options: RenderOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def give_up(*_: object) -> NoReturn:
        raise SceneError("no view of 20 draws is reachable; widen the arc")

    monkeypatch.setattr("harness.render.simulate_job", give_up)
    with pytest.raises(InputError, match="--scene mug-0000: no view of 20 draws is reachable; wid"):
        run_render(replace(options, out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_depth_is_bright_when_near_and_black_without_measurement() -> None:
    depth_m = np.array([[0.3, 0.5], [0.7, np.nan]], dtype=np.float32)
    picture = colour_depth(depth_m, near_m=0.3, far_m=0.7).astype(int)
    luminance = picture.sum(axis=-1)
    assert luminance[0, 0] > luminance[0, 1] > luminance[1, 0] > 0
    assert_array_equal(picture[1, 1], [0, 0, 0])
    blind = colour_depth(np.full((2, 3), np.nan, dtype=np.float32), near_m=0.0, far_m=1.0)
    assert_array_equal(blind, np.zeros((2, 3, 3)))


def test_a_scene_s_views_share_one_range_of_depths() -> None:
    ramp = np.linspace(0.5, 1.5, 101, dtype=np.float32)[None]
    halves = [ramp[:, :40], np.full((2, 2), np.nan, dtype=np.float32), ramp[:, 40:]]
    assert depth_range(halves) == pytest.approx((0.51, 1.49), abs=1e-6)
    assert depth_range(halves[1:2]) == (0.0, 1.0)


def test_instances_of_one_category_are_told_apart_by_their_outlines() -> None:
    ids = np.zeros((5, 10), dtype=np.uint16)
    ids[:, 2:6], ids[:, 6:] = 1, 2
    frame = Frame(
        rgb=np.full((5, 10, 3), 100, dtype=np.uint8),
        depth_m=np.ones((5, 10), dtype=np.float32),
        instance_ids=ids,
        intrinsics=Intrinsics(10, 5, 10.0, 10.0, 4.5, 2.0),
        world_from_camera=np.eye(4),
        joint_positions_rad=None,
    )
    corner = np.eye(4, 3)
    mugs = [
        SceneObject(
            instance_id=number,
            name=f"mug{number}",
            category="mug",
            vertices=corner,
            faces=np.array([[0, 1, 2]]),
            world_from_object=np.eye(4),
        )
        for number in (1, 2)
    ]
    row = overlay_mask(frame, Scene((frame,), tuple(mugs), "two mugs"))[2].tolist()
    # Of (213, 94, 0): 0.6 of it over 0.4 of the grey inside, 0.3 of it where the id changes.
    grey, inside, edge = [100] * 3, [167, 96, 40], [63, 28, 0]
    assert row == [grey, grey, edge, inside, inside, edge, edge, inside, inside, inside]


def test_a_label_marks_a_copy() -> None:
    image = np.full((40, 160, 3), 128, dtype=np.uint8)
    marked = label(image, "view0")
    assert (image == 128).all()
    assert (marked != 128).any()
    assert (marked[:, 120:] == 128).all()


def test_a_width_keeps_the_proportions() -> None:
    image = np.zeros((30, 40, 3), dtype=np.uint8)
    assert fit_width(image, 80).shape == (60, 80, 3)
    assert fit_width(image, 10).shape == (8, 10, 3)
