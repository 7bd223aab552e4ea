"""What bad input gets: an error that names the value and the remedy, and nothing half-written.

Where each case is tested, here unless another file is named:

===============================  ==================================================================
NaN, zero-size or absurd depth   ``test_a_frame_is_refused``
wrong shapes                     ``test_a_frame_is_refused``, ``test_native_arrays.py``
wrong dtypes                     ``test_native_arrays.py``
Fortran-ordered, sliced arrays   ``test_native_arrays.py``
non-rigid pose, intrinsics <= 0  ``test_a_frame_is_refused``
an empty mask                    ``test_an_empty_mask_maps_no_object``, ``test_scene_run.py``
no free points                   ``test_an_object_without_free_space``
fewer than 2 classes             ``test_fewer_than_two_classes``,
                                 ``test_a_training_set_without_the_object``
duplicate training points        ``test_duplicate_training_points_are_no_problem``
1 test point, none               ``test_one_test_point``, ``test_no_test_point``
numbers out of range             ``test_settings_of_the_classifier_are_named``,
                                 ``test_a_pipeline_configuration_is_refused...``, ``test_config.py``
missing weights                  ``test_weights_that_cannot_be_read``
test sets, runs to compare,      ``test_config.py``, ``test_results.py``, ``test_tuning_run.py``
tuning
a misspelt key                   ``test_a_misspelt_pipeline_key_gets_one_line``,
                                 ``test_config.py``, ``test_cli.py`` (every other table)
an unwritable or full folder     ``test_map_files_are_whole_or_absent``; a run's:
                                 ``test_runs_bench.py``, ``test_cli.py``; pictures':
                                 ``test_render.py``; meshes': ``test_assets.py``
Python above 3.11                ``test_cli.py``, ``test_the_package_asks_for_python_3_11``
meshes that cannot be used       ``test_cli.py``, ``test_score_oracle.py``, sim_scenes' tests
===============================  ==================================================================
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import harness
from harness import cli
from harness.native import (
    OccupancyMap,
    Pipeline,
    Predictions,
    TrainingSet,
    check_pipeline_config,
    gp_log_likelihood,
)
from harness.tests.support import HEIGHT, LOOKING_DOWN, WIDTH, frame, full_disk

if TYPE_CHECKING:
    from collections.abc import Callable

MUG = 6


def mapped(**settings: Any) -> Pipeline:
    pipeline = Pipeline(json.dumps({"segmenter": "oracle", "training": {"points": 100} | settings}))
    assert pipeline.add_frame(**frame()) == [1]
    return pipeline


def depth(value: float, *, row: int = 0, column: int = 0) -> np.ndarray:
    image = np.full((HEIGHT, WIDTH), 0.5, dtype=np.float32)
    image[row, column] = value
    return image


def pose(*entries: tuple[int, int, float]) -> np.ndarray:
    matrix = LOOKING_DOWN.copy()
    for row, column, value in entries:
        matrix[row, column] = value
    return matrix


NO_DEPTH = np.full((HEIGHT, WIDTH), np.nan, dtype=np.float32)
NO_PIXEL = {
    "depth_m": np.zeros((0, WIDTH), dtype=np.float32),
    "rgb": np.zeros((0, WIDTH, 3), dtype=np.uint8),
    "instance_ids": np.zeros((0, WIDTH), dtype=np.uint16),
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (NO_PIXEL, "image size 64 x 0 has no pixels; both sides must be at least 1"),
        ({"depth_m": NO_DEPTH}, "depth_m has no valid pixel; drop the frame or check the sensor"),
        (
            {"depth_m": depth(0.0, row=2, column=5)},
            "depth_m is 0 at pixel (5, 2); depths are positive metres, and a pixel without a "
            "measurement is NaN",
        ),
        ({"depth_m": depth(-0.25)}, "depth_m is -0.25 at pixel (0, 0); depths are positive"),
        ({"depth_m": depth(np.inf)}, "depth_m is inf at pixel (0, 0); depths are positive"),
        ({"depth_m": np.zeros(9, np.float32)}, "depth_m has shape (9,); expected (height, width)"),
        ({"rgb": np.zeros((48, 64), np.uint8)}, "rgb has shape (48, 64); expected (48, 64, 3)"),
        ({"rgb": np.zeros((64, 48, 3), np.uint8)}, "rgb has shape (64, 48, 3); expected (48, 64"),
        (
            {"instance_ids": np.zeros((48, 63), np.uint16)},
            "instance_ids has shape (48, 63); expected (48, 64)",
        ),
        ({"world_from_camera": np.eye(3)}, "world_from_camera has shape (3, 3); expected (4, 4)"),
        (
            {"world_from_camera": pose((0, 0, 2.0))},
            "world_from_camera is not a rigid transform: its rotation is off orthonormal by "
            "3.00e0; pass a 4x4 row-major matrix of a rotation and a translation in metres",
        ),
        ({"world_from_camera": pose((0, 0, -1.0))}, "rotation mirrors (determinant -1); pass a"),
        ({"world_from_camera": pose((3, 0, 1.0))}, "its last row is [1.0, 0.0, 0.0, 1.0]; pass"),
        ({"world_from_camera": pose((0, 3, np.nan))}, "not a rigid transform: it holds NaN; pass"),
        ({"world_from_camera": pose((0, 3, 1e6))}, "the sensor at [1000000.0, 0.0, 0.0] lies out"),
        (
            {"intrinsics": (0.0, 60.0, 31.5, 23.5)},
            "intrinsics fx=0, fy=60, cx=31.5, cy=23.5 are not a camera's; focal lengths must be "
            "positive and all four finite (pixels)",
        ),
        ({"intrinsics": (60.0, -60.0, 31.5, 23.5)}, "fy=-60"),
        ({"intrinsics": (60.0, 60.0, np.nan, 23.5)}, "cx=NaN"),
        ({"categories": {1: "cup"}}, "unknown category 'cup'; choose one of bottle, bowl, camera"),
        ({"categories": {2: "mug"}}, "the mask holds instance id 1, which has no category; list"),
        ({"categories": None}, "instance id 1, which has no category; list it or set it to 0"),
        ({"categories": {0: "mug"}}, "categories has the key 0; instance ids are whole numbers fr"),
        ({"categories": {-1: "mug"}}, "the key -1; instance ids are whole numbers from 1 to 65535"),
        ({"categories": {"a": "mug"}}, "categories has the key 'a'; instance ids are whole number"),
        (
            {"instance_ids": None, "categories": None},
            'segmenter = "oracle" needs true masks: pass instance_ids and categories with the '
            "frame, or choose another segmenter",
        ),
    ],
)
def test_a_frame_is_refused_and_the_map_stays_as_it_was(
    change: dict[str, Any], message: str
) -> None:
    pipeline = mapped()
    before: tuple[np.ndarray, ...] = pipeline.occupancy().leaves()
    with pytest.raises(ValueError, match=r".") as caught:
        pipeline.add_frame(**frame(**change))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert [item.views for item in pipeline.objects()] == [1]
    after: tuple[np.ndarray, ...] = pipeline.occupancy().leaves()
    assert all(np.array_equal(old, new) for old, new in zip(before, after, strict=True))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"intrinsics": np.eye(3)},
            "intrinsics is [[1. 0. 0.] [0. 1. 0.] [0. 0. 1.]]; expected",
        ),
        (
            {"intrinsics": (60.0, 31.5, 23.5)},
            "expected the four numbers (fx, fy, cx, cy), in",
        ),
        ({"intrinsics": None}, "intrinsics is None; expected the four numbers (fx, fy, cx, cy)"),
        ({"categories": {1: 6}}, "categories[1] is 6; expected a category's name, such as 'mug'"),
        ({"depth_m": [[0.5]]}, "depth_m is of type list; expected a numpy array of float32"),
        ({"rgb": None}, "rgb is of type NoneType; expected a numpy array of uint8"),
    ],
)
def test_what_is_no_number_or_array_is_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError) as caught:
        Pipeline('{"segmenter": "oracle"}').add_frame(**frame(**change))
    assert message in str(caught.value)


def classify(pipeline: Pipeline, training: TrainingSet, points: np.ndarray) -> Predictions:
    return pipeline.classify(1, training, points, model="classic")


GP: dict[str, Any] = {
    "points": np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]),
    "labels": np.array([0, 1, 0, 1], dtype=np.uint8),
    "lengthscales": np.array([0.1, 0.1]),
    "outputscales": np.array([1.0, 1.0]),
    "means": np.array([0.0, 0.0]),
}


def test_an_empty_mask_maps_no_object() -> None:
    pipeline = Pipeline('{"segmenter": "oracle"}')
    assert pipeline.add_frame(**frame(instance_ids=np.zeros((48, 64), dtype=np.uint16))) == []
    assert pipeline.objects() == []
    assert len(pipeline.voxels().classes) > 0
    with pytest.raises(ValueError, match=r"no object 1; it was deleted or never seen \(list the"):
        pipeline.training_set(1, seed=0)


def test_a_mask_without_depth_maps_no_object() -> None:
    depth_m = frame()["depth_m"]
    depth_m[16:32, 20:44] = np.nan
    pipeline = Pipeline('{"segmenter": "oracle"}')
    assert pipeline.add_frame(**frame(depth_m=depth_m)) == [None]
    assert pipeline.objects() == []


def test_an_object_without_free_space() -> None:
    pipeline = mapped(free_margin_m=0.5)
    with pytest.raises(ValueError, match="object 1 has no free space") as caught:
        pipeline.training_set(1, seed=0)
    assert str(caught.value) == (
        "object 1 has no free space within 0.03 m of its box and at least 0.5 m away from observed "
        "points; insert views that look past it, raise training.box_padding_m or lower "
        "training.free_margin_m"
    )


@pytest.mark.parametrize("classes", [[MUG] * 3, [0] * 3, []])
def test_fewer_than_two_classes(classes: list[int]) -> None:
    training = TrainingSet(np.eye(3)[: len(classes)], np.array(classes, dtype=np.uint8))
    expected = f"a classifier of {min(len(classes), 1)} classes has nothing to decide; use at least"
    with pytest.raises(ValueError, match=expected):
        classify(mapped(), training, np.zeros((1, 3)))


def test_fewer_than_two_classes_of_the_process_alone() -> None:
    one = {name: np.ones(1) for name in ("lengthscales", "outputscales", "means")}
    with pytest.raises(ValueError, match="a classifier of 1 classes has nothing to decide; use at"):
        gp_log_likelihood(**GP | {"labels": np.zeros(4, np.uint8)} | one)
    with pytest.raises(ValueError, match="class 1 has no training point; add one, or leave the cl"):
        gp_log_likelihood(**GP | {"labels": np.zeros(4, np.uint8)})


def two_heaps(*, copies: int) -> TrainingSet:
    """A mug's points at the origin and free ones 10 cm beside, each heap one place."""
    points = np.repeat([[0.0, 0, 0], [0.1, 0, 0]], copies, axis=0)
    return TrainingSet(points, np.repeat([MUG, 0], copies).astype(np.uint8))


