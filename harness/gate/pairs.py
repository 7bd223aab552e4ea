"""Two runs laid side by side: the same scenes in rows of values, and what one of them lost."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.errors import InputError
from harness.gate.margins import GATED, LEAST_POINTS, UNJUDGED, Gated
from harness.protocol import test_set_of
from harness.same_scene import unlike

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy.typing as npt

    from harness.runs.records import Record

Key = tuple[str, str, str]
"""Scene, test set and model: what a record of the reported tolerance is of."""

ALL = "all"
"""Class, or test set, of a row over several cells."""


@dataclass(frozen=True, order=True)
class Cell:
    """What is judged by itself.

    Attributes
    ----------
    test_set
        ``box``, ``completed`` or ``perturbed``: whatever completes, its points stand beside those
        of the baseline's completer.
    """

    category: str
    test_set: str
    model: str


@dataclass(frozen=True, eq=False)
class Rows:
    """Values of a cell's metric in both runs, on all scenes.

    Attributes
    ----------
    baseline, now : (scenes,) float64
        NaN where a scene is not of the cell, is lost, or leaves the metric undefined in one run.
    """

    cell: Cell
    metric: Gated
    baseline: npt.NDArray[np.float64]
    now: npt.NDArray[np.float64]

    @property
    def losses(self) -> npt.NDArray[np.float64]:
        """By how much each scene (scenes,) is worse now."""
        difference = self.baseline - self.now
        return difference if self.metric.better == "higher" else -difference


@dataclass(frozen=True, eq=False)
class Family:
    """Rows over several cells, of a model and metric each, that are judged as one family of tests.

    Attributes
    ----------
    rows
        What each is of.
    members : (families' rows, single cells' rows) float64
        1 where a cell's row is part of it.
    """

    rows: Sequence[tuple[Cell, Gated]]
    members: npt.NDArray[np.float64]

    def means(self, values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Mean of each scene over the members that define it, NaN where none does.

        Parameters
        ----------
        values : (single cells' rows, scenes) float64

        Returns
        -------
        means : (families' rows, scenes) float64
        """
        defined = ~np.isnan(values)
        with np.errstate(invalid="ignore"):
            sums = self.members @ np.where(defined, values, 0.0)
            return np.asarray(sums / (self.members @ defined.astype(np.float64)))


def families(rows: Sequence[Rows]) -> list[Family]:
    """List what is judged over several cells: each test set's classes, and all of a model's."""
    members: defaultdict[tuple[Cell, Gated], list[int]] = defaultdict(list)
    for index, row in enumerate(rows):
        for test_set in (row.cell.test_set, ALL):
            members[Cell(ALL, test_set, row.cell.model), row.metric].append(index)
    found = []
    # With one test set, a model's rows over all cells are those over its classes.
    for over_sets in (False, True)[: len({row.cell.test_set for row in rows})]:
        chosen = [
            (what, places)
            for what, places in sorted(members.items(), key=lambda item: item[0][0])
            if len(places) > 1 and (what[0].test_set == ALL) == over_sets
        ]
        if chosen:
            matrix = np.zeros((len(chosen), len(rows)))
            for line, (_, places) in enumerate(chosen):
                matrix[line, places] = 1.0
            found.append(Family([what for what, _ in chosen], matrix))
    return found


@dataclass(frozen=True)
class Lost:
    """What the baseline has of a scene and the run has not.

    Attributes
    ----------
    what
        ``vanished``, ``failed``, ``missed``, or ``shrunk`` where few test points are left.
    of
        What was lost: test sets, each with its models where others of the scene are there.
    why
        The failure's reason.
    """

    scene_id: str
    what: str
    of: str
    why: str


@dataclass(frozen=True, eq=False)
class Paired:
    """Two runs laid side by side.

    Attributes
    ----------
    scene_ids, objects : (scenes,) str
        The baseline's scenes that are judged.
    rows
        One for each cell and metric.
    pooled
        Those over several cells, by `families`.
    lost
        In the order of the scenes.
    """

    scene_ids: npt.NDArray[np.str_]
    objects: npt.NDArray[np.str_]
    rows: Sequence[Rows]
    pooled: Sequence[Sequence[Rows]]
    lost: Sequence[Lost]


