"""Recordings of a small scene: whole, damaged, and beside the fragment that vouches for them."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from harness.errors import InputError
from harness.recordings.file import decode, encode, read_recording
from harness.runs.directory import RunDirectory
from harness.scene_run import evaluate_scene, simulate_job
from harness.stages.clock import StageClock
from harness.tests.test_scene_run import CLUTTERED, CONFIG

if TYPE_CHECKING:
    from pathlib import Path

    from harness.recordings.recording import Recording
    from harness.runs.records import SceneResult
    from sim_scenes import Scene

MODELS = ["nearest", "classic"]
COMPLETING = CONFIG.model_copy(
    update={
        "pipeline": {**CONFIG.pipeline, "completer": "cloud", "gp": {"models": MODELS}},
        "protocol": CONFIG.protocol.model_copy(update={"test_sets": ("box", "completed")}),
    }
)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate_job(CLUTTERED, COMPLETING)


@pytest.fixture(scope="module")
def result(scene: Scene) -> SceneResult:
    clock = StageClock(CLUTTERED.scene_id)
    return evaluate_scene(scene, job=CLUTTERED, config=COMPLETING, clock=clock)


@pytest.fixture(scope="module")
def data(result: SceneResult) -> bytes:
    assert result.recording is not None
    return result.recording


@pytest.fixture(scope="module")
def recording(data: bytes) -> Recording:
    return decode(data)


def test_it_holds_what_the_cameras_saw(scene: Scene, recording: Recording) -> None:
    assert len(recording.views) == len(scene.frames) == 3
    for view, frame in zip(recording.views, scene.frames, strict=True):
        assert_array_equal(view.rgb, frame.rgb)
        assert_array_equal(np.isnan(view.depth_m), np.isnan(frame.depth_m))
        assert np.nanmax(np.abs(view.depth_m - frame.depth_m)) <= 0.5001e-4
        assert_array_equal(view.true_ids, frame.instance_ids)
        # Under the oracle, what was found is what is true.
        assert_array_equal(view.found > 0, view.true_ids > 0)
        assert_array_equal(view.world_from_camera, frame.world_from_camera)
        assert_array_equal(view.joint_positions_rad, frame.joint_positions_rad)
        seen = {view.detections[index - 1].category for index in np.unique(view.found) if index}
        assert seen <= {item.category for item in scene.objects}


def test_it_holds_the_truth_and_the_map(scene: Scene, recording: Recording) -> None:
    assert [item.name for item in recording.objects] == [item.name for item in scene.objects]
    vertices, faces = scene.objects[0].mesh_world()
    assert_array_equal(recording.target.vertices_world, vertices.astype(np.float32))
    assert_array_equal(recording.target.faces, faces)
    last = recording.views[-1].tracked
    assert [item.id for item in recording.tracked] == [item.id for item in last]
    cloud = recording.target_cloud
    assert cloud is not None
    assert cloud.category == "mug"
    assert len(cloud.completed_world) == len(cloud.spread_m) > 0
    voxels = recording.voxels
    assert set(voxels.first_view) == {0, 1, 2}
    assert set(voxels.object_ids) <= {0, *(item.id for item in recording.tracked)}
    # A voxel's centre lies half an edge off the grid.
    assert np.abs((voxels.centres_world / voxels.size_m - 0.5) % 1.0 - 0.5).min() > 0.49


def test_it_is_the_same_bytes_again(data: bytes, recording: Recording) -> None:
    assert encode(recording) == data


def test_an_answer_about_every_test_point(recording: Recording) -> None:
    count = len(recording.test_world)
    assert [item.completion for item in recording.test_sets] == ["none", "cloud"]
    assert recording.part("cloud").stop == count
    assert recording.part("centersnap") == slice(0, 0)
    assert list(recording.answers) == MODELS
    for answers in recording.answers.values():
        for column in fields(answers):
            assert len(getattr(answers, column.name)) == count
    assert recording.distances_m.shape == (len(recording.objects), count)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_cut_file_is_damaged(data: bytes, tmp_path: Path, share: float) -> None:
    path = tmp_path / "mug-0000.npz"
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=r"mug-0000\.npz is damaged \(.*\); delete it and resume"):
        read_recording(path)


def altered(data: bytes, **entries: object) -> bytes:
    """The file with some arrays replaced; None leaves one out."""
    with np.load(io.BytesIO(data)) as file:
        arrays = dict(file)
    for name, value in entries.items():
        arrays.pop(name)
        if value is not None:
            arrays[name] = np.asarray(value)
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def meta_with(data: bytes, **values: object) -> np.ndarray:
    with np.load(io.BytesIO(data)) as file:
        meta = json.loads(file["meta"].tobytes())
    return np.frombuffer(json.dumps(meta | values).encode(), dtype=np.uint8)


def test_hostile_content_is_refused(data: bytes) -> None:
    faces = np.full((1, 3), 10**6, dtype=np.int32)
    voxels = len(decode(data).voxels.classes)
    tracked = {"id": 1, "category": "mug", "score": 1.0, "centroid_world": [0.5]}
    for hostile, complaint in (
        (altered(data, test_world=None), "'test_world' is missing"),
        (altered(data, test_world=np.zeros((3, 3))), r"'test_world' is float64\(3, 3\)"),
        (altered(data, test_world=np.zeros((1, 3), np.float32)), r"'distances_m' is float64"),
        (altered(data, **{"objects.0.faces": faces}), "names a vertex that is not there"),
        (altered(data, **{"views.0.rgb": np.zeros(9, np.uint8)}), "UnidentifiedImageError"),
        (altered(data, meta=meta_with(data, format=99)), "format 99, this version reads"),
        (altered(data, meta=meta_with(data, views=3)), "'meta' has views = 3"),
        (altered(data, meta=meta_with(data, test_sets=[["none", "a", 3]])), "test_sets.0.1 = 'a'"),
        (altered(data, meta=meta_with(data, test_sets=[["none", 5, 3]])), "test points 5 to 3 of"),
        (altered(data, meta=meta_with(data, category="duck")), "'meta' has category = 'duck'"),
        (altered(data, meta=meta_with(data, tracked=[tracked])), "tracked.0.centroid_world = "),
        (altered(data, **{"voxels.classes": np.full(voxels, 99, np.uint8)}), "holds class 99"),
        (altered(data, meta=np.zeros(4, np.uint8)), "JSONDecodeError"),
    ):
        with pytest.raises(ValueError, match=complaint):
            decode(hostile)


def test_pickles_are_not_opened(data: bytes) -> None:
    with pytest.raises(ValueError, match="allow_pickle=False"):
        decode(altered(data, test_world=np.array([{}], dtype=object)))


def test_a_bomb_is_not_unpacked(data: bytes) -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("meta.npy", bytes(1 << 29))
    with pytest.raises(ValueError, match=r"meta\.npy claims 536870912 bytes"):
        decode(out.getvalue())


def test_a_missing_recording_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'is missing: .*`\[run\] record = "all"`'):
        read_recording(tmp_path / "mug-0000.npz")


def test_a_scene_without_its_recording_is_computed_again(
    result: SceneResult, data: bytes, tmp_path: Path
) -> None:
    (tmp_path / "scenes").mkdir()
    run = RunDirectory(tmp_path)
    run.keep(CLUTTERED, result)
    assert run.recorded() == [CLUTTERED.scene_id]
    assert encode(run.recording(CLUTTERED.scene_id)) == data
    finished, damaged = run.finished([CLUTTERED])
    assert (list(finished), damaged) == ([CLUTTERED.scene_id], {})
    path = run.recordings / f"{CLUTTERED.scene_id}.npz"
    for broken in (data[:-1], None):
        path.unlink() if broken is None else path.write_bytes(broken)
        finished, damaged = run.finished([CLUTTERED])
        assert finished == {}
        assert damaged == {CLUTTERED.scene_id: "its recording is missing or another"}
    run.keep(CLUTTERED, replace(result, recording=None))
    assert list(run.finished([CLUTTERED])[0]) == [CLUTTERED.scene_id]
