"""The command `segmentation-report`: its folder, its output, its refusals."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image

from harness import cli
from harness.config import Config
from harness.errors import InputError
from harness.runs import report as measuring
from harness.runs.job import SceneJob
from harness.segmentation import run as reporting, scene as segmenting, sheet
from harness.segmentation.rows import Choice
from harness.segmentation.run import SegmentationOptions, SegmentationResult, plan_both, run_report
from harness.segmentation.scene import Plan, segment_scene, true_instances
from harness.segmentation.segmenter import segmenter_json
from harness.tests.fake_scenes import MODELS
from harness.tests.fake_segmentation import (
    SCENE_FUNCTION,
    SIZE,
    TIMING_FUNCTION,
    PerturbedMasks,
    mask,
)
from harness.tests.test_completion_run import HereEngine
from sim_scenes import Frame, Intrinsics, Scene, SceneObject

if TYPE_CHECKING:
    from pathlib import Path

SETTINGS = {"weights": "embedded", "least_score": 0.5, "calibrated": True}
PIPELINE = {"segmenter": "maskrcnn", "segmentation": SETTINGS, "completer": "none"}
OPTIONS = ("--scenes", "2", "--segmenter", "maskrcnn")


def fake_frame(ids: np.ndarray) -> Frame:
    return Frame(
        rgb=np.full((*SIZE, 3), 90, dtype=np.uint8),
        depth_m=np.full(SIZE, 0.5, dtype=np.float32),
        instance_ids=ids,
        intrinsics=Intrinsics(fx=30, fy=30, cx=15.5, cy=11.5, width=SIZE[1], height=SIZE[0]),
        world_from_camera=np.eye(4),
    )


def fake_scene() -> Scene:
    ids = np.where(mask(4), np.uint16(1), np.uint16(0))
    ids[0, 0] = 2
    item = SceneObject(1, "mug_0", "mug", np.zeros((3, 3)), np.zeros((1, 3), int), np.eye(4))
    speck = SceneObject(2, "can_0", "can", np.zeros((3, 3)), np.zeros((1, 3), int), np.eye(4))
    gone = SceneObject(3, "bowl_0", "bowl", np.zeros((3, 3)), np.zeros((1, 3), int), np.eye(4))
    return Scene(frames=(fake_frame(ids),) * 2, objects=(item, speck, gone), name="fake")


@pytest.fixture(autouse=True)
def fake_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything but the planning, the summaries and the writing."""
    monkeypatch.setattr(measuring, "LocalEngine", HereEngine)
    monkeypatch.setattr(reporting, "SCENE_FUNCTION", SCENE_FUNCTION)
    monkeypatch.setattr(reporting, "TIMING_FUNCTION", TIMING_FUNCTION)
    monkeypatch.setattr(reporting, "load_objects", lambda _: MODELS)
    monkeypatch.setattr(reporting, "make_segmenter", lambda _: None)
    monkeypatch.setattr(sheet, "simulate_job", lambda job, config: fake_scene())
    monkeypatch.setattr(
        "harness.config._rust_pipeline_check", lambda text: json.dumps(PIPELINE | json.loads(text))
    )


def report(folder: Path, **options: object) -> SegmentationResult:
    given = {"scenes": 2, "out": folder / "out", "segmenters": ("maskrcnn",), **options}
    return run_report(SegmentationOptions(**given))  # type: ignore[arg-type]


def test_a_report_is_whole(tmp_path: Path) -> None:
    result = report(tmp_path, segmenters=("maskrcnn", "python:my.own", "maskrcnn"))
    folder = tmp_path / "out"
    assert sorted(path.name for path in folder.iterdir()) == [
        *("frames-maskrcnn.png", "frames-own.png", "logs", "reliability.png", "report.json")
    ]
    for path in folder.glob("*.png"):
        with Image.open(path) as picture:
            assert np.asarray(picture).std() > 0
    assert (folder / "report.json").read_text(encoding="utf-8") == result.text
    content = json.loads(result.text)
    assert content["settings"]["classes"] == ["bowl", "mug"]
    assert content["summary"]["scenes"] == {"single": 4, "cluttered": 4, "all": 8}
    assert content["summary"]["temperatures"] == {"maskrcnn": 1.5, "own": 1.5}
    # One scene of each class, single and cluttered, of two frames each.
    assert [row["frames"] for row in content["summary"]["latencies"]] == [8, 8]
    assert "workers" not in content["settings"]["config"]["run"]
    assert (result.scenes, result.failures, result.loss) == (8, {}, None)


def test_the_same_seed_gives_the_same_summary(tmp_path: Path) -> None:
    first, second = (
        json.loads(report(tmp_path / name).text)["summary"] for name in ("first", "second")
    )
    assert first == second


