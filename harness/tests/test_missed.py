"""A target that the segmenter missed, or took for something else: answered, not lost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from harness.config import Config
from harness.runs.job import SceneJob
from harness.runs.records import SceneResult, read_records, write_records
from harness.scene_run import evaluate_scene, map_scene, simulate_job
from harness.sitting import scene_problem
from harness.stages import scene as stages
from harness.stages.clock import StageClock
from harness.stages.mapping import Mapped
from harness.table.brief import render_brief
from harness.table.flat import render_csv
from harness.table.markdown import render_markdown
from harness.table.summary import Table, summarise
from harness.tests.test_table_brief import shown
from harness.truth import SceneFailure

if TYPE_CHECKING:
    from pathlib import Path

    from harness.native import MappedObject, Pipeline
    from sim_scenes import Scene

MODELS = ["classic", "nearest"]
CONFIG = Config.model_validate(
    {
        "scenes": {"width": 160, "height": 120, "views": 1},
        "protocol": {"test_points": 200, "test_sets": ["box", "completed"]},
        "pipeline": {
            "completer": "none",
            "segmenter": "oracle",
            "training": {"points": 120},
            "gp": {"models": MODELS, "fit_points": 60},
        },
    }
)
JOB = SceneJob(scene_id="mug-0000", category="mug", object_name="mug_pybullet", seed=11)


@dataclass(frozen=True)
class Learned:
    """A pipeline whose segmenter is a network, and gives the target this category, if any."""

    pipeline: Pipeline
    category: str | None = None
    completer: str = "cloud"
    segmenter: str = "net"

    def objects(self) -> list[MappedObject]:
        return self.pipeline.objects() if self.category else []

    def completion(self, object_id: int) -> None:
        del object_id

    def uncompleted(self, object_id: int) -> str:
        return f"object {object_id} is too small"

    def __getattr__(self, name: str) -> Any:
        return getattr(self.pipeline, name)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate_job(JOB, CONFIG)


def evaluate(
    scene: Scene,
    monkeypatch: pytest.MonkeyPatch,
    *,
    category: str | None = None,
    segmenter: str = "net",
    config: Config = CONFIG,
) -> SceneResult:
    seen = scene
    if category:
        objects = (replace(scene.objects[0], category=category),)
        seen = replace(scene, objects=objects)

    def mapped(_: Scene, **__: object) -> Mapped:
        pipeline = Learned(map_scene(seen, config=config), category, segmenter=segmenter)
        return Mapped(cast("Pipeline", pipeline), None)

    monkeypatch.setattr(stages, "map_in_stages", mapped)
    return evaluate_scene(scene, job=JOB, config=config, clock=StageClock(JOB.scene_id))


def table_of(result: SceneResult) -> Table:
    return summarise(result.records, reported_tolerance_m=0.005, classes=("mug", "bowl"), seed=0)


def test_a_missed_target_is_answered_not_the_object(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = evaluate(scene, monkeypatch)
    assert scene_problem(result, JOB) is None
    boxes = [row for row in result.records if row.completion == "none"]
    assert [(row.model, row.tolerance_m) for row in boxes] == [
        (model, tolerance_m) for tolerance_m in (0.0025, 0.005, 0.01) for model in MODELS
    ]
    for row in boxes:
        assert (row.status, row.target_missed, row.segmenter) == ("ok", True, "net")
        assert (row.tp, row.fp, row.test_points) == (0, 0, 200)
        assert row.fn is not None
        assert row.base_rate is not None
        assert row.fn == round(row.base_rate * 200) > 0
        assert (row.precision, row.recall, row.f1) == (None, 0.0, 0.0)
        assert row.accuracy == pytest.approx(1 - row.base_rate)
        # Nothing is said to lie on it with any probability.
        assert row.ece == row.brier == pytest.approx(row.base_rate)
        assert row.auroc == 0.5
        assert (row.object_training_points, row.free_training_points) == (0, 0)
        assert (row.score_aurc, row.ece_recalibrated, row.gate) == (None, None, None)
    assert {row.predicted for row in result.confusion} == {"free"}


def test_what_would_be_completed_of_it_has_failed(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    records = evaluate(scene, monkeypatch).records
    completed = [row for row in records if row.completion == "cloud"]
    assert len(completed) == 6
    for row in completed:
        assert (row.status, row.target_missed) == ("failed", True)
        assert row.failure == "the map holds no object where mug_pybullet stands: it is empty"


def test_the_same_points_are_asked_about_as_if_it_were_found(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    missed, found = evaluate(scene, monkeypatch), evaluate(scene, monkeypatch, category="mug")
    rates = [
        {(row.tolerance_m, row.base_rate) for row in result.records if row.completion == "none"}
        for result in (missed, found)
    ]
    assert rates[0] == rates[1]
    assert not any(row.target_missed for row in found.records)


def test_the_oracle_misses_nothing_so_that_its_scene_fails(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SceneFailure, match="the map holds no object where mug_pybullet stands"):
        evaluate(scene, monkeypatch, segmenter="oracle")


def test_a_scene_of_completed_points_alone_fails_too(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    protocol = CONFIG.protocol.model_copy(update={"test_sets": ("completed",)})
    with pytest.raises(SceneFailure, match="the map holds no object where mug_pybullet stands"):
        evaluate(scene, monkeypatch, config=CONFIG.model_copy(update={"protocol": protocol}))


def test_a_target_taken_for_something_else_is_wrong_everywhere(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = evaluate(scene, monkeypatch, category="bowl")
    assert scene_problem(result, JOB) is None
    for row in (row for row in result.records if row.completion == "none"):
        assert (row.status, row.target_missed) == ("ok", False)
        assert (row.tp, row.fp, row.precision, row.recall) == (0, 0, None, 0.0)
        assert row.brier == pytest.approx(row.base_rate)
        # All decisions are as sure as each other: that no point is on a mug.
        assert row.aurc == pytest.approx(row.random_aurc)
        assert row.ece_recalibrated is None
    assert ("mug", "bowl") in {(row.true, row.predicted) for row in result.confusion}


def test_records_of_missed_targets_are_kept_and_counted(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    missed, found = evaluate(scene, monkeypatch), evaluate(scene, monkeypatch, category="mug")
    others = [replace(row, scene_id="mug-0001") for row in found.records]
    write_records([*missed.records, *others], tmp_path / "records.parquet")
    result = SceneResult(read_records(tmp_path / "records.parquet"))
    assert sorted(result.records, key=repr) == sorted([*missed.records, *others], key=repr)
    table = table_of(result)
    row = next(row for row in table.rows if row.variant.completion == "none")
    assert (row.scenes, row.missed, row.failed) == (2, 1, 0)
    precision, recall = row.values["precision"], row.values["recall"]
    theirs = next(r for r in others if (r.model, r.tolerance_m) == (row.variant.model, 0.005))
    assert (precision.mean, precision.count) == (theirs.precision, 1)
    assert theirs.recall is not None
    assert recall.count == 2
    assert recall.mean == pytest.approx(theirs.recall / 2)
    text = shown(render_brief(table, width=160), width=160)
    assert "Mug: 2 scenes (target missed in 1), 1 object" in text
    assert "Where the segmenter missed the target, its points are answered" in text
    assert "| 2 (1 missed) |" in render_markdown(table)
    heading, *lines = render_csv(table).splitlines()
    column = heading.split(",").index("missed")
    assert {line.split(",")[column] for line in lines} == {"0", "1"}
    assert np.isfinite(precision.mean or np.nan)
