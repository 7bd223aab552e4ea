"""From records to the numbers of the table."""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.runs.records import Record, Variant
from harness.statistics import MeanEstimate, mean_estimate
from harness.table.columns import COLUMNS
from harness.table.differences import Difference, cell_order, model_differences
from harness.table.seed import seed_model, seed_numbers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

MODEL_ORDER = ("classic", "classic_tuned", "metric_literal", "metric", "network", "nearest")


def model_label(variant: Variant) -> str:
    """Name a model in print, with a segmenter that is not the oracle."""
    name = variant.model.replace("_", " ")
    return name if variant.segmenter == "oracle" else f"{name} [{variant.segmenter}]"


def completion_label(completion: str) -> str:
    """``SC``, as in the seed, with the shape completion; nothing without one."""
    return "" if completion == "none" else f"SC ({completion})"


@dataclass(frozen=True)
class Row:
    """A class and variant at one tolerance, over all scenes.

    Attributes
    ----------
    scenes, failed
        Number of scenes that were scored, and of scenes that failed.
    missed
        Number of scored scenes whose target the segmenter missed, so that its points are answered
        "not the object".
    objects
        Number of objects in the scored scenes.
    values
        Mean and interval by column key.
    seed
        The seed's numbers by column key; empty where it has none.
    """

    category: str
    variant: Variant
    tolerance_m: float
    scenes: int
    failed: int
    missed: int
    objects: int
    values: Mapping[str, MeanEstimate]
    seed: Mapping[str, float]

    @property
    def label(self) -> str:
        """Name in print, as the seed's: class, model, ``SC`` with shape completion."""
        completed = completion_label(self.variant.completion)
        parts = (self.category.capitalize(), model_label(self.variant), completed)
        return " ".join(part for part in parts if part)

    @property
    def seed_model(self) -> str:
        """Which of the seed's models `seed` is of."""
        return seed_model(self.variant)

    def difference(self, key: str) -> float | None:
        """Ours less the seed's."""
        mean = self.values[key].mean
        return None if mean is None or key not in self.seed else mean - self.seed[key]


@dataclass(frozen=True)
class Table:
    """A run's table.

    Attributes
    ----------
    rows
        At the reported tolerance.
    sweep
        At every tolerance, by row and then tolerance.
    differences
        Of models on the same scenes, at every tolerance.
    reported_tolerance_m
        Distance within which a point lies on the mesh in `rows`, metres.
    """

    rows: tuple[Row, ...]
    sweep: tuple[Row, ...]
    differences: tuple[Difference, ...]
    reported_tolerance_m: float

    def groups(self) -> list[tuple[Row, ...]]:
        """Rows of one class and completion together, in their order."""
        return [
            tuple(rows)
            for _, rows in itertools.groupby(
                self.rows, key=lambda row: (row.category, row.variant.completion)
            )
        ]

    def reported_differences(self) -> tuple[Difference, ...]:
        """Differences at the reported tolerance."""
        return tuple(
            item for item in self.differences if item.tolerance_m == self.reported_tolerance_m
        )


def summarise(
    records: Sequence[Record], *, reported_tolerance_m: float, classes: Sequence[str], seed: int
) -> Table:
    """Means over scenes with their intervals.

    Parameters
    ----------
    records
        Of one run.
    reported_tolerance_m
        The tolerance of the main table, metres.
    classes
        Order of the classes.
    seed
        Of the resampling; cells whose values are defined in scenes of equally many objects draw
        the same objects, by the order of their names.
    """
    groups: defaultdict[tuple[str, Variant, float], list[Record]] = defaultdict(list)
    for record in sorted(records, key=Record.key):
        groups[record.category, record.variant, record.tolerance_m].append(record)
    rows = [
        _row(group, category=category, variant=variant, tolerance_m=tolerance_m, seed=seed)
        for (category, variant, tolerance_m), group in groups.items()
    ]
    rows.sort(
        key=lambda row: (
            *cell_order(row.category, row.variant.completion, classes=classes),
            MODEL_ORDER.index(row.variant.model)
            if row.variant.model in MODEL_ORDER
            else len(MODEL_ORDER),
            row.variant,
            row.tolerance_m,
        )
    )
    return Table(
        rows=tuple(row for row in rows if row.tolerance_m == reported_tolerance_m),
        sweep=tuple(rows),
        differences=model_differences(records, classes=classes, seed=seed),
        reported_tolerance_m=reported_tolerance_m,
    )


def _row(
    group: Sequence[Record], *, category: str, variant: Variant, tolerance_m: float, seed: int
) -> Row:
    scored = [record for record in group if record.status == "ok"]
    objects = np.array([record.object_name for record in scored], dtype=np.str_)
    values = {}
    for column in COLUMNS:
        cells = [column.value(record) for record in scored]
        defined = np.array([np.nan if cell is None else cell for cell in cells], dtype=np.float64)
        values[column.key] = mean_estimate(defined, objects=objects, seed=seed)
    return Row(
        category=category,
        variant=variant,
        tolerance_m=tolerance_m,
        scenes=len(scored),
        failed=len(group) - len(scored),
        missed=sum(record.target_missed for record in scored),
        objects=len(set(objects)),
        values=values,
        seed=seed_numbers(category=category, variant=variant),
    )
