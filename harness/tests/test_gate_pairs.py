"""Runs laid side by side: what is compared, what is lost, and what is not the same scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from harness.errors import InputError
from harness.gate.pairs import Lost, Paired, pair_runs
from harness.runs.job import SceneJob
from harness.runs.records import Record, Variant
from harness.tests.fake_scenes import fake_record


def scene(index: int, *, model: str = "metric", completion: str = "none") -> Record:
    job = SceneJob(f"mug-{index:04d}", "mug", f"mug_{index}", seed=index)
    record = fake_record(job, variant=Variant(model, completion), tolerance_m=0.005)
    return replace(record, base_rate=0.4)


def lost(record: Record, why: str, *, missed: bool = False) -> Record:
    job = SceneJob(record.scene_id, record.category, record.object_name, record.seed)
    variant = Variant(record.model, record.completion, record.segmenter)
    return Record.failed(
        job, variant=variant, views=3, tolerance_m=0.005, failure=why, target_missed=missed
    )


def pair(baseline: list[Record], now: list[Record]) -> Paired:
    return pair_runs(baseline, now, names="A and B")


def row(paired: Paired, metric: str, *, test_set: str = "box") -> np.ndarray:
    (found,) = [
        item.losses
        for item in paired.rows
        if (item.metric.key, item.cell.test_set) == (metric, test_set)
    ]
    return found


def test_a_loss_is_positive_where_the_run_is_worse() -> None:
    before = [replace(scene(0), precision=0.9, aurc=0.1), replace(scene(1), precision=0.8)]
    after = [replace(scene(0), precision=0.7, aurc=0.3), replace(scene(1), precision=0.9)]
    paired = pair(before, after)
    assert paired.scene_ids.tolist() == ["mug-0000", "mug-0001"]
    assert paired.objects.tolist() == ["mug_0", "mug_1"]
    np.testing.assert_allclose(row(paired, "precision"), [0.2, -0.1])
    np.testing.assert_allclose(row(paired, "aurc"), [0.2, np.nan])


def test_no_answer_is_no_escape() -> None:
    before = [replace(scene(0), precision=0.9, ece_recalibrated=0.1, auroc=0.9)]
    after = [replace(scene(0), precision=None, ece_recalibrated=None, auroc=None)]
    paired = pair(before, after)
    np.testing.assert_allclose(row(paired, "precision"), [0.9])
    np.testing.assert_allclose(row(paired, "ece_recalibrated"), [0.9])
    # Undefined by the truth alone, which is nobody's loss.
    np.testing.assert_allclose(row(paired, "auroc"), [np.nan])
    back = pair(after, before)
    np.testing.assert_allclose(row(back, "precision"), [-0.9])


def test_points_of_another_completer_stand_beside_those_of_the_baselines() -> None:
    before = [replace(scene(0, completion="cloud"), precision=0.9, redraws=0)]
    after = [replace(scene(0, completion="centersnap"), precision=0.8, base_rate=0.9)]
    np.testing.assert_allclose(row(pair(before, after), "precision", test_set="completed"), [0.1])


def test_cells_are_judged_together_too() -> None:
    sets = [("metric", "none"), ("metric", "cloud")]
    before = [
        replace(scene(i, model=m, completion=c), precision=0.9) for i in (0, 1) for m, c in sets
    ]
    before += [replace(row, category="bowl", scene_id=f"bowl{row.scene_id[3:]}") for row in before]
    after = [
        replace(row, precision=0.8)
        if (row.category, row.completion) == ("mug", "none")
        else replace(row, precision=0.6)
        if (row.scene_id, row.completion) == ("bowl-0001", "cloud")
        else row
        for row in before
        if (row.scene_id, row.completion) != ("mug-0001", "cloud")
    ]
    paired = pair(before, after)
    by_set, over_all = (
        {row.cell.test_set: row.losses for row in family if row.metric.key == "precision"}
        for family in paired.pooled
    )
    assert paired.scene_ids.tolist() == ["bowl-0000", "bowl-0001", "mug-0000", "mug-0001"]
    np.testing.assert_allclose(by_set["box"], [0.0, 0.0, 0.1, 0.1], atol=1e-12)
    np.testing.assert_allclose(by_set["completed"], [0.0, 0.3, 0.0, np.nan], atol=1e-12)
    # A scene's mean over its test sets, as far as they are there.
    np.testing.assert_allclose(over_all["all"], [0.0, 0.15, 0.05, 0.1], atol=1e-12)


def test_one_class_and_one_test_set_have_nothing_to_be_judged_together() -> None:
    assert pair([scene(0)], [scene(0)]).pooled == []


def test_what_is_lost_is_named_once_for_each_scene() -> None:
    sets = [("metric", "none"), ("classic", "none"), ("metric", "cloud"), ("classic", "cloud")]
    before = [scene(i, model=m, completion=c) for i in range(4) for m, c in sets]
    after = []
    for record in before:
        if record.scene_id == "mug-0001" and record.completion == "cloud":
            after.append(lost(record, "no mask", missed=True))
        elif record.scene_id == "mug-0001":
            after.append(replace(record, target_missed=True))
        elif record.scene_id == "mug-0002" and record.model == "classic":
            after.append(lost(record, "not positive definite"))
        elif record.scene_id == "mug-0000" and record.completion == "cloud":
            job = SceneJob("mug-0000", "mug", "mug_0", seed=0)
            variant = Variant(record.model, record.completion)
            after.append(fake_record(job, variant=variant, tolerance_m=0.005, points=500))
        elif record.scene_id != "mug-0003":
            after.append(record)
    paired = pair(before, after)
    assert paired.lost == [
        Lost("mug-0000", "shrunk", "completed", "it has 500 test points of 1000"),
        Lost("mug-0001", "missed", "box, completed", "no mask"),
        Lost("mug-0002", "failed", "box (classic), completed (classic)", "not positive definite"),
        Lost("mug-0003", "vanished", "box, completed", "the run has no such record"),
    ]
    assert np.isfinite(row_of(paired, "metric")).tolist() == [True, True, True, False]
    assert np.isfinite(row_of(paired, "classic")).tolist() == [True, True, False, False]


def row_of(paired: Paired, model: str) -> np.ndarray:
    (found,) = [
        item.losses
        for item in paired.rows
        if (item.metric.key, item.cell.model, item.cell.test_set) == ("accuracy", model, "box")
    ]
    return found


def test_what_the_baseline_had_lost_already_is_no_loss() -> None:
    before = [lost(scene(0), "no mask", missed=True), replace(scene(1), target_missed=True)]
    assert pair(before, before).lost == []
    assert pair(before, [scene(0), scene(1)]).lost == []


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"seed": 7}, "its seed is 0 in the baseline and 7 now"),
        ({"redraws": 1}, "its redraws is 0 in the baseline and 1 now"),
        ({"object_name": "x"}, "its object name is mug_0 in the baseline and x now"),
        ({"base_rate": 0.42}, "its base rate is 0.4 in the baseline and 0.42 now"),
    ],
)
def test_a_scene_that_is_another_is_refused(change: dict[str, object], why: str) -> None:
    other = replace(scene(0), **change)  # type: ignore[arg-type]
    with pytest.raises(InputError) as refused:
        pair([scene(0)], [other])
    assert str(refused.value) == (
        f"mug-0000 is not the same scene in A and B: {why}; the simulator, its seed or its "
        "objects changed: run the benchmark again and make it the baseline with "
        "`harness baseline update --from RUN`"
    )


def test_another_machines_last_bits_do_not_make_another_scene() -> None:
    assert pair([scene(0)], [replace(scene(0), base_rate=0.401)]).lost == []
