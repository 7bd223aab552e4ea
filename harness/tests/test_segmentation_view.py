"""The report's numbers, on frames that can be counted by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest

from harness.segmentation.numbers import (
    ALL_CATEGORIES,
    BACKGROUND,
    CLUTTERED,
    MISSED,
    POOLED,
    SINGLE,
    Report,
)
from harness.segmentation.report import render_report, report_json
from harness.segmentation.rows import Choice, Found, FrameRow, SceneRows, TimedScene, Truth
from harness.segmentation.sheet import choose_frames
from harness.segmentation.summary import summarise
from harness.tests.fake_segmentation import found, truth

NET = Choice("net")


def scene(number: int, *frames: FrameRow, cluttered: bool = False) -> SceneRows:
    return SceneRows(
        f"mug-{number:04d}{'-cluttered' if cluttered else ''}",
        "mug",
        f"mug_{number}",
        cluttered,
        frames,
        {"net": 1.5} if any(frame.uncalibrated for frame in frames) else {},
    )


def frame(truths: list[Truth], seen: list[Found], *, before: list[Found] | None = None) -> FrameRow:
    raw = {} if before is None else {"net": tuple(before)}
    return FrameRow(tuple(truths), {"net": tuple(seen)}, raw)


def report_of(*scenes: SceneRows, timed: tuple[TimedScene, ...] = ()) -> Report:
    return summarise(scenes, timed, choices=[NET], least_score=0.5, seed=0)


SCENES = (
    # Found a pixel off; a duplicate; something on the table that only the report asks for.
    scene(
        0,
        frame([truth(4, "mug")], [found(5), found(6, score=0.6), found(20, "can", score=0.1)]),
        frame([truth(4, "mug")], [found(4, "bowl", score=0.8)]),
    ),
    # Not sure enough for the map.
    scene(1, frame([truth(4, "mug")], [found(4, score=0.4)])),
    scene(
        2,
        frame(
            [truth(0, "mug"), truth(12, "bowl"), truth(22, "can", ignored=True)],
            [found(0), found(12, "bowl"), found(22, "can")],
        ),
        cluttered=True,
    ),
)


def test_recall_and_overlap_count_what_the_map_would_take() -> None:
    report = report_of(*SCENES)
    rows = {(row.scenes, row.category): row for row in report.findings}
    single = rows[SINGLE, "mug"]
    assert (single.recall.count, single.iou.count) == (3, 1)
    assert single.recall.mean == pytest.approx(1 / 3)
    assert single.iou.mean == pytest.approx(7 / 9)
    assert rows[CLUTTERED, ALL_CATEGORIES].recall.mean == 1
    assert rows[POOLED, ALL_CATEGORIES].recall.mean == pytest.approx(3 / 5)
    assert rows[POOLED, "bowl"].recall.count == 1
    assert (POOLED, "can") not in rows
    assert report.scenes == {SINGLE: 2, CLUTTERED: 1, POOLED: 3}
    assert report.frames == {SINGLE: 3, CLUTTERED: 1, POOLED: 4}


def test_what_is_of_nothing_is_counted_per_frame() -> None:
    per_frame = {row.scenes: row.per_frame.mean for row in report_of(*SCENES).false_finds}
    # A duplicate, and a bowl that is none, in three frames.
    assert per_frame == {SINGLE: pytest.approx(2 / 3), CLUTTERED: 0, POOLED: pytest.approx(2 / 4)}


def test_the_confusion_matches_whatever_the_category() -> None:
    by_group = {row.scenes: row.counts for row in report_of(*SCENES).confusions}
    filled = {
        (true, taken): count
        for true, row in by_group[POOLED].items()
        for taken, count in row.items()
        if count
    }
    assert filled == {
        ("mug", "mug"): 2,
        ("mug", "bowl"): 1,
        ("mug", MISSED): 1,
        ("bowl", "bowl"): 1,
        (BACKGROUND, "mug"): 1,
    }


def test_precision_is_of_categories_that_have_objects() -> None:
    rows = {(row.scenes, row.category): row for row in report_of(*SCENES).precisions}
    assert [key for key in rows if key[0] == POOLED] == [
        (POOLED, name) for name in (ALL_CATEGORIES, "bowl", "mug")
    ]
    bowl, mug = rows[POOLED, "bowl"], rows[POOLED, "mug"]
    # The mug taken for a bowl comes after the bowl that is one, which it leaves at precision 1.
    assert (bowl.truths, bowl.objects) == (1, 1)
    assert bowl.ap50.mean == pytest.approx(1.0)
    # By falling score right, right, wrong (the duplicate), right: of four mugs three are found.
    assert mug.ap50.mean == pytest.approx((51 * 1 + 25 * 3 / 4) / 101)
    assert (mug.truths, mug.ap75.count, mug.ap50.low) == (4, 4, None)
    both = rows[POOLED, ALL_CATEGORIES]
    assert both.ap.mean == pytest.approx(np.mean([bowl.ap.mean, mug.ap.mean]))
    assert both.truths == 5


def test_calibration_is_stated_from_two_scores_on() -> None:
    rows = {row.least_score: row for row in report_of(*SCENES).calibrations if row.scenes == SINGLE}
    wide, narrow = rows[0.05], rows[0.5]
    assert (wide.headline, narrow.headline) == (True, False)
    # Scores .9 and .4 are right, .6, .1 and .8 wrong.
    assert (wide.detections, narrow.detections) == (5, 3)
    assert wide.share_right == pytest.approx(0.4)
    assert narrow.share_right == pytest.approx(1 / 3)
    assert wide.ece.mean == pytest.approx(np.mean([0.1, 0.6, 0.1, 0.8, 0.6]))
    assert wide.brier.mean == pytest.approx(np.mean([0.01, 0.36, 0.01, 0.64, 0.36]))
    assert all(row.calibrated for row in rows.values())
    assert sum(item.count for item in wide.bins) == 5


def test_calibration_is_stated_before_it_too() -> None:
    report = report_of(scene(0, frame([truth(4)], [found(4)], before=[found(4, score=0.99)])))
    rows = {(row.calibrated, row.least_score): row for row in report.calibrations}
    assert rows[False, 0.05].ece.mean == pytest.approx(0.01)
    assert rows[True, 0.05].ece.mean == pytest.approx(0.1)
    assert report.temperatures == {"net": 1.5}


def test_enough_objects_give_intervals_around_the_value() -> None:
    scenes = [
        scene(number, frame([truth(4, name=f"mug_{number}")], [found(5)] if number % 3 else []))
        for number in range(9)
    ]
    report = report_of(*scenes)
    row = next(row for row in report.precisions if row.category == "mug")
    assert row.ap50.low is not None
    assert row.ap50.high is not None
    assert row.ap50.mean is not None
    assert 0 < row.ap50.low < row.ap50.mean < row.ap50.high <= 1
    assert report_of(*scenes[::-1]) == report


def test_frames_of_the_sheet_are_of_different_scenes() -> None:
    report = report_of(*SCENES)
    qualities = {(row.scene_id, row.frame): row.quality for row in report.qualities}
    assert qualities["mug-0002-cluttered", 0] == 1
    assert qualities["mug-0000", 0] == pytest.approx(7 / 9 / 1.5)
    chosen = choose_frames(report.qualities)
    assert list(chosen) == ["best", "median", "worst"]
    names = [row.scene_id for row in chosen["best"]]
    assert names == ["mug-0002-cluttered", "mug-0000", "mug-0001"]
    assert chosen["worst"][-1].quality == 0
    for rows in chosen.values():
        assert len({row.scene_id for row in rows}) == 3


def test_times_are_stated_by_segmenter() -> None:
    timed = TimedScene("mug-0000", {"net": tuple(float(value) for value in range(1, 102))})
    (row,) = report_of(*SCENES, timed=(timed,)).latencies
    assert (row.frames, row.median_ms, row.p95_ms) == (101, 51, 96)


def test_the_report_is_laid_out_and_written(capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console

    report = report_of(*SCENES, timed=(TimedScene("mug-0000", {"net": (200.0,)}),))
    Console(width=172).print(render_report(report, None))
    text = capsys.readouterr().out
    assert "net: 2 single scenes (3 frames), 1 cluttered scenes (1 frames)" in text
    assert "95th percentile" in text
    (line,) = (line for line in text.splitlines() if line.startswith("background"))
    assert line.split() == ["background", "1"]
    content = json.loads(report_json(report, None, failures={"a": "b"}, settings={"seed": 0}))
    assert content["failures"] == {"a": "b"}
    assert content["table"] is None
    assert content["summary"]["confusions"][0]["counts"]["mug"]["bowl"] == 1
