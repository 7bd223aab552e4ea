"""The points of all test sets in one question, and what is said of a set that has none."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from harness.asked import gather_test_sets
from harness.drawn_points import box_test_points
from harness.runs.records import Record, SceneResult, Variant
from harness.scene_run import evaluate_scene, map_scene, simulate_job
from harness.sitting import scene_problem
from harness.stages import scene as stages
from harness.stages.clock import StageClock
from harness.stages.mapping import Mapped
from harness.tests.fake_completer import FakeCompletions, fake_completion
from harness.tests.test_scene_run import CONFIG, JOB
from harness.truth import SceneFailure
from sim_scenes import Scene, SceneObject

if TYPE_CHECKING:
    from harness.config import Config
    from harness.native import Pipeline

CORNERS = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.1]])
TARGET = SceneObject(1, "a mug", "mug", CORNERS, np.array([[0, 1, 2]]), np.eye(4))
CLOUD = np.arange(12.0).reshape(4, 3)


def gather(pipeline: FakeCompletions, *test_sets: str, count: int = 3, object_id: int = 1):  # type: ignore[no-untyped-def]
    return gather_test_sets(
        test_sets, target=TARGET, object_id=object_id, pipeline=pipeline, count=count, seed=4
    )


def test_completed_points_are_the_first_of_the_cloud_with_their_confidence() -> None:
    pipeline = FakeCompletions(completed={1: fake_completion(CLOUD, spread_m=0.005)})
    asked, missing = gather(pipeline, "box", "completed")
    assert missing == []
    box, completed = asked
    assert (box.completion, completed.completion) == ("none", "cloud")
    assert (box.part, completed.part) == (slice(0, 3), slice(3, 6))
    assert_array_equal(box.points_world, box_test_points(TARGET, count=3, seed=4))
    assert_array_equal(box.confidence, [1.0, 1.0, 1.0])
    assert_array_equal(completed.points_world, CLOUD[:3])
    # A spread of 5 mm: 1 - 1/e of Laplace's mass lies within 5 mm.
    assert completed.confidence == pytest.approx([1 - np.exp(-1)] * 3)


def test_a_small_completion_gives_all_it_has_and_the_next_set_follows() -> None:
    pipeline = FakeCompletions(completed={1: fake_completion(CLOUD)})
    asked, _ = gather(pipeline, "completed", "box", count=9)
    assert [item.part for item in asked] == [slice(0, 4), slice(4, 13)]


def test_a_set_without_completion_says_why() -> None:
    asked, (lost,) = gather(FakeCompletions(), "completed", "box")
    assert [item.part for item in asked] == [slice(0, 3)]
    assert lost.completion == "cloud"
    assert lost.reason == "object 1 has no completion: 3 of its pixels have a valid depth"


# --- in a scene ---


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate_job(JOB, CONFIG)


def completed_config(*test_sets: str, **protocol: object) -> Config:
    pipeline = {**CONFIG.pipeline, "gp": {"models": ["classic", "nearest"], "fit_points": 60}}
    changed = CONFIG.protocol.model_copy(update={"test_sets": test_sets, **protocol})
    return CONFIG.model_copy(update={"protocol": changed, "pipeline": pipeline})


def evaluate(
    scene: Scene,
    config: Config,
    monkeypatch: pytest.MonkeyPatch,
    *,
    spread_m: float | None,
) -> SceneResult:
    """Complete the target by its own vertices, or not at all without a spread."""

    def completing(scene: Scene, **__: object) -> Mapped:
        pipeline = map_scene(scene, config=config)
        (item,) = pipeline.objects()
        vertices, _ = scene.objects[0].mesh_world()
        cloud = {} if spread_m is None else {item.id: fake_completion(vertices, spread_m=spread_m)}
        fake = FakeCompletions(completed=cloud, pipeline=pipeline)
        return Mapped(cast("Pipeline", fake), None)

    monkeypatch.setattr(stages, "map_in_stages", completing)
    return evaluate_scene(scene, job=JOB, config=config, clock=StageClock(JOB.scene_id))


def of(result: SceneResult, completion: str) -> list[Record]:
    return [row for row in result.records if row.completion == completion]


def test_completed_points_are_scored_under_the_completers_name(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = completed_config("box", "completed")
    result = evaluate(scene, config, monkeypatch, spread_m=0.002)
    assert [len(of(result, name)) for name in ("none", "cloud")] == [6, 6]
    assert scene_problem(result, JOB) is None
    # The target's own vertices lie on it.
    assert {row.base_rate for row in of(result, "cloud")} == {1.0}


def test_the_completers_confidence_ranks_but_recalibrates_nothing(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    without = completed_config("box", "completed", use_spread=False)
    plain = evaluate(scene, without, monkeypatch, spread_m=0.01)
    ranked = evaluate(scene, completed_config("box", "completed"), monkeypatch, spread_m=0.01)
    for mine, other in zip(ranked.records, plain.records, strict=True):
        assert mine.ece_recalibrated == pytest.approx(other.ece_recalibrated, abs=1e-9)
        assert mine.auroc == other.auroc
        if mine.completion == "none":
            assert mine == replace(
                other,
                ece_recalibrated=mine.ece_recalibrated,
                brier_recalibrated=mine.brier_recalibrated,
                score_aurc=mine.score_aurc,
            )
    assert [row.aurc for row in of(ranked, "cloud")] != [row.aurc for row in of(plain, "cloud")]


def test_without_a_completion_the_box_survives(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = completed_config("box", "completed")
    result = evaluate(scene, config, monkeypatch, spread_m=None)
    assert scene_problem(result, JOB) is None
    assert {row.status for row in of(result, "none")} == {"ok"}
    lost = of(result, "cloud")
    assert {(row.model, row.tolerance_m) for row in lost} == {
        (row.model, row.tolerance_m) for row in of(result, "none")
    }
    assert {row.failure for row in lost} == {
        "object 1 has no completion: 3 of its pixels have a valid depth"
    }
    assert {row.variant for row in lost} == {Variant(m, "cloud") for m in ("classic", "nearest")}


def test_without_any_points_the_scene_fails(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SceneFailure, match="object 1 has no completion: 3 of its pixels have a"):
        evaluate(scene, completed_config("completed"), monkeypatch, spread_m=None)
