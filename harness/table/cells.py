"""How numbers and notes read in every rendering."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from harness.statistics import ALPHA, LEAST_OBJECTS, LEAST_TESTED, POWER, PairedTest
from harness.table.differences import Difference
from harness.table.summary import Row, completion_label

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.statistics import MeanEstimate
    from harness.table.columns import Column
    from harness.table.differences import Contrast
    from harness.table.summary import Table

    Item = TypeVar("Item")

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


def compact_difference(estimate: MeanEstimate | PairedTest) -> str:
    """Signed mean and interval, such as ``+.034 [+.012, +.056]``."""
    mean = _compact_signed(estimate.mean)
    if estimate.low is None:
        return mean if estimate.mean is None else f"{mean} [{UNDEFINED}]"
    return f"{mean} [{_compact_signed(estimate.low)}, {_compact_signed(estimate.high)}]"


def difference(estimate: MeanEstimate | PairedTest) -> str:
    """Signed mean and interval, such as ``+0.034 [+0.012, +0.056]``."""
    if estimate.low is None:
        return signed(estimate.mean) + ("" if estimate.mean is None else f" [{UNDEFINED}]")
    return f"{signed(estimate.mean)} [{signed(estimate.low)}, {signed(estimate.high)}]"


def probability(value: float | None) -> str:
    """Write a p- or q-value with three decimals, such as ``.012`` or ``<.001``, or a dash."""
    return "<.001" if value is not None and value < 0.0005 else compact(value)


def effect(value: float | None) -> str:
    """Write an effect size with two decimals and a sign, or a dash."""
    return UNDEFINED if value is None else f"{value:+.2f}"


def verdict(item: Contrast) -> tuple[str, str]:
    """Say whether a difference was found, and what the scenes could tell.

    That nothing was found never reads as that there is nothing: the second half, which continues
    the first, says how great a difference would have been.
    """
    if item.mean is None:
        return "", ""
    if item.p_value is None:
        return "not tested:", f"{LEAST_TESTED} objects are needed"
    if item.mean == 0 and not item.minimum_detectable:
        return "the same", "in every scene"
    detectable = _compact_least(item.minimum_detectable)
    if item.detected:
        return "detected;", f"one test could detect {detectable}"
    if item.p_value <= ALPHA:
        return "not detected;", f"alone it would be ({detectable})"
    return "not detected;", f"one test could detect {detectable}"


def _compact_least(value: float | None) -> str:
    """Three decimals, but never 0 for more than that."""
    return "<.001" if value is not None and 0 < value < 0.0005 else compact(value)


def interval(estimate: MeanEstimate) -> str:
    """``[low, high]``; a dash where too few objects define a mean, nothing where none does."""
    if estimate.low is None:
        return "" if estimate.mean is None else f"[{UNDEFINED}]"
    return f"[{number(estimate.low)}, {number(estimate.high)}]"


def _compact_signed(value: float | None) -> str:
    return signed(value).replace("0.", ".", 1) if _is_fraction(value) else signed(value)


def _is_fraction(value: float | None) -> bool:
    return value is not None and abs(round(value, 3)) < 1


def partial_count(estimate: MeanEstimate | PairedTest, *, scenes: int) -> str:
    """``n=7`` where a value is undefined in some scenes; nothing where it is defined in all."""
    count = estimate.scenes if isinstance(estimate, PairedTest) else estimate.count
    return "" if count == scenes else f"n={count}"


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


def chunks(items: Sequence[Item], needed: Sequence[int], *, room: int) -> list[Sequence[Item]]:
    """Split items into lines of `room` characters, one item in each at least."""
    lines: list[Sequence[Item]] = []
    start = used = 0
    for index, size in enumerate(needed):
        if index > start and used + size > room:
            lines.append(items[start:index])
            start, used = index, 0
        used += size
    return [*lines, items[start:]]


INTERVALS = (
    "95 % bootstrap (BCa) intervals draw objects with all their scenes: none "
    f"({UNDEFINED}) below {LEAST_OBJECTS} objects, and they cover about 91 % with {LEAST_OBJECTS}, "
    "94 % with 8 or more, less where values are skewed."
)
"""What the intervals are."""


def _percent(share: float) -> str:
    return f"{share * 100:g} %"


TESTS = (
    "Differences are paired by scene. p is that of changing the signs of objects' differences "
    f"(two-sided; none below {LEAST_TESTED} objects), q is p adjusted by Benjamini and Hochberg "
    "over all differences of the table at the tolerance: 'detected' is q up to "
    f"{compact(ALPHA)}, so that of all that is called detected {_percent(ALPHA)} at most, on "
    "average, is not there. The effect is the mean over objects in standard deviations of the "
    "objects (Hedges' g). One test could detect: the least true difference that a single test at "
    f"{_percent(ALPHA)} finds in {_percent(POWER)} of such runs; a lone difference among many "
    "needs to be greater, and where none was detected, one may still be there. 'Alone it would "
    "be': p is small enough, q is not."
)
"""What is said of differences."""


def explanation(table: Table) -> str:
    """Say what the numbers of the main table are."""
    missed = (
        "Where the segmenter missed the target, its points are answered 'not the object': no "
        "precision, recall 0. "
        if any(row.missed for row in table.sweep)
        else ""
    )
    tests = f" {TESTS}" if table.differences else ""
    return (
        "Mean over scenes. TP to FN are fractions of the test points. A point lies on the mesh "
        f"within {millimetres(table.reported_tolerance_m)} of it. {UNDEFINED} is undefined; n (or "
        "'defined in') counts the scenes that define a value. SC points are the named shape "
        "completion's, the others fill the object's true box. Seed: its Table III, whose 'Acc.' "
        "column is precision. ECE is that of the raw probability, recal. that after recalibration. "
        "Random and nearest are the AURC of the same decisions in random order and by closeness to "
        "the training points: a confidence worth having lies below both. "
        f"{missed}{INTERVALS}{tests}"
    )
