"""How numbers and notes read in every rendering."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.statistics import LEAST_OBJECTS
from harness.table.differences import Difference
from harness.table.summary import Row, completion_label

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.statistics import MeanEstimate
    from harness.table.columns import Column
    from harness.table.summary import Table

UNDEFINED = "\N{EN DASH}"


def number(value: float | None) -> str:
    """Three decimals, or a dash."""
    return UNDEFINED if value is None else f"{value:.3f}"


def signed(value: float | None) -> str:
    """Three decimals with a sign, or a dash."""
    return UNDEFINED if value is None else f"{value:+.3f}"


def compact(value: float | None) -> str:
    """Three decimals without the zero before the point, or a dash."""
    return number(value).replace("0.", ".", 1) if _is_fraction(value) else number(value)


def compact_difference(estimate: MeanEstimate) -> str:
    """Signed mean and interval, such as ``+.034 [+.012, +.056]``."""
    mean = _compact_signed(estimate.mean)
    if estimate.low is None:
        return mean if estimate.mean is None else f"{mean} [{UNDEFINED}]"
    return f"{mean} [{_compact_signed(estimate.low)}, {_compact_signed(estimate.high)}]"


def difference(estimate: MeanEstimate) -> str:
    """Signed mean and interval, such as ``+0.034 [+0.012, +0.056]``."""
    if estimate.low is None:
        return signed(estimate.mean) + ("" if estimate.mean is None else f" [{UNDEFINED}]")
    return f"{signed(estimate.mean)} [{signed(estimate.low)}, {signed(estimate.high)}]"


def is_significant(estimate: MeanEstimate) -> bool:
    """Whether the interval of a difference lies on one side of zero."""
    return (
        estimate.low is not None
        and estimate.high is not None
        and (estimate.low > 0 or estimate.high < 0)
    )


def interval(estimate: MeanEstimate) -> str:
    """``[low, high]``; a dash where too few objects define a mean, nothing where none does."""
    if estimate.low is None:
        return "" if estimate.mean is None else f"[{UNDEFINED}]"
    return f"[{number(estimate.low)}, {number(estimate.high)}]"


def _compact_signed(value: float | None) -> str:
    return signed(value).replace("0.", ".", 1) if _is_fraction(value) else signed(value)


def _is_fraction(value: float | None) -> bool:
    return value is not None and abs(round(value, 3)) < 1


def partial_count(estimate: MeanEstimate, *, scenes: int) -> str:
    """``n=7`` where a value is undefined in some scenes; nothing where it is defined in all."""
    return "" if estimate.count == scenes else f"n={estimate.count}"


def cell_label(item: Row | Difference) -> str:
    """Name a class and its test set, such as ``Mug SC (perturbed)``."""
    completion = item.completion if isinstance(item, Difference) else item.variant.completion
    return " ".join(filter(None, (item.category.capitalize(), completion_label(completion))))


def pair_label(item: Difference) -> str:
    """Name what is subtracted from what, such as ``metric - classic tuned``."""
    return f"{item.first} - {item.second}".replace("_", " ")


def scene_count(row: Row | Difference) -> str:
    """Count scenes, those whose target was missed, and failed ones, if there are any."""
    scenes = _count(row.scenes, "scene")
    if isinstance(row, Difference):
        return scenes
    missed = f" (target missed in {row.missed})" if row.missed else ""
    return scenes + missed + (f", {row.failed} failed" if row.failed else "")


def object_count(row: Row | Difference) -> str:
    """Count the objects of the scored scenes."""
    return _count(row.objects, "object")


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


def has_seed(row: Row, columns: Sequence[Column]) -> bool:
    """Whether the seed states any of these columns for the row."""
    return any(column.key in row.seed for column in columns)


def millimetres(distance_m: float) -> str:
    """Write a distance for people."""
    return f"{distance_m * 1000:g} mm"


INTERVALS = (
    "95 % bootstrap (BCa) intervals draw objects with all their scenes: none "
    f"({UNDEFINED}) below {LEAST_OBJECTS} objects, and they cover about 84 % with {LEAST_OBJECTS}, "
    "90 % with 10."
)
"""What the intervals are."""


def explanation(table: Table) -> str:
    """Say what the numbers of the main table are."""
    missed = (
        "Where the segmenter missed the target, its points are answered 'not the object': no "
        "precision, recall 0. "
        if any(row.missed for row in table.sweep)
        else ""
    )
    return (
        "Mean over scenes. TP to FN are fractions of the test points. A point lies on the mesh "
        f"within {millimetres(table.reported_tolerance_m)} of it. {UNDEFINED} is undefined; n (or "
        "'defined in') counts the scenes that define a value. SC points are the named shape "
        "completion's, the others fill the object's true box. Seed: its Table III, whose 'Acc.' "
        "column is precision. ECE is that of the raw probability, recal. that after recalibration. "
        "Random and nearest are the AURC of the same decisions in random order and by closeness to "
        "the training points: a confidence worth having lies below both. Differences are paired "
        f"by scene. {missed}{INTERVALS}"
    )
