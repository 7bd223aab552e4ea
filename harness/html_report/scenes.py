"""Which scenes went worst, and the numbers of each."""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from harness.html_report.names import clipped, model_order, plain, set_label
from harness.table.cells import millimetres
from harness.table.columns import columns_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.html_report.pictures import ScenePicture
    from harness.runs.records import Record

MOST_WORST, MOST_MEDIAN = 12, 4
"""How many scenes have pictures, shared among the classes."""
MOST_SCENES, MOST_ROWS = 3000, 36_000
"""How many scenes the picker holds, and of how many rows: the worst."""
MEASURES = columns_of(
    "base_rate", "precision", "recall", "accuracy", "auroc", "aurc", "ece", "ece_recalibrated"
)
"""What the picker shows of each model and test set."""

FAILED, MISSED, SCORED = "failed", "target missed", "scored"
_SEVERITY = {FAILED: 0, MISSED: 1, SCORED: 2}


@dataclass(frozen=True)
class RankedScene:
    """A scene in the order of the worst.

    Attributes
    ----------
    state
        ``failed`` where no record of it has a number, ``target missed``, or ``scored``.
    loss
        AURC of the model that scenes are ranked by, the mean over its test sets; None where none
        is defined.
    group
        ``worst`` or ``median`` where it is one to be shown in pictures, else its class.
    records
        At the reported tolerance.
    """

    scene_id: str
    category: str
    state: str
    loss: float | None
    group: str
    records: Sequence[Record]


def ranking_rule(model: str, *, tolerance_m: float) -> str:
    """Say how scenes are ranked."""
    return (
        f"Worst are the failed scenes, then those whose target was missed, then the others by the "
        f"{plain(model)} model's AURC at {millimetres(tolerance_m)}, mean over the test "
        f"sets; pictures show up to {MOST_WORST} of them, evenly from the classes and no more than "
        f"half of each, and about {MOST_MEDIAN} scored ones from the classes' middles."
    )


def rank_scenes(records: Sequence[Record], *, model: str) -> list[RankedScene]:
    """Order a run's scenes by how badly they went, by the rule of `ranking_rule`.

    Parameters
    ----------
    records
        At the reported tolerance.
    model
        Whose AURC ranks the scored scenes.
    """
    scenes: defaultdict[str, list[Record]] = defaultdict(list)
    for record in records:
        scenes[record.scene_id].append(record)
    ranked = [_ranked(scene_id, items, model=model) for scene_id, items in scenes.items()]
    ranked.sort(key=_badness)
    groups = _groups(ranked)
    return [
        RankedScene(
            scene_id=item.scene_id,
            category=item.category,
            state=item.state,
            loss=item.loss,
            group=groups.get(item.scene_id, item.group),
            records=item.records,
        )
        for item in ranked
    ]


def _ranked(scene_id: str, records: Sequence[Record], *, model: str) -> RankedScene:
    losses = [r.aurc for r in records if r.model == model and r.aurc is not None]
    state = SCORED
    if any(record.target_missed for record in records):
        state = MISSED
    elif all(record.status == "failed" for record in records):
        state = FAILED
    category = records[0].category
    return RankedScene(
        scene_id=scene_id,
        category=category,
        state=state,
        loss=sum(losses) / len(losses) if losses else None,
        group=category,
        records=records,
    )


def _badness(item: RankedScene) -> tuple[int, float, str]:
    """Sort the worst first; a scene without a loss, of no worse state, last."""
    return (_SEVERITY[item.state], 0.0 if item.loss is None else -item.loss, item.scene_id)


def _groups(ranked: Sequence[RankedScene]) -> dict[str, str]:
    """Choose the worst scenes and those about the middle, of each class as many."""
    classes: defaultdict[str, list[RankedScene]] = defaultdict(list)
    for item in ranked:
        classes[item.category].append(item)
    worst = -(-MOST_WORST // len(classes)) if classes else 0
    median = -(-MOST_MEDIAN // len(classes)) if classes else 0
    groups: dict[str, str] = {}
    for items in classes.values():
        # Of a few scenes no more than half are the worst.
        most = min(worst, -(-len(items) // 2))
        groups |= dict.fromkeys((item.scene_id for item in items[:most]), "worst")
        scored = [item for item in items if item.state == SCORED]
        start = max(0, (len(scored) - median) // 2)
        middle = [item.scene_id for item in scored[start : start + median]]
        groups |= {scene_id: "median" for scene_id in middle if scene_id not in groups}
    return groups


def picker_size(ranked: Sequence[RankedScene]) -> int:
    """Count the scenes, from the worst on, that the picker has room for."""
    rows = itertools.accumulate(len(item.records) for item in ranked)
    return min(MOST_SCENES, sum(1 for _ in itertools.takewhile(lambda n: n <= MOST_ROWS, rows)))


def picker_data(
    ranked: Sequence[RankedScene],
    *,
    pictures: Mapping[str, Sequence[ScenePicture]],
    unpictured: str,
) -> dict[str, Any]:
    """Pack scenes for the page's picker: the worst, then the median, then all by class.

    Numbers are in thousandths, and names and failures stand once, so that thousands of scenes fit.
    """
    order = {"worst": 0, "median": 1}
    held = ranked[: picker_size(ranked)]
    shown = sorted(held, key=lambda item: (order.get(item.group, 2), item.group))
    models: dict[str, int] = {}
    sets: dict[str, int] = {}
    failures: dict[str, int] = {}
    scenes = []
    for item in shown:
        rows: list[list[Any]] = []
        for record in sorted(item.records, key=lambda r: (r.completion, model_order(r.model))):
            row: list[Any] = [
                models.setdefault(record.model, len(models)),
                sets.setdefault(record.completion, len(sets)),
            ]
            if record.failure is not None:
                rows.append([*row, failures.setdefault(clipped(record.failure), len(failures))])
                continue
            values = [column.value(record) for column in MEASURES]
            rows.append([*row, None, *(None if v is None else round(v * 1000) for v in values)])
        scenes.append(
            {"id": item.scene_id, "group": item.group, "about": _about(item), "rows": rows}
        )
    return {
        "measures": [column.heading for column in MEASURES],
        "models": [plain(name) for name in models],
        "sets": [set_label(name) for name in sets],
        "failures": list(failures),
        "scenes": scenes,
        "pictures": {
            scene_id: [{"caption": item.caption, "data": item.data} for item in items]
            for scene_id, items in pictures.items()
        },
        "unpictured": unpictured,
    }


def _about(item: RankedScene) -> str:
    first = item.records[0]
    loss = "" if item.loss is None else f"; ranked by {item.loss:.3f}"
    return (
        f"{item.category}, object {first.object_name}, seed {first.seed}, {first.views} views, "
        f"{item.state}{loss}"
    )
