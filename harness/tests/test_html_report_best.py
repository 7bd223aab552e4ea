"""Means of the report that are over unlike scenes: which is best, and what the page says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness.calibration import summarise_run
from harness.html_report.best import best_model
from harness.html_report.curves import curve_data
from harness.html_report.verdict import HEADLINE
from harness.recordings.make import missed_answers
from harness.runs.records import Record
from harness.tests import fake_html_report as fake
from harness.tests.fake_calibration import answers, recorded_run, recording

if TYPE_CHECKING:
    from pathlib import Path


def cell_of(**of_models: list[float | None]) -> list[Record]:
    """Records of a cell by model: the precision in each scene, as AUROC too."""
    return [
        fake.record(
            fake.job("mug", index), model=model, completion="none", precision=value, auroc=value
        )
        for model, values in of_models.items()
        for index, value in enumerate(values)
    ]


def test_the_best_model_is_best_on_common_scenes() -> None:
    precision, auroc, *_ = HEADLINE
    # By its own scenes the classic model has a mean of .9: it puts a point on the object in one.
    records = cell_of(metric=[0.6, 0.7, 0.8], classic_tuned=[None, None, 0.9])
    best = best_model(records, precision, seed=0)
    assert best is not None
    assert [variant.model for variant in best.variants] == ["metric"]
    assert best.value.mean == pytest.approx(0.7)
    assert best.value.count == 3
    # Without a prediction a precision is 0.
    theirs = best_model(cell_of(classic_tuned=[None, None, 0.9]), precision, seed=0)
    assert theirs is not None
    assert theirs.value.mean == pytest.approx(0.3)
    # An AUROC is undefined by the truth: the one scene of both decides.
    ranking = best_model(records, auroc, seed=0)
    assert ranking is not None
    assert [variant.model for variant in ranking.variants] == ["classic_tuned"]
    assert (ranking.value.mean, ranking.value.count) == (0.9, 1)
    # A failed scene counts for none, a model without any value has no say, and equals share.
    lost = [
        Record.failed(
            fake.job("mug", 0),
            variant=records[0].variant,
            views=1,
            tolerance_m=0.005,
            failure="no arm",
        )
    ]
    equal = cell_of(metric=[0.6, 0.7, 0.8], classic_tuned=[0.5, 0.8, 0.7])
    equal += cell_of(nearest=[None, None, None])
    tied = best_model([*lost, *equal[1:]], auroc, seed=0)
    assert tied is not None
    assert [variant.model for variant in tied.variants] == ["metric", "classic_tuned"]
    assert tied.value.count == 2
    assert best_model(cell_of(metric=[0.5, None], classic_tuned=[None, 0.5]), auroc, seed=0) is None
    assert best_model(lost, auroc, seed=0) is None


def test_curves_of_fewer_scenes_are_named(tmp_path: Path) -> None:
    sure = answers(category="mug", confidence=[0.9, 0.2], variance=[0.1, 0.4])
    scenes = [
        recording("mug-0000", object_name="a", truth=[True, False], models={"metric": sure}),
        recording(
            "mug-0001",
            object_name="b",
            truth=[True, False],
            models={"metric": missed_answers(2)},
            missed=True,
        ),
    ]
    run = recorded_run(tmp_path / "run", scenes, classes=["mug"])
    (cell,) = curve_data(summarise_run(run))["cells"]
    assert cell["about"] == (
        "2 scenes of 2 objects, 4 points; 50% of the points lie on the object. In 1 of them alone, "
        "the others undefined: raw score, normalised score, recalibrated, nearest."
    )