def pair_runs(baseline: Sequence[Record], now: Sequence[Record], *, names: str) -> Paired:
    """Lay the records of a run beside the baseline's.

    Parameters
    ----------
    baseline, now
        Of the reported tolerance; of the baseline's, the scenes that are judged.
    names
        What the message calls the two, the baseline first.

    Raises
    ------
    InputError
        A scene of both is not the same in both.
    """
    before, after = ({_key(record): record for record in records} for records in (baseline, now))
    for key in sorted(before.keys() & after.keys()):
        if why := unlike(before[key], after[key], names=("in the baseline", "now")):
            raise InputError(
                f"{key[0]} is not the same scene in {names}: {why}; the simulator, its seed or its "
                "objects changed: run the benchmark again and make it the baseline with "
                "`harness baseline update --from RUN`"
            )
    scene_ids = sorted({record.scene_id for record in baseline})
    place = {scene_id: index for index, scene_id in enumerate(scene_ids)}
    owner = {record.scene_id: record.object_name for record in baseline}
    cells: defaultdict[Cell, list[Key]] = defaultdict(list)
    for key, record in sorted(before.items()):
        cells[Cell(record.category, key[1], record.model)].append(key)
    rows = []
    for cell in sorted(item for item in cells if item.model not in UNJUDGED):
        both = [
            (place[key[0]], before[key], after[key])
            for key in cells[cell]
            if key in after and before[key].status == after[key].status == "ok"
        ]
        for metric in GATED:
            values = np.full((2, len(scene_ids)), np.nan)
            for index, *sides in both:
                values[:, index] = [_value(record, metric) for record in sides]
            values[:, np.isnan(values).any(axis=0)] = np.nan
            rows.append(Rows(cell, metric, values[0], values[1]))
    return Paired(
        scene_ids=np.array(scene_ids, dtype=np.str_),
        objects=np.array([owner[scene_id] for scene_id in scene_ids], dtype=np.str_),
        rows=rows,
        pooled=_pooled(rows),
        lost=_losses(before, after),
    )


def _pooled(rows: Sequence[Rows]) -> list[list[Rows]]:
    if not rows:
        return []
    before, after = (np.stack([getattr(row, side) for row in rows]) for side in ("baseline", "now"))
    return [
        [
            Rows(cell, metric, there, here)
            for (cell, metric), there, here in zip(
                family.rows, family.means(before), family.means(after), strict=True
            )
        ]
        for family in families(rows)
    ]


def _key(record: Record) -> Key:
    return (record.scene_id, test_set_of(record.completion), record.model)


def _value(record: Record, metric: Gated) -> float:
    value: float | None = getattr(record, metric.key)
    if value is None:
        value = metric.undefined
    return np.nan if value is None else value


def _losses(before: Mapping[Key, Record], after: Mapping[Key, Record]) -> list[Lost]:
    """List what the baseline scored and the run did not, or not at its target."""
    found: defaultdict[tuple[str, str], defaultdict[str, list[str]]]
    found = defaultdict(lambda: defaultdict(list))
    reasons: dict[tuple[str, str], str] = {}
    models: defaultdict[tuple[str, str], set[str]] = defaultdict(set)
    for key, record in sorted(before.items()):
        scene_id, test_set, model = key
        models[scene_id, test_set].add(model)
        other = after.get(key)
        why: str | None = "the run has no such record"
        if other is None:
            what = "vanished"
        elif other.target_missed and not record.target_missed:
            what, why = "missed", other.failure
        elif other.status == "failed" and record.status == "ok":
            what, why = "failed", other.failure
        elif (other.test_points or 0) < LEAST_POINTS * (record.test_points or 0):
            what = "shrunk"
            why = f"it has {other.test_points} test points of {record.test_points}"
        else:
            continue
        found[scene_id, what][test_set].append(model)
        if why is not None:
            reasons.setdefault((scene_id, what), why)
    return [
        Lost(
            scene_id=scene_id,
            what=what,
            of=", ".join(
                test_set
                if set(lost) == models[scene_id, test_set]
                else f"{test_set} ({', '.join(lost)})"
                for test_set, lost in test_sets.items()
            ),
            why=reasons.get((scene_id, what), "the map does not hold the target"),
        )
        for (scene_id, what), test_sets in found.items()
    ]
