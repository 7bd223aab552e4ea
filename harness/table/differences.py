"""Paired differences: what one model, or one run, measures on a scene less what another does.

All differences of a table at one tolerance are one family of tests: every class, test set,
segmenter, pair of models and measure that is tested (`harness.statistics.benjamini_hochberg`).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from harness.protocol import test_set_of
from harness.statistics import ALPHA, PairedTest, benjamini_hochberg, paired_test
from harness.table.columns import DIFFERENCE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from harness.runs.records import Record

PAIRS = (
    ("metric", "classic_tuned"),
    ("metric", "classic"),
    ("metric", "network"),
    ("metric", "nearest"),
)
"""Models whose differences a run's table states: the first less the second."""


@dataclass(frozen=True)
class Contrast(PairedTest):
    """A paired test among the others of its table.

    Attributes
    ----------
    q_value
        Adjusted by Benjamini and Hochberg: of the differences whose q is at most some share, no
        greater share is none on average. None where the p-value is.
    """

    q_value: float | None

    @property
    def detected(self) -> bool:
        """Whether the difference is taken for one, at a false discovery rate of `ALPHA`."""
        return self.q_value is not None and self.q_value <= ALPHA


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
        Mean difference and what is known of it by column key; defined where both sides are.
    """

    category: str
    completion: str
    segmenter: str
    tolerance_m: float
    first: str
    second: str
    scenes: int
    objects: int
    values: Mapping[str, Contrast]


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
    by_model: defaultdict[str, list[Record]] = defaultdict(list)
    for record in records:
        by_model[record.model].append(record)
    found = [
        item
        for first, second in PAIRS
        if first in by_model and second in by_model
        for item in _differences(by_model[first], by_model[second], seed=seed)
    ]
    # Stable, so that the pairs keep their order.
    return in_families(sorted(found, key=lambda item: _order(item, classes=classes)))


def paired_differences(
    first: Sequence[Record], second: Sequence[Record], *, classes: Sequence[str], seed: int
) -> tuple[Difference, ...]:
    """Differences of two models, or of one in two runs, by class, test set and tolerance.

    They are one family at each tolerance.

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
    found = _differences(first, second, seed=seed)
    return in_families(sorted(found, key=lambda item: _order(item, classes=classes)))


def _differences(
    first: Sequence[Record], second: Sequence[Record], *, seed: int
) -> list[Difference]:
    """Differences in no family yet."""
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
    return [
        _difference(cell, pairs, names=(pairs[0][0].model, pairs[0][1].model), seed=seed)
        for cell, pairs in groups.items()
    ]


def in_families(differences: Iterable[Difference]) -> tuple[Difference, ...]:
    """State the q-values of differences, which at one tolerance are one family.

    Parameters
    ----------
    differences
        All that stand in one table; q-values that they have are forgotten.
    """
    items = list(differences)
    families: defaultdict[float, list[tuple[int, str]]] = defaultdict(list)
    for index, item in enumerate(items):
        families[item.tolerance_m] += [(index, key) for key in item.values]
    adjusted: list[dict[str, Contrast]] = [{} for _ in items]
    for members in families.values():
        tests = [items[index].values[key] for index, key in members]
        p_values = [np.nan if test.p_value is None else test.p_value for test in tests]
        q_values = benjamini_hochberg(np.array(p_values, dtype=np.float64))
        for (index, key), test, q_value in zip(members, tests, q_values.tolist(), strict=True):
            known = None if test.p_value is None else q_value
            adjusted[index][key] = replace(test, q_value=known)
    return tuple(replace(item, values=values) for item, values in zip(items, adjusted, strict=True))


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
        test = paired_test(np.array(less, dtype=np.float64), objects=objects, seed=seed)
        values[column.key] = Contrast(**asdict(test), q_value=None)
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
