"""What the rows of the benchmark's table lose against true masks, on the same frames.

Each scene is simulated once and evaluated with the oracle and with every segmenter. Differences
are paired by scene, with the intervals of `harness.statistics`. A target that a segmenter misses
has no precision, so that such scenes are counted beside it; they have a recall and an F1 of 0.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from harness.scene_run import evaluate_scene, simulate_job
from harness.segmentation.segmenter import with_segmenter
from harness.stages.clock import StageClock
from harness.statistics import MeanEstimate, mean_estimate
from harness.table.differences import cell_order
from harness.table.summary import MODEL_ORDER, completion_label
from harness.truth import ORACLE, SceneFailure

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from harness.config import Config
    from harness.runs.job import SceneJob
    from harness.runs.records import Record
    from harness.segmentation.rows import Choice
    from harness.segmentation.scene import Plan

TABLE_CLASSES = ("mug", "bowl")
"""Classes of the seed's Table III."""

MEASURES = ("precision", "recall", "f1", "accuracy")


@dataclass(frozen=True)
class PairedScene:
    """One scene by the oracle's masks and by each segmenter's.

    Attributes
    ----------
    oracle
        Records at the reported tolerance.
    segmenters
        The same by the segmenter's name.
    failures
        Why a segmenter has no records, by its name.
    """

    scene_id: str
    oracle: tuple[Record, ...]
    segmenters: dict[str, tuple[Record, ...]] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class PairedValue:
    """A measure over the scenes that define it on both sides: both means, and their difference."""

    oracle: float | None
    segmenter: float | None
    less: MeanEstimate


@dataclass(frozen=True)
class LossRow:
    """A row of the table.

    Attributes
    ----------
    scenes, objects
        Number of scenes that both scored, and of their objects.
    missed
        Number of scenes whose target the segmenter missed.
    failed
        Number of those that the oracle's masks scored and the segmenter's failed otherwise.
    values
        By the names in `MEASURES`.
    """

    segmenter: str
    category: str
    model: str
    completion: str
    scenes: int
    objects: int
    missed: int
    failed: int
    values: Mapping[str, PairedValue]

    @property
    def label(self) -> str:
        """Name in print, as in the table."""
        parts = (
            self.category.capitalize(),
            self.model.replace("_", " "),
            completion_label(self.completion),
        )
        return " ".join(filter(None, parts))


@dataclass(frozen=True)
class Loss:
    """The rows of all segmenters.

    Attributes
    ----------
    tolerance_m
        Distance within which a point lies on the mesh, metres.
    failures
        Why scenes or their evaluations failed, by scene id and segmenter.
    """

    tolerance_m: float
    rows: tuple[LossRow, ...]
    failures: Mapping[str, str]


def evaluate_by_each(job: SceneJob, config: Config, plan: Plan) -> PairedScene:
    """Evaluate a job's scene with the oracle and with every segmenter; the workers' function."""
    scene = simulate_job(job, config)

    def evaluate(setting: str) -> tuple[Record, ...]:
        result = evaluate_scene(
            scene,
            job=job,
            config=with_segmenter(config, setting),
            clock=StageClock(job.scene_id),
        )
        tolerance_m = config.protocol.reported_tolerance_m
        return tuple(row for row in result.records if row.tolerance_m == tolerance_m)

    found = PairedScene(job.scene_id, evaluate(ORACLE))
    for item in plan.choices:
        if item.setting == ORACLE:
            continue
        try:
            found.segmenters[item.name] = evaluate(item.setting)
        except (SceneFailure, ValueError) as error:
            found.failures[item.name] = f"{type(error).__name__}: {error}"
    return found


def losses(
    scenes: Sequence[PairedScene],
    *,
    choices: Sequence[Choice],
    failures: Mapping[str, str],
    tolerance_m: float,
    seed: int,
) -> Loss:
    """Hold every segmenter's records against the oracle's.

    Parameters
    ----------
    scenes
        In any order.
    choices
        Order of the segmenters.
    failures
        Why scenes are missing, by id.
    tolerance_m
        The tolerance of the records, metres.
    seed
        Of the resampling.
    """
    scenes = sorted(scenes, key=lambda scene: scene.scene_id)
    reasons = dict(failures)
    for scene in scenes:
        for name, reason in scene.failures.items():
            reasons[f"{scene.scene_id}, {name}"] = reason
    return Loss(
        tolerance_m=tolerance_m,
        rows=tuple(
            row
            for item in choices
            if item.setting != ORACLE
            for row in _rows(scenes, item.name, seed=seed)
        ),
        failures=dict(sorted(reasons.items())),
    )


def _rows(scenes: Sequence[PairedScene], segmenter: str, *, seed: int) -> Iterator[LossRow]:
    cells: defaultdict[tuple[str, str, str], list[tuple[Record, Record | None]]]
    cells = defaultdict(list)
    for scene in scenes:
        mine = {(row.model, row.completion): row for row in scene.segmenters.get(segmenter, ())}
        for row in scene.oracle:
            if row.status == "ok":
                partner = mine.get((row.model, row.completion))
                cells[row.category, row.completion, row.model].append((row, partner))

    def order(cell: tuple[str, str, str]) -> tuple[object, ...]:
        category, completion, model = cell
        number = MODEL_ORDER.index(model) if model in MODEL_ORDER else len(MODEL_ORDER)
        return (*cell_order(category, completion, classes=TABLE_CLASSES), number, model)

    for category, completion, model in sorted(cells, key=order):
        pairs = cells[category, completion, model]
        scored = [(true, row) for true, row in pairs if row is not None and row.status == "ok"]
        missed = sum(row is not None and row.target_missed for _, row in pairs)
        # A missed target is scored in the box, and failed where its completion would be asked.
        lost = sum(
            row is None or (row.status != "ok" and not row.target_missed) for _, row in pairs
        )
        objects = np.array([true.object_name for true, _ in scored], dtype=np.str_)
        yield LossRow(
            segmenter=segmenter,
            category=category,
            model=model,
            completion=completion,
            scenes=len(scored),
            objects=len(set(objects)),
            missed=missed,
            failed=lost,
            values={key: _paired(scored, key, objects=objects, seed=seed) for key in MEASURES},
        )


def _paired(
    scored: Sequence[tuple[Record, Record]],
    key: str,
    *,
    objects: np.ndarray,
    seed: int,
) -> PairedValue:
    values = np.array(
        [[_number(getattr(row, key)) for row in pair] for pair in scored], dtype=np.float64
    ).reshape(-1, 2)
    both = values[~np.isnan(values).any(axis=1)]
    oracle, segmenter = both.mean(axis=0).tolist() if len(both) else (None, None)
    less = mean_estimate(values[:, 1] - values[:, 0], objects=objects, seed=seed)
    return PairedValue(oracle, segmenter, less)


def _number(value: float | None) -> float:
    return np.nan if value is None else value