def test_duplicate_training_points_are_no_problem() -> None:
    test_points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.05, 0.5, 0]])
    predictions = classify(mapped(), two_heaps(copies=20), test_points)
    assert predictions.classes[:2].tolist() == [MUG, 0]
    for values in (predictions.probabilities, predictions.variance, predictions.score):
        assert np.isfinite(values).all()
    assert predictions.jitter == 0
    assert predictions.clamped_share == 0


def test_one_place_with_two_labels_is_undecided() -> None:
    training = TrainingSet(np.zeros((8, 3)), np.array([MUG, 0] * 4, dtype=np.uint8))
    predictions = classify(mapped(), training, np.zeros((1, 3)))
    assert predictions.probabilities.tolist() == [[pytest.approx(0.5, abs=1e-6)] * 2]


def test_one_test_point() -> None:
    predictions = classify(mapped(), two_heaps(copies=5), np.zeros((1, 3)))
    assert predictions.classes.tolist() == [MUG]
    # The range of one variance is zero: its score is that of the smallest.
    assert predictions.score.tolist() == [1.0]
    assert 0.5 < predictions.confidence[0] <= 1


def test_no_test_point() -> None:
    predictions = classify(mapped(), two_heaps(copies=5), np.zeros((0, 3)))
    assert predictions.probabilities.shape == (0, 2)
    for values in (predictions.classes, predictions.variance, predictions.score):
        assert values.shape == (0,)


