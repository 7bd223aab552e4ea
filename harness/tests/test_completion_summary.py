"""The report's numbers from rows made by hand, and how they read."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from harness.completion.metrics import CloudScore
from harness.completion.report import render_report, report_json
from harness.completion.rows import (
    CloudRow,
    Completer,
    HandleRow,
    LatencyRow,
    SceneRows,
    ViewsRow,
)
from harness.completion.spread import SpreadScore
from harness.completion.summary import POOLED, Report, Summary, summarise
from harness.statistics import mean_estimate

COMPLETERS = (Completer("cloud"), Completer("cloud", refine=False), Completer("python:my.own"))
CLOUDS = ("cloud", "cloud, unrefined", "own", "observed", "mean shape", "mirrored")
CHAMFER = dict(zip(CLOUDS, (3.0, 3.5, 4.0, 9.0, 5.0, 6.0), strict=True))


def score(chamfer_mm: float | None) -> CloudScore:
    within = None if chamfer_mm is None else 1 - chamfer_mm / 10
    return CloudScore(10, chamfer_mm, chamfer_mm, chamfer_mm, within, within, within)


def scene(number: int, *, category: str = "mug", objects: int = 8) -> SceneRows:
    """A later scene is worse by a tenth; the completer keeps its lead but for one more tenth."""
    late = number / 10
    rows = []
    for name, chamfer in CHAMFER.items():
        value = chamfer + late * (2 if name == "cloud" else 1)
        rows += [
            CloudRow(name, "all", score(value)),
            CloudRow(name, "seen", score(value / 2)),
            CloudRow(name, "unseen", score(None if name == "observed" else 2 * value)),
        ]
    return SceneRows(
        scene_id=f"{category}-{number:04d}",
        category=category,
        object_name=f"{category}_{number % objects}",
        unseen_share=0.25,
        clouds=tuple(rows),
        spreads={"cloud": SpreadScore(2.0 + number, 2.5, 1.5, None, 0.75, 0.8)},
        handles=(
            HandleRow(
                "cloud", 0.05 * number, ("right", "left out")[number % 2], 4.0, 6.0, None, 2.0
            ),
        )
        if category == "mug"
        else (),
        views=(ViewsRow("cloud", 2.0, 2.5, 3.5, 3),),
        latencies=(LatencyRow("cloud", "complete", 1, 100.0 + number),),
        uncompleted={"own": "declined"} if number == 0 else {},
    )


def report(*scenes: SceneRows, classes: tuple[str, ...] = ("mug", "bowl")) -> Report:
    return summarise(scenes, classes=classes, completers=COMPLETERS, seed=0)


def find(
    summaries: tuple[Summary, ...],
    cloud: str,
    *,
    category: str = "mug",
    part: str = "all",
    less: str = "",
) -> Summary:
    (found,) = [
        item
        for item in summaries
        if (item.category, item.cloud, item.part, item.less) == (category, cloud, part, less)
    ]
    return found


@pytest.fixture(scope="module")
def whole() -> Report:
    """Six mugs, and two bowls: too few for an interval of their own."""
    return report(*map(scene, range(6)), *(scene(i, category="bowl") for i in range(2)))


def test_means_are_over_scenes_with_intervals_over_objects(whole: Report) -> None:
    mug = find(whole.clouds, "cloud")
    assert (mug.scenes, mug.objects) == (6, 6)
    expected = mean_estimate(
        np.array([3.0, 3.2, 3.4, 3.6, 3.8, 4.0]),
        objects=np.array([f"mug_{i}" for i in range(6)]),
        seed=0,
    )
    assert mug.values["chamfer_mm"].mean == pytest.approx(expected.mean)
    assert mug.values["chamfer_mm"].low == pytest.approx(expected.low)
    assert find(whole.clouds, "cloud", part="seen").values["chamfer_mm"].mean == pytest.approx(1.75)
    unseen = find(whole.clouds, "observed", part="unseen").values["chamfer_mm"]
    assert (unseen.mean, unseen.count) == (None, 0)
    assert list(whole.unseen_share) == ["mug", "bowl", POOLED]


def test_differences_are_paired_and_pooled_where_a_class_has_few_objects(whole: Report) -> None:
    for other, less in (("observed", 6.0), ("mean shape", 2.0), ("mirrored", 3.0)):
        mug = find(whole.differences, "cloud", less=other).values["chamfer_mm"]
        # A tenth of the scene's number is lost of the lead: a quarter in the mean of six.
        assert mug.mean == pytest.approx(-less + 0.25)
        assert mug.low is not None
        assert mug.low <= -less + 0.25
        bowl = find(whole.differences, "cloud", category="bowl", less=other).values["chamfer_mm"]
        assert bowl.mean == pytest.approx(-less + 0.05)
        assert bowl.low is None
        pooled = find(whole.differences, "cloud", category=POOLED, less=other)
        assert (pooled.scenes, pooled.objects) == (8, 8)
        assert pooled.values["chamfer_mm"].low is not None
    undefined = find(whole.differences, "cloud", part="unseen", less="observed")
    assert undefined.values["chamfer_mm"].mean is None


def test_a_completer_is_held_against_itself_unrefined_and_the_next(whole: Report) -> None:
    pairs = {(item.cloud, item.less) for item in whole.differences}
    baselines = {"observed", "mean shape", "mirrored"}
    assert pairs == {
        *(("cloud", name) for name in (*baselines, "cloud, unrefined", "own")),
        *(("own", name) for name in baselines),
    }


def test_a_scene_without_a_cloud_is_left_out_of_its_completer_alone() -> None:
    bare = replace(scene(1), clouds=tuple(r for r in scene(1).clouds if r.cloud != "cloud"))
    found = report(scene(0), bare)
    assert find(found.clouds, "cloud").scenes == 1
    assert find(found.clouds, "mirrored").scenes == 2
    assert find(found.differences, "cloud", less="mirrored").scenes == 1
    assert found.uncompleted == {"own": 1}


def test_handles_are_counted_by_whether_they_were_seen(whole: Report) -> None:
    # Shares of 0, 0.05, 0.1, 0.15, ...: the first two are unseen.
    unseen, seen = whole.handles
    assert (unseen.unseen, unseen.outcomes) == (True, {"right": 1, "wrong place": 0, "left out": 1})
    assert (seen.unseen, seen.outcomes) == (False, {"right": 2, "wrong place": 0, "left out": 2})
    assert unseen.means.values["spread_at_handle_mm"].mean == 6.0
    assert unseen.means.values["spread_made_mm"].mean is None


def test_views_spreads_and_times(whole: Report) -> None:
    views = find(whole.views, "cloud").values
    assert (views["fused_less_best_mm"].mean, views["fused_less_mean_mm"].mean) == (-0.5, -1.5)
    spread = find(whole.spreads, "cloud").values
    assert spread["spread_mm"].mean == pytest.approx(4.5)
    assert spread["wrong_mm"].mean is None
    (time,) = whole.latencies
    assert (time.scenes, time.highest_ms) == (8, 105.0)
    assert time.median_ms == np.median([100, 101, 102, 103, 104, 105, 100, 101])


def test_the_order_of_the_scenes_changes_nothing(whole: Report) -> None:
    scenes = [*map(scene, range(6)), *(scene(i, category="bowl") for i in range(2))]
    assert report(*scenes[::-1]) == whole


def test_one_class_is_not_pooled() -> None:
    assert list(report(scene(0)).unseen_share) == ["mug"]


def shown(content: Report) -> str:
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(render_report(content))
    return console.export_text()


def test_the_tables_hold_every_cloud_part_and_difference(whole: Report) -> None:
    text = shown(whole)
    assert "…" not in text
    assert "Mug: 6 scenes, 6 objects, 25% of the surface unseen" in text
    for name in CLOUDS:
        assert text.count(f"\n{name}  ") >= 9
    for said in ("cloud - mean shape", "cloud - cloud, unrefined", "Handles of mugs", "Time per"):
        assert said in text
    assert "own completed nothing in 2 scenes" in text
    lines = text.split("paired differences, all")[1].splitlines()
    line = next(line for line in lines if line.startswith("cloud - observed"))
    assert line.split("]")[0].split()[3] == "-5.75"


def test_json_holds_the_scenes_and_what_failed(whole: Report) -> None:
    text = report_json(whole, [scene(1), scene(0)], failures={"mug-0009": "no"}, settings={"a": 1})
    content = json.loads(text)
    assert [item["scene_id"] for item in content["scenes"]] == ["mug-0000", "mug-0001"]
    assert (content["failures"], content["settings"]) == ({"mug-0009": "no"}, {"a": 1})
    first = content["summary"]["clouds"][0]
    assert (first["category"], first["cloud"], first["part"]) == ("mug", "cloud", "all")
    assert first["values"]["chamfer_mm"]["mean"] == pytest.approx(3.5)