def test_single_and_cluttered_scenes_have_the_same_targets() -> None:
    config = Config.model_validate({"run": {"scenes": 3}})
    jobs = plan_both(config, MODELS)
    single, cluttered = jobs[:6], jobs[6:]
    assert [job.cluttered for job in jobs] == [False] * 6 + [True] * 6
    assert [job.object_name for job in single] == [job.object_name for job in cluttered]
    assert cluttered[0].scene_id == "mug-0000-cluttered"
    assert len({job.scene_id for job in jobs}) == 12


def test_the_command_prints_tables_or_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["segmentation-report", "--class", "mug", *OPTIONS]
    assert cli.main([*arguments, "--out", str(tmp_path / "a")]) == 0
    out, err = capsys.readouterr()
    assert "maskrcnn: 2 single scenes (4 frames), 2 cluttered scenes (4 frames)" in out
    assert "calibration, temperature 1.5" in out
    assert f"written to {tmp_path / 'a'}" in out
    assert err.startswith(f"report: {tmp_path / 'a'}\n1/6 mug-0000 in ")
    assert cli.main([*arguments, "--json", "--out", str(tmp_path / "b")]) == 0
    out, _ = capsys.readouterr()
    assert out == (tmp_path / "b" / "report.json").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"classes": ("spoon",)}, "--class spoon: use one of bottle, bowl, camera, can, laptop, m"),
        ({"classes": ("can",)}, "has no object of class 'can' (it holds: bowl, mug)"),
        ({"segmenters": ()}, "no --segmenter; name one, such as maskrcnn"),
        ({"scenes": 0}, "--scenes 0: should be greater than or equal to 1"),
        ({"table": -1}, "--table -1: ask for 1 scene or more, or leave it out"),
        (
            {"segmenters": ("python:a.net", "python:b.net")},
            "--segmenter python:b.net: its rows would be named 'net' as those of python:a.net",
        ),
    ],
)
def test_options_that_are_refused(tmp_path: Path, change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        report(tmp_path, **change)
    assert message in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_segmenter_that_cannot_be_made_is_refused_before_any_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: str) -> None:
        raise ValueError("weights/maskrcnn.safetensors is missing; restore it")

    monkeypatch.setattr(reporting, "make_segmenter", refuse)
    with pytest.raises(InputError, match=r"--segmenter maskrcnn: weights/maskrcnn\.safetensors is"):
        report(tmp_path)
    assert not (tmp_path / "out").exists()


def test_a_frame_s_truth_are_the_objects_in_view() -> None:
    scene = fake_scene()
    mug, can = true_instances(scene.frames[0], scene)
    assert (mug.category, mug.ignored) == ("mug", False)
    # A pixel of 768 is more than a thousandth of them; of 4 times as many it is not.
    assert (can.category, can.ignored) == ("can", False)
    ids = np.kron(scene.frames[0].instance_ids, np.ones((2, 2), dtype=np.uint16))
    ids[0, 1] = ids[1, 0] = ids[1, 1] = 0
    _, speck = true_instances(fake_frame(ids), scene)
    assert speck.ignored


def test_only_the_oracle_is_handed_the_truth(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = fake_scene()
    told: list[tuple[object, bool]] = []

    class Listening(PerturbedMasks):
        def segment(self, **frame: Any) -> list[Any]:
            told.append((frame["categories"], frame["instance_ids"] is None))
            return super().segment(**frame)

    ids = scene.frames[0].instance_ids
    assert ids is not None
    segmenter = Listening({1: "mug"}, ids, temperature=2.0)
    monkeypatch.setattr(segmenting, "make_segmenter", lambda _: segmenter)
    config = Config.model_validate({"pipeline": PIPELINE})
    job = SceneJob("mug-0000", "mug", "mug_0", 1)
    plan = Plan((Choice("oracle"), Choice("maskrcnn")))
    rows = segment_scene(scene, job=job, config=config, plan=plan)
    assert told == [(scene.categories, False), (None, True)] * 4
    assert rows.temperatures == {"oracle": 2.0, "maskrcnn": 2.0}
    assert len(rows.frames) == 2
    (found,) = rows.frames[0].found["maskrcnn"]
    assert (found.category, found.score) == ("mug", 0.6)
    assert rows.frames[0].uncalibrated.keys() == {"oracle", "maskrcnn"}


def test_the_report_asks_for_unsure_detections_too() -> None:
    config = Config.model_validate({"pipeline": PIPELINE})
    table = json.loads(segmenter_json(config, "maskrcnn_rgbd", calibrated=False))
    assert table["segmenter"] == "maskrcnn_rgbd"
    assert table["segmentation"] == SETTINGS | {"least_score": 0.05, "calibrated": False}
    assert config.pipeline == PIPELINE
