"""Stage times against the baseline's: bounds by hand, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from harness.benchmarks.gate_speed import caught, stage_noise
from harness.errors import InputError
from harness.gate.calibration import (
    Calibration,
    Machine,
    conclude,
    measure,
    read_calibration,
    several_sittings,
    write_calibration,
)
from harness.gate.margins import SLOWER
from harness.gate.speed import judge_speed, median_bound
from harness.runs.records import Timing

if TYPE_CHECKING:
    from pathlib import Path

HERE = Machine(cpu="a processor", cores=2, workers=2)
STEADY = Calibration(HERE, seconds=0.05)


def timings(*seconds: float, stage: str = "fit", model: str | None = "metric") -> list[Timing]:
    return [
        Timing(scene_id=f"mug-{index:04d}", stage=stage, model=model, seconds=float(value))
        for index, value in enumerate(seconds)
    ]


def test_the_bound_is_an_order_statistic() -> None:
    # P(all 6 values lie above the median) = 1/64 > 0.01; of 7 it is 1/128.
    assert median_bound(np.arange(6.0)) is None
    assert median_bound(np.arange(7.0)) == 0.0
    # Of 16, P(at most 2 lie below) = 137 / 65,536 and P(at most 3) = 697 / 65,536 > 0.01.
    assert [sum(math.comb(16, i) for i in range(k)) for k in (3, 4)] == [137, 697]
    assert median_bound(np.arange(16.0)) == 2.0


def test_the_bound_lies_below_the_median_as_often_as_it_says() -> None:
    values = np.random.default_rng(0).exponential(size=(4000, 24))
    above = sum((median_bound(row) or 0.0) > math.log(2) for row in values)
    assert above / 4000 < 0.014


def test_a_stage_is_slower_where_most_scenes_say_so() -> None:
    base = timings(*np.linspace(1.0, 2.0, 8))
    slow = [replace(item, seconds=item.seconds * (SLOWER + 0.05)) for item in base]
    found = judge_speed(base, slow, before=STEADY, after=STEADY)
    (stage,) = found.stages
    assert (stage.stage, stage.model, stage.slower, found.slower) == ("fit", "metric", True, True)
    assert stage.ratio == pytest.approx(SLOWER + 0.05)
    assert stage.low == pytest.approx(SLOWER + 0.05)
    # One scene as fast as before: the bound is the least of 8.
    found = judge_speed(base, [base[0], *slow[1:]], before=STEADY, after=STEADY)
    assert found.stages[0].low == pytest.approx(1.0)
    assert not found.slower


def test_a_slower_machine_is_no_slower_stage() -> None:
    base = timings(*np.linspace(1.0, 2.0, 8))
    slow = [replace(item, seconds=item.seconds * 1.4) for item in base]
    found = judge_speed(base, slow, before=STEADY, after=replace(STEADY, seconds=0.07))
    assert found.pace == pytest.approx(1.4)
    assert found.stages[0].ratio == pytest.approx(1.0)
    assert not found.slower


def test_short_stages_and_those_of_one_run_alone_are_not_judged() -> None:
    base = [*timings(*[0.001] * 8, stage="truth", model=None), *timings(*[1.0] * 8)]
    now = [*timings(*[0.1] * 8, stage="truth", model=None), *timings(*[9.0] * 8, stage="new")]
    assert judge_speed(base, now, before=STEADY, after=STEADY).stages == []


def test_times_of_another_machine_are_refused() -> None:
    other = Calibration(Machine(cpu="another", cores=8, workers=2), seconds=0.05)
    found = judge_speed(timings(1.0), timings(9.0), before=other, after=STEADY)
    assert (found.slower, found.stages) == (False, ())
    assert found.refused == (
        "the baseline was timed on another machine or with other workers (processor another "
        "there, a processor here; cores 8 there, 2 here); make one on this machine with "
        "`harness baseline update`, or pass --speed skip"
    )


def test_an_unsteady_machine_is_refused() -> None:
    after = replace(STEADY, drift=1.8)
    found = judge_speed(timings(1.0), timings(9.0), before=STEADY, after=after)
    assert found.refused is not None
    assert found.refused.startswith("the machine was not steady during the run: the calibration")
    found = judge_speed(timings(1.0), timings(9.0), before=replace(STEADY, drift=0.5), after=STEADY)
    assert "not steady during the baseline" in (found.refused or "")


def test_a_calibration_is_the_median_of_all_repeats(tmp_path: Path) -> None:
    found = conclude([1.0, 2.0, 3.0], [2.0, 4.0, 8.0], machine=HERE)
    assert (found.seconds, found.drift) == (2.5, 2.0)
    assert read_calibration(tmp_path) is None
    write_calibration(found, tmp_path)
    assert read_calibration(tmp_path) == found
    (tmp_path / "calibration.json").write_text('{"seconds": -1}', encoding="utf-8")
    with pytest.raises(InputError, match=r"calibration\.json cannot be read \(no calibration of"):
        read_calibration(tmp_path)


def test_a_calibration_around_the_last_sitting_is_not_one_of_the_run() -> None:
    assert several_sittings([{}]) is None
    assert "in 2 sittings, and its calibration is of the last" in (several_sittings([{}, {}]) or "")


def test_the_workload_runs_in_as_many_processes_as_asked() -> None:
    seconds = measure(workers=2)
    assert len(seconds) == 32
    assert min(seconds) > 0.0


def test_a_session_tells_the_machine() -> None:
    session = {"cpu": "a processor", "cores": 4, "system": "x"}
    assert Machine.of_session(session, workers=None, scenes=16).workers == 4
    assert Machine.of_session(session, workers=2, scenes=16).workers == 2
    assert Machine.of_session(session, workers=None, scenes=3).workers == 3


def test_the_simulation_finds_slower_stages_and_no_others() -> None:
    rows = [
        *timings(*np.exp(np.random.default_rng(4).normal(0, 0.1, 32))),
        *timings(*[0.001] * 32, stage="truth", model=None),
    ]
    (stage,) = (noise := stage_noise(rows))
    assert stage == ("fit", "metric")
    assert np.median(noise[stage]) == pytest.approx(0.0)
    shares = caught(noise[stage], scenes=32, repeats=200)
    assert shares[1.0] == 0.0
    assert shares[1.5] > 0.95
