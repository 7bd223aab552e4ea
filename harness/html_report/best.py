"""The best model of a class and test set: all are held to the same scenes."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.gate.margins import GATED
from harness.statistics import MeanEstimate, mean_estimate
from harness.table.columns import HIGHER_IS_BETTER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.runs.records import Record, Variant
    from harness.table.columns import Column

RULE = (
    "Best is the best mean over the scenes that define the measure for every model, with its "
    "interval. Where a model puts no point on the object its precision counts as 0 here, as in the "
    "gate; the tables leave such scenes out."
)

_UNDEFINED = {item.key: item.undefined for item in GATED if item.undefined is not None}
"""By the measure's key: what a scene counts as whose answers leave it undefined."""


@dataclass(frozen=True)
class Best:
    """The best of several models.

    Attributes
    ----------
    variants
        Which; several where they are equal.
    value
        Mean over the scenes that are common to all models.
    """

    variants: tuple[Variant, ...]
    value: MeanEstimate


def best_model(records: Sequence[Record], column: Column, *, seed: int) -> Best | None:
    """Find the best model by `RULE`; None without a scene that all define.

    A model that no scene defines a measure for, such as one that gives no probability, has no say
    in which scenes are common.

    Parameters
    ----------
    records
        Of one class, test set and tolerance.
    column
        The measure.
    seed
        Of the interval's resampling.
    """
    values: defaultdict[Variant, dict[str, float]] = defaultdict(dict)
    objects = {}
    for record in records:
        if record.status != "ok":
            continue
        value = column.value(record)
        if value is None:
            value = _UNDEFINED.get(column.key)
        if value is not None:
            values[record.variant][record.scene_id] = value
            objects[record.scene_id] = record.object_name
    if not values:
        return None
    common = sorted(set.intersection(*(set(of_scene) for of_scene in values.values())))
    if not common:
        return None
    names = np.array([objects[scene_id] for scene_id in common], dtype=np.str_)
    estimates = {
        variant: mean_estimate(
            np.array([of_scene[scene_id] for scene_id in common]), objects=names, seed=seed
        )
        for variant, of_scene in values.items()
    }
    sign = 1.0 if column.key in HIGHER_IS_BETTER else -1.0
    first = max(estimates, key=lambda variant: sign * (estimates[variant].mean or 0.0))
    best = estimates[first]
    return Best(tuple(v for v, other in estimates.items() if other.mean == best.mean), best)
