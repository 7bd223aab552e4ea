"""The verdict on quality: every cell's every metric, and what was lost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from harness.gate.losses import LossTests, judge_losses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.gate.pairs import Cell, Lost, Paired, Rows

Verdict = Literal["worse", "unsure", "ok", "same", "unjudged"]

WORST = 3
"""Scenes that are named of a row that is worse."""


@dataclass(frozen=True)
class SceneLoss:
    """By how much a scene is worse than in the baseline."""

    scene_id: str
    loss: float


@dataclass(frozen=True)
class Judgement:
    """A cell's metric.

    Attributes
    ----------
    metric
        The record's field.
    baseline, now
        Means over the scenes that both runs define; None where there is none.
    difference, low, high
        Now less the baseline, with its 95 % interval; None where undefined, and the interval with
        too few objects.
    margin
        Loss that is let pass.
    minimum_detectable
        Smallest true loss that is found 4 times in 5 where nothing else is lost.
    q_value
        Share of false ones among all losses that are at least as sure.
    scenes, objects
        Numbers of those that both runs define.
    verdict
        ``worse``: surely beyond the margin; ``unsure``: beyond it, and perhaps by chance; ``ok``;
        ``same``: no scene differs; ``unjudged``: too few objects.
    worst
        The scenes that lose most, where the verdict is ``worse``.
    """

    cell: Cell
    metric: str
    heading: str
    baseline: float | None
    now: float | None
    difference: float | None
    low: float | None
    high: float | None
    margin: float
    minimum_detectable: float | None
    q_value: float | None
    scenes: int
    objects: int
    verdict: Verdict
    worst: Sequence[SceneLoss]


@dataclass(frozen=True)
class Quality:
    """The verdict on quality.

    Attributes
    ----------
    rows
        One for each cell and metric, then those over several cells.
    lost
        What the baseline has and the run has not.
    scenes
        Number of scenes judged.
    """

    rows: Sequence[Judgement]
    lost: Sequence[Lost]
    scenes: int

    @property
    def passed(self) -> bool:
        """Whether nothing is lost and no row is worse."""
        return not self.lost and not self.worse

    @property
    def worse(self) -> list[Judgement]:
        """Rows that are surely beyond their margins."""
        return [row for row in self.rows if row.verdict == "worse"]


def judge_quality(paired: Paired) -> Quality:
    """Judge two runs that were laid side by side."""
    return Quality(
        rows=[
            row for family in (paired.rows, *paired.pooled) for row in _judge_family(family, paired)
        ],
        lost=paired.lost,
        scenes=paired.scene_ids.size,
    )


def _judge_family(rows: Sequence[Rows], paired: Paired) -> list[Judgement]:
    """Judge rows in one family of tests."""
    if not rows:
        return []
    losses = np.stack([row.losses for row in rows])
    margins = np.array([row.metric.margin for row in rows])
    tests = judge_losses(losses, objects=paired.objects, margins=margins)
    return [_judgement(row, tests, index, paired) for index, row in enumerate(rows)]


def _judgement(row: Rows, tests: LossTests, index: int, paired: Paired) -> Judgement:
    metric, losses = row.metric, row.losses
    defined = ~np.isnan(losses)
    worse = bool(tests.worse[index])
    difference = half = None
    if defined.any():
        difference = float(np.mean(row.now[defined] - row.baseline[defined]))
        half = _number(tests.half_width[index])
    if not tests.judged[index]:
        verdict: Verdict = "unjudged"
    elif worse:
        verdict = "worse"
    elif not losses[defined].any():
        verdict = "same"
    else:
        verdict = "unsure" if tests.mean[index] > metric.margin else "ok"
    order = np.argsort(-np.nan_to_num(losses, nan=-np.inf), kind="stable")[:WORST]
    return Judgement(
        cell=row.cell,
        metric=metric.key,
        heading=metric.heading,
        baseline=_mean(row.baseline[defined]),
        now=_mean(row.now[defined]),
        difference=difference,
        low=None if half is None or difference is None else difference - half,
        high=None if half is None or difference is None else difference + half,
        margin=metric.margin,
        minimum_detectable=_number(tests.minimum_detectable[index]),
        q_value=_number(tests.q_values[index]),
        scenes=int(tests.scenes[index]),
        objects=int(tests.objects[index]),
        verdict=verdict,
        worst=[SceneLoss(str(paired.scene_ids[i]), float(losses[i])) for i in order]
        if worse
        else [],
    )


def _mean(values: np.ndarray) -> float | None:
    return float(values.mean()) if values.size else None


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
