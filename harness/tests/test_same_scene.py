"""Records of one scene id that are not of one scene."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import polars as pl
import pytest

from harness.runs.job import SceneJob
from harness.runs.records import RECORD_SCHEMA, Record, Variant
from harness.same_scene import are_alike, unlike
from harness.tests.fake_scenes import fake_record

JOB = SceneJob("mug-0000", "mug", "mug_0", seed=3)
RECORD = replace(
    fake_record(JOB, variant=Variant("classic"), tolerance_m=0.005),
    base_rate=0.4,
    camera_distance_m=0.5,
    visible_share=0.05,
)


def alike(first: Record, second: Record) -> bool:
    """What the expression says of two records in one row."""
    here, there = (pl.DataFrame([asdict(item)], schema=RECORD_SCHEMA) for item in (first, second))
    both = here.join(there, on="scene_id", suffix="_b").filter(are_alike(suffix="_b"))
    return len(both) == 1


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({}, None),
        ({"camera_distance_m": 0.5005, "visible_share": 0.0515, "base_rate": 0.405}, None),
        ({"seed": 4}, "its seed is 3 in the one and 4 in the other"),
        ({"object_name": "mug_1"}, "its object name is mug_0 in the one and mug_1 in the other"),
        ({"redraws": 1}, "its redraws is 0 in the one and 1 in the other"),
        ({"camera_distance_m": 0.502}, "its camera distance is 0.5 in the one and 0.502 in the"),
        ({"visible_share": 0.04}, "its visible share is 0.05 in the one and 0.04 in the other"),
        # Other views look from elsewhere.
        ({"camera_distance_m": 0.6, "visible_share": 0.09, "views": 1}, None),
    ],
)
def test_what_makes_another_scene(change: dict[str, Any], why: str | None) -> None:
    other = replace(RECORD, **change)
    said = unlike(RECORD, other)
    assert (said is None) == (why is None)
    assert said is None or why is None or said.startswith(why)
    assert alike(RECORD, other) == (why is None)


def test_drawn_points_have_one_base_rate_and_completed_ones_need_not() -> None:
    other = replace(RECORD, base_rate=0.42)
    assert unlike(RECORD, other) == "its base rate is 0.4 in the one and 0.42 in the other"
    completed = replace(RECORD, completion="cloud")
    assert unlike(completed, replace(completed, base_rate=0.9, completion="centersnap")) is None


def test_of_a_failed_record_nothing_is_known() -> None:
    lost = Record.failed(
        JOB, variant=Variant("classic"), views=3, tolerance_m=0.005, failure="no such luck"
    )
    assert unlike(RECORD, lost) is None
