"""What the table's rows lose: paired by scene, missed targets counted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from rich.console import Console

from harness.config import Config
from harness.runs.job import SceneJob
from harness.runs.records import Record, SceneResult, Variant
from harness.segmentation import loss as losing
from harness.segmentation.loss import Loss, PairedScene, evaluate_by_each, losses
from harness.segmentation.report import _loss
from harness.segmentation.rows import Choice
from harness.segmentation.run import plan_table
from harness.segmentation.scene import Plan
from harness.table.cells import UNDEFINED
from harness.tests.fake_scenes import MODELS
from harness.truth import SceneFailure

if TYPE_CHECKING:
    from harness.stages.clock import StageClock
    from sim_scenes import Scene

NET = Choice("net")


def record(
    number: int,
    counts: tuple[int, int, int, int],
    *,
    segmenter: str = "oracle",
    completion: str = "none",
    missed: bool = False,
    category: str = "mug",
) -> Record:
    tp, tn, fp, fn = counts
    return Record(
        scene_id=f"{category}-{number:04d}",
        category=category,
        object_name=f"{category}_{number}",
        seed=number,
        model="metric",
        completion=completion,
        segmenter=segmenter,
        views=3,
        tolerance_m=0.005,
        target_missed=missed,
        test_points=sum(counts),
        tp=tp,
        tn=tn,
        fp=fp,
        fn=fn,
        precision=tp / (tp + fp) if tp + fp else None,
        recall=tp / (tp + fn),
        f1=2 * tp / (2 * tp + fp + fn),
        accuracy=(tp + tn) / sum(counts),
    )


def lost(number: int, *, missed: bool) -> Record:
    job = SceneJob(f"mug-{number:04d}", "mug", f"mug_{number}", number)
    return Record.failed(
        job,
        variant=Variant("metric", "cloud", "net"),
        views=3,
        tolerance_m=0.005,
        failure="nothing to complete",
        target_missed=missed,
    )


def pair(number: int, ours: tuple[Record, ...] | None) -> PairedScene:
    oracle = (
        record(number, (6, 2, 2, 0)),
        record(number, (8, 0, 2, 0), completion="cloud"),
    )
    mine = {} if ours is None else {"net": ours}
    failures = {"net": "ValueError: too few points"} if ours is None else {}
    return PairedScene(f"mug-{number:04d}", oracle, mine, failures)


def loss_of(*scenes: PairedScene) -> Loss:
    return losses(scenes, choices=[Choice("oracle"), NET], failures={}, tolerance_m=0.005, seed=0)


def test_differences_are_of_scenes_that_both_define() -> None:
    scenes = [
        pair(0, (record(0, (4, 2, 4, 0)), record(0, (9, 0, 1, 0), completion="cloud"))),
        # The target was missed: the box is answered "no", and there is nothing to complete.
        pair(1, (record(1, (0, 4, 0, 6), missed=True), lost(1, missed=True))),
        # The same target was found, and its points said to be elsewhere.
        pair(2, (record(2, (0, 4, 0, 6)), lost(2, missed=False))),
        pair(3, None),
    ]
    result = loss_of(*scenes)
    completed, box = result.rows
    assert (completed.label, box.label) == ("Mug metric SC (cloud)", "Mug metric")
    assert (box.scenes, box.objects, box.missed, box.failed) == (3, 3, 1, 1)
    assert (completed.scenes, completed.missed, completed.failed) == (1, 1, 2)
    precision = box.values["precision"]
    assert (precision.oracle, precision.segmenter) == (0.75, 0.5)
    assert (precision.less.mean, precision.less.count, precision.less.low) == (-0.25, 1, None)
    assert box.values["recall"].less.mean == pytest.approx((0 - 1 - 1) / 3)
    assert completed.values["precision"].less.mean == pytest.approx(0.1)
    assert result.failures == {"mug-0003, net": "ValueError: too few points"}
    assert loss_of(*scenes[::-1]) == result


def test_five_objects_give_an_interval() -> None:
    scenes = [pair(n, (record(n, (6, 2, 2 + n % 2, 0)),)) for n in range(6)]
    precision = loss_of(*scenes).rows[1].values["precision"].less
    assert precision.low is not None
    assert precision.mean is not None
    assert precision.high is not None
    assert precision.low <= precision.mean <= precision.high <= 0


def test_a_row_that_nothing_was_scored_in_has_no_value() -> None:
    (_, box) = loss_of(pair(0, None)).rows
    precision = box.values["precision"]
    assert (precision.oracle, precision.segmenter, precision.less.mean) == (None, None, None)


def test_the_rows_are_laid_out(capsys: pytest.CaptureFixture[str]) -> None:
    result = loss_of(pair(0, (record(0, (4, 2, 4, 0)),)))
    console = Console(width=172)
    for part in _loss(result):
        console.print(part)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    box = next(line for line in lines if line[:2] == ["Mug", "metric"] and "SC" not in line)
    assert box[2:6] == ["1", "0", ".750", ".500"]
    assert box[6:8] == ["-0.250", f"[{UNDEFINED}]"]


def test_a_scene_is_evaluated_on_the_same_frames_by_each(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, job = object(), SceneJob("mug-0000", "mug", "mug_0", 0)
    asked: list[tuple[object, str]] = []

    def evaluate(scene: Scene, *, job: SceneJob, config: Config, clock: StageClock) -> SceneResult:
        segmenter = str(config.pipeline["segmenter"])
        asked.append((scene, segmenter))
        if segmenter == "python:my.broken":
            raise SceneFailure("nothing there")
        return SceneResult([record(0, (1, 1, 1, 1), segmenter=segmenter)])

    monkeypatch.setattr(losing, "simulate_job", lambda job, config: scene)
    monkeypatch.setattr(losing, "evaluate_scene", evaluate)
    config = Config.model_validate({"pipeline": {"segmenter": "maskrcnn", "segmentation": {}}})
    names = ("oracle", "maskrcnn", "python:my.broken")
    found = evaluate_by_each(job, config, Plan(tuple(map(Choice, names))))
    assert asked == [(scene, name) for name in names]
    assert [row.segmenter for row in found.oracle] == ["oracle"]
    assert found.segmenters.keys() == {"maskrcnn"}
    assert found.failures == {"broken": "SceneFailure: nothing there"}


def test_the_table_s_scenes_are_the_first_of_a_benchmark() -> None:
    config = Config.model_validate({"run": {"scenes": 9, "seed": 4}})
    jobs = plan_table(config, MODELS, classes=("bowl", "can"), scenes=2)
    assert [job.scene_id for job in jobs] == ["bowl-0000", "bowl-0001"]
    assert plan_table(config, MODELS, classes=("bowl",), scenes=0) == []
    assert plan_table(config, MODELS, classes=("can",), scenes=2) == []