def test_a_training_set_without_the_object() -> None:
    training = TrainingSet(two_heaps(copies=5).points_world, np.repeat([2, 0], 5).astype(np.uint8))
    with pytest.raises(ValueError, match="the object is a mug, and no training point is of that c"):
        classify(mapped(), training, np.zeros((1, 3)))


def test_only_annotating_writes_confidences_and_it_writes_all_or_none() -> None:
    pipeline = mapped()
    points = pipeline.objects()[0].points_world[:3]
    predictions = classify(pipeline, two_heaps(copies=5), points)
    assert (predictions.fits_unconverged, predictions.fits_at_bound) == (0, 0)
    assert np.isnan(pipeline.voxels().confidence).all()
    voxels = pipeline.annotate(1, points, predictions)
    assert voxels > 0
    assert np.isfinite(pipeline.voxels().confidence).sum() == voxels
    with pytest.raises(ValueError, match="confidences holds 3 values; 2 points need one each"):
        pipeline.annotate(1, points[:2], predictions)
    assert np.isfinite(pipeline.voxels().confidence).sum() == voxels
    assert pipeline.annotate(1, points + 1.0, predictions) == 0
    assert np.isnan(pipeline.voxels().confidence).all()


def test_a_fit_without_iterations_has_not_converged() -> None:
    pipeline = Pipeline(json.dumps({"segmenter": "oracle", "gp": {"fit_iterations": 0}}))
    pipeline.add_frame(**frame())
    predictions = classify(pipeline, two_heaps(copies=5), np.zeros((1, 3)))
    assert (predictions.fits_unconverged, predictions.fits_at_bound) == (2, 0)


