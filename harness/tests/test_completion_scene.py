"""Small real scenes completed by functions of Python: in the report, the benchmark, and `tune`."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from harness import cli
from harness.completion.mean_shape import MeanShape
from harness.completion.rows import Completer, SceneRows
from harness.completion.scene import Plan, measure_scene, with_completer
from harness.config import Config, load_config
from harness.native import CLASS_NAMES
from harness.runs.job import SceneJob
from harness.runs.records import read_timings
from harness.scene_run import evaluate_scene, simulate_job, variants
from harness.stages.clock import StageClock
from harness.tests.fake_completer import OWN, complete_nothing
from harness.truth import SceneFailure
from harness.tuning.scenes import tuning_scenes, validation_folder

if TYPE_CHECKING:
    from pathlib import Path

    from sim_scenes import Scene

NOTHING = f"python:{complete_nothing.__module__}.complete_nothing"
SETTINGS = f"""
[run]
classes = ["mug"]
scenes = 1
[scenes]
views = 2
width = 160
height = 120
[protocol]
test_points = 60
[pipeline]
completer = "{OWN}"
segmenter = "oracle"
[pipeline.training]
points = 80
[pipeline.gp]
fit_points = 30
fit_iterations = 3
models = ["classic", "nearest"]
"""
JOB = SceneJob("mug-0000", "mug", "mug_pybullet", seed=11)
BOX = np.stack(np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0], [0.0, 1.0]), axis=-1).reshape(-1, 3)


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "own.toml"
    path.write_text(SETTINGS, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def config(settings: Path) -> Config:
    return load_config(settings)


@pytest.fixture(scope="module")
def scene(config: Config) -> Scene:
    return simulate_job(JOB, config)


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    completers = (Completer(OWN), Completer(OWN, refine=False), Completer(NOTHING))
    return Plan(
        completers=completers,
        mean_shapes={name: MeanShape(name, 0, BOX) for name in CLASS_NAMES[1:]},
        pictures=tmp_path_factory.mktemp("pictures"),
    )


@pytest.fixture(scope="module")
def rows(scene: Scene, config: Config, plan: Plan) -> SceneRows:
    return measure_scene(scene, job=JOB, config=config, plan=plan)


def test_a_scene_measures_every_completer_and_baseline(rows: SceneRows) -> None:
    own = ("complete_observed", "complete_observed, unrefined")
    clouds = [row.cloud for row in rows.clouds if row.part == "all"]
    assert clouds == [*own, "observed", "mean shape", "mirrored"]
    assert set(rows.uncompleted) == {"complete_nothing"}
    assert "object 1 has no completion" in rows.uncompleted["complete_nothing"]
    assert 0.1 < rows.unseen_share < 0.9
    scores = {(row.cloud, row.part): row.score for row in rows.clouds}
    # Half of its points are measured, half lie 5 mm behind.
    plain = scores[own[1], "all"]
    assert plain.accuracy_mm is not None
    assert 1.0 < plain.accuracy_mm < 5.0
    observed = scores["observed", "all"].accuracy_mm
    assert observed is not None
    assert observed < plain.accuracy_mm
    spread = rows.spreads[own[1]]
    assert spread.right_mm is not None
    assert 2.0 <= spread.right_mm <= 6.0


def test_handle_views_and_times_are_measured(rows: SceneRows) -> None:
    handles = {row.cloud: row for row in rows.handles}
    assert len(handles) == 2
    for row in handles.values():
        assert 0.0 <= row.seen_share <= 1.0
        assert row.distance_mm > 0
    for views in rows.views:
        assert views.views == 2
        assert views.best_mm <= views.mean_mm
    stages = {(row.cloud, row.stage) for row in rows.latencies}
    assert ("complete_observed", "complete") in stages
    assert ("complete_observed", "refine") in stages
    assert ("complete_observed, unrefined", "refine") not in stages
    assert all(row.objects == 1 and row.milliseconds > 0 for row in rows.latencies)


def test_a_scene_has_its_picture(rows: SceneRows, plan: Plan) -> None:
    with Image.open(plan.pictures / f"{rows.scene_id}.png") as picture:
        # A line for the one refined completer that completed it.
        assert picture.size == (720, 360)


def test_the_same_scene_gives_the_same_rows(
    rows: SceneRows, scene: Scene, config: Config, plan: Plan
) -> None:
    again = measure_scene(scene, job=JOB, config=config, plan=plan)
    assert replace(again, latencies=()) == replace(rows, latencies=())


def test_a_target_that_no_view_measured_fails_its_scene(
    scene: Scene, config: Config, plan: Plan
) -> None:
    blind = np.full((120, 160), np.nan, dtype=np.float32)
    frames = tuple(replace(frame, depth_m=blind) for frame in scene.frames)
    with pytest.raises(SceneFailure, match="no view measured the depth of mug_pybullet"):
        measure_scene(replace(scene, frames=frames), job=JOB, config=config, plan=plan)


# --- in the benchmark ---


def test_the_benchmark_scores_completed_points(scene: Scene, config: Config) -> None:
    result = evaluate_scene(scene, job=JOB, config=config, clock=StageClock("mug-0000"))
    assert {row.completion for row in result.records} == {"none", "complete_observed"}
    assert {row.variant for row in result.records} == set(variants(config))
    assert {row.status for row in result.records} == {"ok"}
    assert {row.test_points for row in result.records} == {60}
    stages = {timing.stage for timing in result.timings}
    assert {"complete", "refine", "fuse"} <= stages


def test_a_dataset_is_completed_with_and_without_truth(
    settings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root = tmp_path / "set"
    arguments = ["export", "--config", str(settings), "--out", str(root)]
    assert cli.main(arguments) == 0
    assert cli.main(["run", str(root), "--out", str(tmp_path / "run")]) == 0
    out, _ = capsys.readouterr()
    assert "Mug SC (complete_observed): 1 scene, 1 object" in out
    timings = read_timings(tmp_path / "run" / "timings.parquet")
    assert {"complete", "refine", "fuse"} <= {timing.stage for timing in timings}
    (root / "test" / "000000" / "scene_gt.json").unlink()
    arguments = ["run", str(root), "--category", "mug", "--out"]
    assert cli.main([*arguments, str(tmp_path / "mapped")]) == 0
    folder = tmp_path / "mapped" / "maps" / "mug-0000"
    (item,) = json.loads((folder / "map.json").read_text(encoding="utf-8"))["objects"]
    assert (item["completed"], "without_completion" in item) == ("completed_000001.ply", False)
    assert (folder / item["completed"]).read_bytes().startswith(b"ply")


def test_a_render_writes_the_cloud(settings: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["render", "--scene", "mug-0000", "--config", str(settings), "--out", str(out)]
    assert cli.main(arguments) == 0
    head = (out / "completed-1.ply").read_bytes()[:400].decode("ascii", errors="replace")
    assert head.startswith("ply\n")
    assert "spread" in head
    assert (out / "completed_front.png").exists()


def test_tune_asks_about_completed_points(config: Config, tmp_path: Path) -> None:
    folder = validation_folder(tmp_path, config=config, split="validation", count=1, seed=1)
    lost: dict[str, str] = {}
    (found,) = tuning_scenes(config, folder=folder, test_points=30, lost=lost.__setitem__)
    assert lost == {}
    assert len(found.points) == 60
    probability = found.probability(model="nearest", settings=config.pipeline)
    assert probability.shape == (60,)


def test_tune_leaves_out_what_is_not_completed(config: Config, tmp_path: Path) -> None:
    settings = config.pipeline | {"completer": NOTHING}
    folder = validation_folder(tmp_path, config=config, split="validation", count=1, seed=1)
    lost: dict[str, str] = {}
    declining = config.model_copy(update={"pipeline": settings})
    found = tuning_scenes(declining, folder=folder, test_points=30, lost=lost.__setitem__)
    assert list(found) == []
    assert list(lost) == ["mug-0000"]
    assert "object 1 has no completion" in lost["mug-0000"]


def test_named_weights_are_those_of_the_completer_that_is_named() -> None:
    completion = {"weights": "mine.safetensors", "refine": True}
    config = Config.model_validate({"pipeline": {"completer": "cloud", "completion": completion}})
    tables = {
        name: with_completer(config, Completer(name, refine=False)).pipeline
        for name in ("cloud", "centersnap", OWN)
    }
    assert [tables[name]["completer"] for name in tables] == list(tables)
    weights = [tables[name]["completion"]["weights"] for name in tables]
    assert weights == ["mine.safetensors", "embedded", "embedded"]
    assert not any(table["completion"]["refine"] for table in tables.values())
    assert config.pipeline["completion"] == completion


def test_a_completer_that_no_test_set_asks_is_not_called(scene: Scene, config: Config) -> None:
    protocol = config.protocol.model_copy(update={"test_sets": ("box",)})
    boxes = config.model_copy(update={"protocol": protocol})
    with_completed, without = (
        evaluate_scene(scene, job=JOB, config=item, clock=StageClock(JOB.scene_id))
        for item in (config, boxes)
    )
    assert "complete" in {timing.stage for timing in with_completed.timings}
    assert "complete" not in {timing.stage for timing in without.timings}
    for mine in without.records:
        theirs = next(row for row in with_completed.records if row.key() == mine.key())
        assert (mine.tp, mine.tn, mine.fp, mine.fn) == (theirs.tp, theirs.tn, theirs.fp, theirs.fn)
