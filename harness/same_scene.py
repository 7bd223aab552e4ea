"""Whether two records of one scene id are of one scene: what paired comparisons rest on.

A scene's id and seed name it, and a simulator that changes draws another scene under the same
name. Values that a machine's last bits reach are held against each other with a tolerance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import polars as pl

from harness.protocol import COMPLETED, test_set_of

if TYPE_CHECKING:
    from harness.runs.records import Record

EXACT = ("seed", "object_name", "redraws")
"""Fields that are equal."""

NEAR = {"camera_distance_m": 0.001, "visible_share": 0.002}
"""Fields that agree within so much where both records have as many views: other views, by intent,
look from elsewhere."""

NEAR_BASE_RATE = 0.01
"""Agreement of the share on the mesh of points that are drawn from the truth."""


def unlike(
    first: Record, second: Record, *, names: tuple[str, str] = ("in the one", "in the other")
) -> str | None:
    """Say in what two records of one scene id differ, the first's value first; None in nothing.

    Completed points need not agree, for each run's completer and views make its own. Of a failed
    record nothing is known.

    Parameters
    ----------
    first, second
        The records.
    names
        What they are of, for the words.
    """
    if "failed" in (first.status, second.status):
        return None
    drawn = test_set_of(first.completion) != COMPLETED
    for what in (*EXACT, *(("test_points",) if drawn else ())):
        ours, theirs = getattr(first, what), getattr(second, what)
        if ours != theirs:
            return f"its {what.replace('_', ' ')} is {ours} {names[0]} and {theirs} {names[1]}"
    near = dict(NEAR) if first.views == second.views else {}
    if drawn:
        near["base_rate"] = NEAR_BASE_RATE
    for what, within in near.items():
        ours, theirs = getattr(first, what), getattr(second, what)
        if ours == theirs:
            continue
        if ours is None or theirs is None or abs(ours - theirs) > within:
            name = what.removesuffix("_m").replace("_", " ")
            here, there = (None if value is None else round(value, 3) for value in (ours, theirs))
            return f"its {name} is {here} {names[0]} and {there} {names[1]}"
    return None


def are_alike(*, suffix: str) -> pl.Expr:
    """Whether two records in one row are of one scene, by `EXACT` and `NEAR`.

    Parameters
    ----------
    suffix
        Of the second record's columns.
    """
    same = pl.lit(value=True)
    for what in EXACT:
        same &= pl.col(what).eq_missing(pl.col(what + suffix))
    for what, within in NEAR.items():
        apart = (pl.col(what) - pl.col(what + suffix)).abs().fill_null(0.0) > within
        same &= ~apart | (pl.col("views") != pl.col("views" + suffix))
    return same
