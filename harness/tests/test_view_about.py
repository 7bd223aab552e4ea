"""What the text panel says of a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from harness.runs.job import SceneJob
from harness.runs.records import Record, Variant
from harness.tests.fake_view import missed, record, recording
from harness.view.about import LEGEND_HEIGHT, LEGEND_WIDTH, describe, draw_legend


def described(records: list[Record], *, note: str | None = None) -> str:
    return describe(
        recording(), records, run_name="main", model="metric", tolerance_m=0.005, note=note
    )


def test_metrics_stand_in_a_table_per_test_set() -> None:
    cloud = record(completion="cloud", precision=None, base_rate=0.25)
    assert described([record(), record(model="classic_tuned", auroc=0.125), cloud]) == (
        "# mug-0000: mug one\n\n"
        "Run main, 2 views, masks of oracle, completion cloud. The target was mapped as mug #7.\n\n"
        "Step 0 to 1: after each view. Step 2: the result, with the confidence of **metric**.\n\n"
        "## Test set box (none), within 5 mm\n\n"
        "4 points, 50.0% of them on the mesh.\n\n"
        "| model | precision | accuracy | recall | AUROC | recal. ECE | recal. Brier | AURC |\n"
        "|---|---|---|---|---|---|---|---|\n"
        "| **metric** | 0.500 | 0.500 | 0.500 | - | - | - | - |\n"
        "| classic, tuned | 0.500 | 0.500 | 0.500 | 0.125 | - | - | - |\n\n"
        "## Test set completed (cloud), within 5 mm\n\n"
        "4 points, 25.0% of them on the mesh.\n\n"
        "| model | precision | accuracy | recall | AUROC | recal. ECE | recal. Brier | AURC |\n"
        "|---|---|---|---|---|---|---|---|\n"
        "| **metric** | - | 0.500 | 0.500 | - | - | - | - |\n"
    )


def test_what_failed_is_said() -> None:
    failed = Record.failed(
        SceneJob("mug-0000", "mug", "mug one", 5),
        variant=Variant("metric", completion="cloud"),
        views=2,
        tolerance_m=0.005,
        failure="the target has no completion",
    )
    assert described([failed]).endswith(
        "## Test set completed (cloud), within 5 mm\n\nFailed: the target has no completion.\n"
    )


def test_a_missed_target_and_an_unfinished_run_are_said() -> None:
    text = describe(
        missed(), [], run_name="main", model="metric", tolerance_m=0.005, note="No metrics yet."
    )
    assert "The target was missed." in text
    assert text.endswith("No metrics yet.\n")


def test_the_legend_names_only_classes_in_view() -> None:
    legend = draw_legend(recording())
    assert legend.shape == (LEGEND_HEIGHT, LEGEND_WIDTH, 3)
    # The scale of confidences rises from left to right, as the points' colours do.
    ramp = legend[40, 20:-20] @ np.array([0.299, 0.587, 0.114])
    assert (np.diff(ramp) > -1.5).all()
    assert ramp[-1] > 3 * ramp[0]
    colours = {tuple(pixel) for pixel in legend.reshape(-1, 3).tolist()}
    bowl = (86, 180, 233)
    assert bowl not in colours
    neighbour = replace(recording().objects[0], category="bowl")
    with_bowl = draw_legend(recording(objects=(*recording().objects, neighbour)))
    assert bowl in {tuple(pixel) for pixel in with_bowl.reshape(-1, 3).tolist()}
