"""Calibration of small recorded runs: what is read from them, and what becomes of it."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rich.console import Console

from harness.calibration import (
    BASELINES,
    METRICS,
    PROBABILITY_METRICS,
    RANKING_METRICS,
    SERIES,
    Calibration,
    scene_points,
    summarise_run,
)
from harness.calibration.output import as_csv, as_json
from harness.calibration.series import seed_scores
from harness.calibration.text import render_calibration
from harness.cli_calibration import LEAST_WIDTH
from harness.native import binary_metrics
from harness.recordings.make import missed_answers
from harness.tests.fake_calibration import SEGMENTER_SCORE, answers, recorded_run, recording

if TYPE_CHECKING:
    from pathlib import Path

    from harness.recordings.recording import ModelAnswers
    from harness.runs.directory import RunDirectory

CONFIDENCE = [0.9, 0.8, 0.6, 0.4, 0.2, 0.7]
VARIANCE = [0.2, 0.5, 0.3, 0.4, 0.3, 0.1]
TRUTH = [True, True, False, False, True, True]


def of_metric(category: str = "mug") -> ModelAnswers:
    return answers(category=category, confidence=CONFIDENCE, variance=VARIANCE)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    """Six mugs in seven scenes, of which the last was missed; a bowl. Two models."""
    scenes = [
        recording(
            f"mug-{index:04d}",
            object_name=f"mug_{index % 6}",
            truth=np.roll(TRUTH, index).tolist(),
            models={
                "metric": of_metric(),
                "network": answers(category="mug", confidence=CONFIDENCE),
            },
            box=4,
        )
        for index in range(6)
    ]
    never = missed_answers(4)
    scenes.append(
        recording(
            "mug-0006",
            object_name="mug_0",
            truth=TRUTH[:4],
            models={"metric": never, "network": never},
            missed=True,
        )
    )
    both = {"metric": of_metric("bowl"), "network": answers(category="bowl", confidence=CONFIDENCE)}
    scenes.append(
        recording("bowl-0000", object_name="bowl_0", truth=TRUTH, models=both, category="bowl")
    )
    return recorded_run(tmp_path_factory.mktemp("runs") / "run", scenes)


@pytest.fixture(scope="module")
def found(run: RunDirectory) -> Calibration:
    return summarise_run(run)


def test_a_decision_is_as_sure_as_the_records_have_it() -> None:
    item = recording("mug-0", object_name="m", truth=TRUTH, models={"metric": of_metric()})
    points = scene_points(item, completion="none", model="metric", tolerance_m=0.005)
    assert_array_equal(points.predicted, [True, True, True, False, False, True])
    assert_array_equal(points.truth, TRUTH)
    assert_allclose(points.of_decision["confidence"], [0.9, 0.8, 0.6, 0.6, 0.8, 0.7])
    assert_allclose(points.on_object["confidence"], CONFIDENCE)
    assert_allclose(points.on_object["probability"], 0.9 * np.array(CONFIDENCE))
    # Ranked by closeness to the data; in random order all are tied.
    assert_allclose(points.of_decision["nearest"], -np.arange(6) / 1000)
    assert not points.of_decision["random"].any()
    # The score is of the decision: off the object, 1 - s is what it says of the object.
    normalised = SEGMENTER_SCORE * np.array([0.75, 0.0, 0.5, 0.25, 0.5, 1.0])
    assert_allclose(points.of_decision["normalised_score"], normalised)
    off = [3, 4]
    expected = normalised.copy()
    expected[off] = 1 - normalised[off]
    assert_allclose(points.on_object["normalised_score"], expected)
    assert_allclose(points.of_decision["raw_score"], (1 - np.array(VARIANCE)) / 0.9)


def test_the_truth_follows_the_tolerance() -> None:
    item = recording("mug-0", object_name="m", truth=TRUTH, models={"metric": of_metric()})
    for tolerance_m, truth in ((0.0005, [False] * 6), (0.005, TRUTH), (0.01, [True] * 6)):
        points = scene_points(item, completion="none", model="metric", tolerance_m=tolerance_m)
        assert_array_equal(points.truth, truth)


def test_the_normalised_score_is_the_raw_one_stretched() -> None:
    scores = seed_scores(of_metric())
    raw = scores["raw_score"]
    assert raw.max() == 1.0
    stretched = (raw - raw.min()) / (raw.max() - raw.min())
    assert_allclose(SEGMENTER_SCORE * stretched, scores["normalised_score"])


def test_the_raw_score_as_it_is_written() -> None:
    def raw(*variance: float) -> list[float]:
        of = answers(category="mug", confidence=[0.5] * len(variance), variance=variance)
        return [float(value) for value in seed_scores(of)["raw_score"]]

    # A variance over 1 is scored below 0; one whose least is over 1 has its order turned around.
    assert raw(0.5, 2.0) == [1.0, -2.0]
    assert raw(2.0, 3.0) == [1.0, 2.0]
    # Undefined where the least is 1; a model without a variance has no score at all.
    assert "raw_score" not in seed_scores(
        answers(category="mug", confidence=[0.5] * 2, variance=[1.0, 2.0])
    )
    assert seed_scores(answers(category="mug", confidence=CONFIDENCE)) == {}


def test_a_cell_for_each_class_set_and_model(found: Calibration) -> None:
    assert [(cell.category, cell.completion, cell.model) for cell in found.cells] == [
        ("mug", "none", "metric"),
        ("mug", "none", "network"),
        ("mug", "cloud", "metric"),
        ("mug", "cloud", "network"),
        ("bowl", "none", "metric"),
        ("bowl", "none", "network"),
    ]
    box, completed = (
        found.cell("mug", completion=name, model="metric") for name in ("none", "cloud")
    )
    assert box is not None
    assert completed is not None
    # The missed target has no completion.
    assert (len(box.scenes), box.objects, box.points) == (7, 6, 28)
    assert (len(completed.scenes), completed.objects, completed.points) == (6, 6, 12)
    assert found.cell("bowl", completion="cloud", model="metric") is None
    assert found.tolerance_m == 0.005
    for cell in found.cells:
        assert tuple(cell.series) == tuple(SERIES)
        for name, series in cell.series.items():
            assert tuple(series.metrics) == (RANKING_METRICS if name in BASELINES else METRICS)


def test_means_over_scenes_and_over_points(found: Calibration) -> None:
    cell = found.cell("mug", completion="none", model="metric")
    assert cell is not None
    confidence = np.array(CONFIDENCE[:4])
    truths = [np.roll(TRUTH, index)[:4] for index in range(6)]
    briers = [np.mean((confidence - truth) ** 2) for truth in truths]
    series = cell.series["recalibrated"]
    # The missed target is not recalibrated; it counts where its confidence of 0 is judged.
    assert series.metrics["brier"].count == 6
    assert series.metrics["brier"].mean == pytest.approx(np.mean(briers))
    assert series.metrics["brier"].low is not None
    sure = cell.series["confidence"]
    assert sure.metrics["brier"].count == 7
    last = np.mean(np.array(TRUTH[:4], dtype=float))
    assert sure.metrics["brier"].mean == pytest.approx(np.mean([*briers, last]))
    # Scenes of equally many points: the mean over points is that over scenes for Brier, not so
    # for ECE, which the gaps of one scene can cancel in another.
    assert sure.pooled_metrics["brier"] == pytest.approx(sure.metrics["brier"].mean)
    assert sure.pooled is not None
    assert sure.pooled.counts.sum() == 28
    assert sure.pooled_metrics["ece"] == sure.pooled.calibration_error
    assert sure.pooled_equal_mass is not None
    assert sure.pooled_metrics["ece_equal_mass"] == sure.pooled_equal_mass.calibration_error
    assert sure.pooled_metrics["ece"] < (sure.metrics["ece"].mean or 0.0)


def test_it_agrees_with_the_extension_scene_by_scene(found: Calibration) -> None:
    cell = found.cell("bowl", completion="none", model="metric")
    assert cell is not None
    confidence, truth = np.array(CONFIDENCE), np.array(TRUTH)
    predicted = confidence >= 0.5
    theirs = binary_metrics(
        predicted=predicted,
        truth=truth,
        probability=confidence,
        decision_confidence=np.where(predicted, confidence, 1 - confidence),
    )
    metrics = cell.series["confidence"].metrics
    for name in ("ece", "ece_equal_mass", "brier", "nll", "aurc", "excess_aurc"):
        assert metrics[name].mean == pytest.approx(theirs[name], abs=1e-12), name
    for share in (50, 80):
        name = f"precision_at_{share}"
        assert metrics[name].mean == pytest.approx(theirs[name]), name
    assert cell.series["random"].metrics["aurc"].mean == pytest.approx(theirs["random_aurc"])


def test_brier_parts_of_means_still_add_up(found: Calibration) -> None:
    for cell in found.cells:
        for name, series in cell.series.items():
            if name in BASELINES or series.metrics["brier"].mean is None:
                continue
            means = {key: series.metrics[key].mean or 0.0 for key in PROBABILITY_METRICS}
            whole = (
                means["brier_reliability"]
                - means["brier_resolution"]
                + means["brier_uncertainty"]
                + means["brier_within_bins"]
            )
            assert means["brier"] == pytest.approx(whole)


def test_curves_end_at_the_error_rate(found: Calibration) -> None:
    for cell in found.cells:
        for series in cell.series.values():
            defined = ~np.isnan(series.risks[:, 0])
            assert series.risks.shape == (len(cell.scenes), 100)
            if defined.all():
                assert series.mean_risk[-1] == pytest.approx(cell.error_rate.mean)
                assert_allclose(series.mean_risk, series.risks.mean(axis=0))
        random = cell.series["random"]
        assert_allclose(random.risks, random.risks[:, -1:] @ np.ones((1, 100)))


def test_differences_to_the_baselines_are_paired(found: Calibration) -> None:
    cell = found.cell("mug", completion="none", model="metric")
    assert cell is not None
    sure, nearest, random = (cell.series[name] for name in ("confidence", "nearest", "random"))
    assert nearest.less_nearest is None
    assert random.less_random is None
    assert sure.less_random is not None
    assert sure.less_nearest is not None
    assert sure.less_random.scenes == 7
    mean = sure.metrics["aurc"].mean
    baseline = random.metrics["aurc"].mean
    assert mean is not None
    assert baseline is not None
    assert sure.less_random.mean == pytest.approx(mean - baseline)
    # Of a missed target there is no distance to the data.
    assert nearest.metrics["aurc"].count == sure.less_nearest.scenes == 6


def test_scores_beyond_probabilities_are_not_judged_as_such(tmp_path: Path) -> None:
    wide = answers(category="mug", confidence=CONFIDENCE, variance=[0.2, 2.0, 0.3, 0.4, 0.3, 0.1])
    item = recording("mug-0000", object_name="m", truth=TRUTH, models={"classic": wide})
    found = summarise_run(recorded_run(tmp_path / "run", [item], classes=["mug"]))
    raw = found.cells[0].series["raw_score"]
    assert raw.outside == pytest.approx(1 / 6)
    assert raw.metrics["ece"].mean is None
    assert raw.pooled is None
    assert raw.pooled_metrics == {}
    # As a ranking it is as good as the normalised one.
    normalised = found.cells[0].series["normalised_score"]
    assert raw.metrics["aurc"].mean == normalised.metrics["aurc"].mean
    assert normalised.outside == 0.0


def test_a_choice_of_models_classes_and_sets(run: RunDirectory) -> None:
    found = summarise_run(run, models=["network"], classes=["mug"], completions=["cloud"])
    assert [(cell.category, cell.completion, cell.model) for cell in found.cells] == [
        ("mug", "cloud", "network")
    ]
    loose = summarise_run(run, models=["network"], classes=["bowl"], tolerance_m=0.01)
    assert loose.tolerance_m == 0.01
    assert loose.cells[0].base_rate.mean == 1.0


def test_the_text_counts_the_scenes_of_each_mean(found: Calibration) -> None:
    """Of seven mugs one was missed: it has a confidence of 0 and no closeness to the data."""
    console = Console(width=LEAST_WIDTH)
    with console.capture() as capture:
        console.print(render_calibration(found))
    text = capture.get()
    assert "\N{HORIZONTAL ELLIPSIS}" not in text
    ranking = text[text.index("as a ranking") :].partition("network")[0]
    header, *lines = [line.split() for line in ranking.splitlines()]
    assert " ".join(header[3:]) == "AURC excess less nearest n P@20 % P@50 % P@80 % n"
    counts = {line[0]: (line[-5], line[-1]) for line in lines if len(line) > 5}
    # Nothing is put on a missed object, so that no precision is defined.
    assert counts["confidence"] == counts["probability"] == counts["random"] == ("7", "6")
    assert counts["recalibrated"] == counts["nearest"] == counts["raw"] == ("6", "6")
    assert "Means of unlike n are of unlike scenes" in " ".join(text.split())


def test_json_and_csv_hold_the_same_numbers(found: Calibration) -> None:
    plain = json.loads(json.dumps(as_json(found), allow_nan=False))
    lines = list(csv.DictReader(io.StringIO(as_csv(found))))
    cell, series = plain["cells"][0], plain["cells"][0]["series"]["confidence"]
    assert (cell["category"], cell["completion"], cell["model"]) == ("mug", "none", "metric")
    of_series = [
        line
        for line in lines
        if (line["category"], line["completion"], line["model"], line["series"])
        == ("mug", "none", "metric", "confidence")
    ]
    by_name = {(line["metric"], line["over"]): line for line in of_series}
    for name, estimate in series["metrics"].items():
        assert float(by_name[name, "scenes"]["value"]) == estimate["mean"]
        assert float(by_name[name, "scenes"]["low"]) == estimate["low"]
    for name, value in series["pooled_metrics"].items():
        assert float(by_name[name, "points"]["value"]) == value
    difference = by_name["aurc_less_nearest", "scenes"]
    assert float(difference["value"]) == series["aurc_less_nearest"]["mean"]
    assert len(series["mean_risk"]) == len(plain["coverages"]) == 100
    assert None in series["pooled"]["observed"]
    # The network has no score: its values are empty, not 0.
    network = [line for line in lines if line["model"] == "network"]
    raw = next(line for line in network if line["series"] == "raw_score")
    assert raw["value"] == ""
