"""Whether a stage is slower than in the baseline, whatever the machine's pace at the moment."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.stats import binom

from harness.gate.margins import LEAST_SECONDS, SLOWER, SURELY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy.typing as npt

    from harness.gate.calibration import Calibration, Machine
    from harness.runs.records import Timing

SpeedMode = Literal["auto", "require", "skip"]
Stage = tuple[str, str | None]


@dataclass(frozen=True)
class StageSpeed:
    """A stage's time against the baseline's.

    Attributes
    ----------
    model
        None where all models share the stage.
    baseline_s, now_s
        Medians over the scenes, seconds.
    ratio, low
        Median over the scenes of the ratio of their times, divided by the calibrations' ratio, and
        its lower bound.
    slower
        Whether the bound is above `SLOWER`.
    """

    stage: str
    model: str | None
    baseline_s: float
    now_s: float
    ratio: float
    low: float | None
    slower: bool


@dataclass(frozen=True)
class Speed:
    """What is said of a run's times.

    Attributes
    ----------
    refused
        Why they are not judged; None where they are.
    pace
        The calibration's time over the baseline's: above 1 the machine was slower.
    stages
        As the baseline ran them.
    """

    refused: str | None
    pace: float | None = None
    stages: Sequence[StageSpeed] = ()

    @property
    def slower(self) -> bool:
        """Whether any stage is surely too slow."""
        return any(stage.slower for stage in self.stages)


def judge_speed(
    baseline: Sequence[Timing],
    now: Sequence[Timing],
    *,
    before: Calibration,
    after: Calibration,
) -> Speed:
    """Compare the times of the scenes that both timed, stage by stage.

    Parameters
    ----------
    baseline, now
        Timings of both runs.
    before, after
        Their calibrations: the baseline's, and the run's.
    """
    if refused := other_machine(after.machine, before.machine):
        return Speed(refused)
    for whose, found in (("the baseline", before), ("the run", after)):
        if not found.steady:
            return Speed(
                f"the machine was not steady during {whose}: the calibration took "
                f"{found.drift:.2f} times as long after as before; run again when it has nothing "
                "else to do"
            )
    pace = after.seconds / before.seconds
    theirs, ours = by_stage(baseline), by_stage(now)
    stages = []
    for stage, seconds in theirs.items():
        common = sorted(seconds.keys() & ours.get(stage, {}).keys())
        if not common:
            continue
        there = np.array([seconds[scene_id] for scene_id in common])
        here = np.array([ours[stage][scene_id] for scene_id in common])
        if np.median(there) < LEAST_SECONDS:
            continue
        ratios = here / there / pace
        low = median_bound(ratios)
        stages.append(
            StageSpeed(
                stage=stage[0],
                model=stage[1],
                baseline_s=float(np.median(there)),
                now_s=float(np.median(here)),
                ratio=float(np.median(ratios)),
                low=low,
                slower=low is not None and low > SLOWER,
            )
        )
    return Speed(None, pace, stages)


def other_machine(here: Machine, there: Machine) -> str | None:
    """Say why times of a run and of the baseline cannot be compared; None where they can."""
    if (other := here.unlike(there)) is None:
        return None
    return (
        f"the baseline was timed on another machine or with other workers ({other}); make one on "
        "this machine with `harness baseline update`, or pass --speed skip"
    )


def median_bound(values: npt.NDArray[np.float64]) -> float | None:
    """Lower bound of a median at the confidence `SURELY`; None with too few values (n,).

    The k-th smallest of n values lies above the median with a probability of
    ``P(Binomial(n, 1/2) < k)``, whatever their distribution: so the largest k for which this is at
    most ``1 - SURELY``.
    """
    k = int(binom.ppf(1 - SURELY, values.size, 0.5))
    return float(np.sort(values)[k - 1]) if k > 0 else None


def by_stage(timings: Sequence[Timing]) -> Mapping[Stage, dict[str, float]]:
    """Seconds of each stage, by scene."""
    found: defaultdict[Stage, dict[str, float]] = defaultdict(dict)
    for timing in timings:
        found[timing.stage, timing.model][timing.scene_id] = timing.seconds
    return found