def test_a_refused_classification_leaves_the_map_without_confidence() -> None:
    pipeline = mapped()
    with pytest.raises(ValueError, match=r"test_points\[0\] is not finite; remove such points fir"):
        classify(pipeline, two_heaps(copies=5), np.full((1, 3), np.nan))
    with pytest.raises(ValueError, match="model: unknown variant `metal`, expected one of"):
        pipeline.classify(1, two_heaps(copies=5), np.zeros((1, 3)), model="metal")
    assert np.isnan(pipeline.voxels().confidence).all()


def test_an_object_that_is_not_tracked() -> None:
    with pytest.raises(ValueError, match="no object 9; it was deleted or never seen"):
        mapped().classify(9, two_heaps(copies=5), np.zeros((1, 3)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"labels": np.array([0, 9, 0, 1], np.uint8)}, "label 9 of training point 1 is out of ran"),
        ({"labels": np.array([0, 1], np.uint8)}, "labels has 2 entries; it needs 4, one per train"),
        ({"means": np.zeros(3)}, "means has shape (3,); expected (2,)"),
        ({"lengthscales": np.array([0.1, 0.0])}, "lengthscale is 0; it must be positive and finit"),
        ({"outputscales": np.array([np.nan, 1])}, "outputscale is NaN; it must be positive and fi"),
        ({"smoothness": "7/2"}, "smoothness: unknown variant `7/2`, expected one of `1/2`, `3/2`"),
    ],
)
def test_settings_of_the_classifier_are_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        gp_log_likelihood(**GP | change)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"gp": {"modles": []}}, "unknown key gp.modles; did you mean gp.models?"),
        ({"mapp": {}}, "unknown key mapp; did you mean map?"),
        (
            {"gp": {"models": ["metal"]}},
            'gp.models is ["metal"]; expected one of `classic`, `classic_tuned`, `metric_literal`, '
            "`metric`, `network`, `nearest`",
        ),
        (
            {"gp": {"classic_tuned": {"lengthscale": 0.1}}},
            "unknown key gp.classic_tuned.lengthscale; did you mean gp.classic_tuned.lengthscale",
        ),
        (
            {"gp": {"classic_tuned": {"outputscale": 0}}},
            "gp.classic_tuned.outputscale is 0; it must be positive",
        ),
        ({"metric": {"temprature": 1}}, "key metric.temprature; did you mean metric.temperature?"),
        ({"metric": {"temperature": 0}}, "metric.temperature is 0; it must be positive"),
        (
            {"metric": {"lengthscale_m": -0.01}},
            "metric.lengthscale_m is -0.01; it must be positive",
        ),
        ({"metric": {"gate": 1}}, "metric.gate is 1; expected"),
        (
            {"metric": {"kernel_input": "xyzw"}},
            'metric.kernel_input is "xyzw"; expected `xyz` or `xyz_embedding`',
        ),
        ({"metric": {"query_weights": ""}}, "metric.query_weights is empty; name a file of weigh"),
        (
            {"recalibration": {"metric": {"slope": 0}}},
            "recalibration.metric.slope is 0; it must be positive",
        ),
        (
            {"recalibration": {"metal": {}}},
            "unknown key recalibration.metal; did you mean recalibration.met",
        ),
        (
            {"gp": {"models": ["classic"] * 2}},
            "gp.models names classic twice; list each",
        ),
        ({"gp": {"fit_iterations": -1}}, "gp.fit_iterations is -1; expected a whole number that"),
        ({"map": 5}, "map is 5; expected a table of settings"),
        ({"map": {"resolution_m": 1e-9}}, "resolution_m is 0.000000001; the edge of a voxel must"),
        ({"training": {"points": 10**10}}, "training.points is 10000000000; it must be at most"),
        ({"training": {"points": 1}}, "training.points is 1; it must be at least 2, one for each"),
        (
            {"gp": {"fit_iterations": 10**6}},
            "gp.fit_iterations is 1000000; it must be at most 10000",
        ),
        (
            {"map": {"association": "box"}},
            'map.association is "box"; expected `surface` or `centro',
        ),
        ({"map": {"association_gate_m": -1}}, "map.association_gate_m is -1; it must be positive"),
        ({"training": {"object_share": 1.0}}, "object_share is 1; it must lie strictly between 0"),
    ],
)
def test_a_pipeline_configuration_is_refused_by_check_and_maker_alike(
    settings: dict[str, Any], message: str
) -> None:
    for make in (check_pipeline_config, Pipeline):
        with pytest.raises(ValueError, match=r".") as caught:
            make(json.dumps(settings))
        assert message in str(caught.value)


