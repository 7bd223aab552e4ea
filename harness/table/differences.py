"""Paired differences: what one model, or one run, measures on a scene less what another does."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.protocol import test_set_of
from harness.statistics import MeanEstimate, mean_estimate
from harness.table.columns import DIFFERENCE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.runs.records import Record

PAIRS = (
    ("metric", "classic_tuned"),
    ("metric", "classic"),
    ("metric", "network"),
    ("metric", "nearest"),
)
"""Models whose differences a run's table states: the first less the second."""


@dataclass(frozen=True)
class Difference:
    """The first less the second, over the scenes that both scored.

    Attributes
    ----------
    category, completion
        Class, and the completion that made the points; ``cloud less centersnap`` where each of the
        two has points of its own.
    segmenter
        ``maskrcnn less oracle`` where they had different ones.
    first, second
        What is compared: names of models.
    scenes, objects
        Number of scenes that both scored, and of their objects.
    values
        Mean difference and interval by column key; defined where both are.
    """

    category: str
    completion: str
    segmenter: str
    tolerance_m: float
    first: str
    second: str
    scenes: int
    objects: int
    values: Mapping[str, MeanEstimate]


def cell_order(category: str, completion: str, *, classes: Sequence[str]) -> tuple[object, ...]:
    """Order of classes and test sets, as in the seed: with completion first."""
    return (
        classes.index(category) if category in classes else len(classes),
        category,
        completion == "none",
        completion,
    )


def model_differences(
    records: Sequence[Record], *, classes: Sequence[str], seed: int
) -> tuple[Difference, ...]:
    """Differences of the models in `PAIRS`, as far as a run holds them.

    Parameters
    ----------
    records
        Of one run.
    classes
        Order of the classes.
    seed
        Of the resampling.
    """
    models = {record.model for record in records}
    found = [
        item
        for first, second in PAIRS
        if first in models and second in models
        for item in paired_differences(
            [record for record in records if record.model == first],
            [record for record in records if record.model == second],
            classes=classes,
            seed=seed,
        )
    ]
    # Stable, so that the pairs keep their order.
    return tuple(sorted(found, key=lambda item: _order(item, classes=classes)))


def paired_differences(
    first: Sequence[Record], second: Sequence[Record], *, classes: Sequence[str], seed: int
) -> tuple[Difference, ...]:
    """Differences of two models, or of one in two runs, by class, test set and tolerance.

    Parameters
    ----------
    first, second
        Records of one model and segmenter each; a pair is two of one scene, test set and
        tolerance. Points of different completers are of one test set.
    classes
        Order of the classes.
    seed
        Of the resampling.
    """
    partners = {_pairing(record): record for record in second}
    groups: defaultdict[tuple[str, str, str, float], list[tuple[Record, Record]]]
    groups = defaultdict(list)
    for record in sorted(first, key=_pairing):
        partner = partners.get(_pairing(record))
        if partner is not None and record.status == partner.status == "ok":
            completions = dict.fromkeys((record.completion, partner.completion))
            cell = (
                record.category,
                " less ".join(completions),
                " less ".join(dict.fromkeys((record.segmenter, partner.segmenter))),
                record.tolerance_m,
            )
            groups[cell].append((record, partner))
    found = [
        _difference(cell, pairs, names=(pairs[0][0].model, pairs[0][1].model), seed=seed)
        for cell, pairs in groups.items()
    ]
    return tuple(sorted(found, key=lambda item: _order(item, classes=classes)))


def _order(item: Difference, *, classes: Sequence[str]) -> tuple[object, ...]:
    cell = cell_order(item.category, item.completion, classes=classes)
    return (*cell, item.segmenter, item.tolerance_m)


def _pairing(record: Record) -> tuple[str, str, float]:
    return (record.scene_id, test_set_of(record.completion), record.tolerance_m)


def _difference(
    cell: tuple[str, str, str, float],
    pairs: Sequence[tuple[Record, Record]],
    *,
    names: tuple[str, str],
    seed: int,
) -> Difference:
    category, completion, segmenter, tolerance_m = cell
    objects = np.array([first.object_name for first, _ in pairs], dtype=np.str_)
    values = {}
    for column in DIFFERENCE_COLUMNS:
        sides = [(column.value(first), column.value(second)) for first, second in pairs]
        less = [np.nan if a is None or b is None else a - b for a, b in sides]
        values[column.key] = mean_estimate(
            np.array(less, dtype=np.float64), objects=objects, seed=seed
        )
    return Difference(
        category=category,
        completion=completion,
        segmenter=segmenter,
        tolerance_m=tolerance_m,
        first=names[0],
        second=names[1],
        scenes=len(pairs),
        objects=len(set(objects)),
        values=values,
    )
