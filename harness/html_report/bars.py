"""Differences as bars about a middle line, better to the right."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from harness.table.columns import HIGHER_IS_BETTER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.table.columns import Column
    from harness.table.differences import Contrast

MIDDLE = 50.0


@dataclass(frozen=True)
class Bar:
    """A difference in percent of a bar's width, which is 0 in the middle.

    Attributes
    ----------
    mean
        The mean difference; to the right where the first is better.
    low, high
        Its interval; the mean where it has none.
    band
        How far from the middle a difference must be for the run to find it; None where it never
        can.
    """

    mean: float
    low: float
    high: float
    band: float | None


def bars(contrasts: Sequence[Contrast | None], column: Column) -> list[Bar | None]:
    """Draw differences of one measure to one scale; None where there is no difference."""
    reach = max((_reach(item) for item in contrasts if item is not None), default=0.0) or 1.0
    sign = 1.0 if column.key in HIGHER_IS_BETTER else -1.0
    return [None if item is None else _bar(item, MIDDLE * sign / reach) for item in contrasts]


def _reach(contrast: Contrast) -> float:
    bounds = (contrast.mean, contrast.low, contrast.high)
    return max((abs(bound) for bound in bounds if bound is not None), default=0.0)


def _bar(contrast: Contrast, scale: float) -> Bar | None:
    if contrast.mean is None:
        return None
    mean = MIDDLE + scale * contrast.mean
    ends = sorted(
        mean if bound is None else MIDDLE + scale * bound for bound in (contrast.low, contrast.high)
    )
    least = contrast.minimum_detectable
    band = None if least is None else min(abs(scale) * least, MIDDLE)
    return Bar(mean=mean, low=ends[0], high=ends[1], band=band)
