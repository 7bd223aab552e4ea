"""How numbers and notes read in every rendering."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.statistics import LEAST_OBJECTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.statistics import MeanEstimate
    from harness.table.columns import Column
    from harness.table.summary import Row, Table

UNDEFINED = "\N{EN DASH}"


def number(value: float | None) -> str:
    """Three decimals, or a dash."""
    return UNDEFINED if value is None else f"{value:.3f}"


def signed(value: float | None) -> str:
    """Three decimals with a sign, or a dash."""
    return UNDEFINED if value is None else f"{value:+.3f}"


def interval(estimate: MeanEstimate) -> str:
    """``[low, high]``; a dash where too few objects define a mean, nothing where none does."""
    if estimate.low is None:
        return "" if estimate.mean is None else f"[{UNDEFINED}]"
    return f"[{number(estimate.low)}, {number(estimate.high)}]"


def partial_count(estimate: MeanEstimate, *, scenes: int) -> str:
    """``n=7`` where a value is undefined in some scenes; nothing where it is defined in all."""
    return "" if estimate.count == scenes else f"n={estimate.count}"


def scene_count(row: Row) -> str:
    """Count scenes, and failed ones if there are any."""
    scenes = _count(row.scenes, "scene")
    return f"{scenes}, {row.failed} failed" if row.failed else scenes


def object_count(row: Row) -> str:
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


def explanation(table: Table) -> str:
    """Say what the numbers of the main table are."""
    return (
        "Mean over scenes with 95 % bootstrap (BCa) interval, which draws objects with all their "
        f"scenes: none ({UNDEFINED}) below {LEAST_OBJECTS} objects, and it covers about 84 % with "
        f"{LEAST_OBJECTS}, 90 % with 10. TP to FN are fractions of the test "
        f"points. A point lies on the mesh within {millimetres(table.reported_tolerance_m)} of it. "
        f"{UNDEFINED} is undefined; n (or 'defined in') counts the scenes that define a value. "
        "Seed: its Table III, whose 'Acc.' column is precision. Random and nearest are the AURC of "
        "the same decisions in random order and by closeness to the training points: a confidence "
        "worth having lies below both."
    )