@pytest.mark.parametrize("key", ["query_weights", "metric_weights"])
def test_weights_that_cannot_be_read(tmp_path: Path, key: str) -> None:
    path = tmp_path / "none.safetensors"
    with pytest.raises((ValueError, OSError), match=r"none\.safetensors"):
        Pipeline(json.dumps({"metric": {key: str(path)}}))
    path.write_bytes(b"no weights")
    with pytest.raises((ValueError, OSError), match=r"none\.safetensors"):
        Pipeline(json.dumps({"metric": {key: str(path)}}))


def test_a_misspelt_pipeline_key_gets_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "my.toml"
    path.write_text("[pipeline.training]\npionts = 3\n", encoding="utf-8")
    assert cli.main(["bench", "--config", str(path), "--out", str(tmp_path / "run")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == (
        f"harness: {path}: [pipeline] pipeline configuration: unknown key training.pionts; "
        "did you mean training.points?\n"
    )
    assert [file.name for file in tmp_path.iterdir()] == ["my.toml"]


@pytest.mark.parametrize("write", [OccupancyMap.write_bt, OccupancyMap.write_ot])
def test_map_files_are_whole_or_absent(
    write: Callable[[OccupancyMap, Path], None], tmp_path: Path
) -> None:
    occupancy = mapped().occupancy()
    path = tmp_path / "map"
    with full_disk(1000), pytest.raises(OSError, match=r"cannot write .*/map: .*has room"):
        write(occupancy, path)
    assert list(tmp_path.iterdir()) == []
    write(occupancy, path)
    whole = path.read_bytes()
    assert len(whole) > 1000
    with full_disk(1000), pytest.raises(OSError, match=r"cannot write .*/map: .*has room"):
        write(occupancy, path)
    assert [file.name for file in tmp_path.iterdir()] == ["map"]
    assert path.read_bytes() == whole
    for bad in (path / "inner", tmp_path / "none" / "map"):
        with pytest.raises(OSError, match=r"cannot write .*; check that the folder exists"):
            write(occupancy, bad)
    assert [file.name for file in tmp_path.iterdir()] == ["map"]


def test_map_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=r"cannot read .*none\.bt: No such file .*; check that"):
        OccupancyMap.read(tmp_path / "none.bt")
    path = tmp_path / "cut.ot"
    mapped().occupancy().write_ot(path)
    path.write_bytes(path.read_bytes()[:-7])
    with pytest.raises((ValueError, OSError), match=r"cut\.ot"):
        OccupancyMap.read(path)


def test_the_package_asks_for_python_3_11() -> None:
    root = Path(harness.__file__).parents[1]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == ">=3.11,<3.12"
