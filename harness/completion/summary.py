"""From the scenes' rows to the numbers of the report: means with intervals over objects.

Intervals are those of the benchmark's table (`harness.statistics`): objects are resampled with all
their scenes, and fewer than five give none; `POOLED` takes the classes together.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.completion.baselines import BASELINES
from harness.completion.handle import UNSEEN_SHARE, Outcome
from harness.completion.metrics import PARTS
from harness.statistics import MeanEstimate, mean_estimate

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from harness.completion.rows import Completer, SceneRows

POOLED = "all classes"
SCORES = ("chamfer_mm", "accuracy_mm", "completeness_mm", "f_5mm", "f_10mm", "within_5mm")
DIFFERENCES = ("chamfer_mm", "f_5mm", "f_10mm", "within_5mm")
SPREADS = ("spread_mm", "distance_mm", "right_mm", "wrong_mm", "auroc", "within_5mm_claimed")
HANDLES = ("distance_mm", "spread_at_handle_mm", "spread_made_mm", "spread_mm")
VIEWS = ("fused_mm", "best_mm", "mean_mm", "fused_less_best_mm", "fused_less_mean_mm")


@dataclass(frozen=True)
class Summary:
    """Means of one kind of row.

    Attributes
    ----------
    category
        A class, or `POOLED`.
    cloud
        Completer or baseline; in a difference, what is subtracted from.
    part
        Of the surface.
    less
        In a difference, what is subtracted; empty elsewhere.
    scenes, objects
        Number of scenes with such a row, and of their objects.
    values
        Mean and interval by name.
    """

    category: str
    cloud: str
    part: str
    less: str
    scenes: int
    objects: int
    values: Mapping[str, MeanEstimate]


@dataclass(frozen=True)
class HandleSummary:
    """What a completer made of the handles of mugs.

    Attributes
    ----------
    unseen
        Whether these are the handles of which less than `UNSEEN_SHARE` was seen, or the others.
    outcomes
        Number of scenes by outcome.
    means
        Distances and spreads over those scenes.
    """

    cloud: str
    unseen: bool
    outcomes: Mapping[str, int]
    means: Summary


@dataclass(frozen=True)
class Latency:
    """Time of a stage per frame, milliseconds.

    Attributes
    ----------
    objects
        Objects in the scene.
    """

    cloud: str
    stage: str
    objects: int
    scenes: int
    median_ms: float
    highest_ms: float


@dataclass(frozen=True)
class Report:
    """All that the report states.

    Attributes
    ----------
    unseen_share
        Mean share of the surface that no view saw, by class.
    clouds, differences
        By class, completer or baseline, and part of the surface.
    spreads, views
        By class and completer.
    uncompleted
        Number of scenes that a completer gave no cloud, by its name.
    """

    unseen_share: Mapping[str, float]
    clouds: tuple[Summary, ...]
    differences: tuple[Summary, ...]
    spreads: tuple[Summary, ...]
    handles: tuple[HandleSummary, ...]
    views: tuple[Summary, ...]
    latencies: tuple[Latency, ...]
    uncompleted: Mapping[str, int]


@dataclass(frozen=True)
class _Item:
    """Values of one scene, None where undefined."""

    object_name: str
    values: Mapping[str, float | None]


def summarise(
    scenes: Sequence[SceneRows],
    *,
    classes: Sequence[str],
    completers: Sequence[Completer],
    seed: int,
) -> Report:
    """Summarise the scenes' rows.

    Parameters
    ----------
    scenes
        In any order.
    classes
        Order of the classes.
    completers
        Order of the completers.
    seed
        Of the resampling.
    """
    scenes = sorted(scenes, key=lambda scene: scene.scene_id)
    names = [item.name for item in completers]
    groups = {
        category: [scene for scene in scenes if scene.category == category] for category in classes
    }
    groups = {category: members for category, members in groups.items() if members}
    if len(groups) > 1:
        groups[POOLED] = scenes
    means = _Means(seed)
    return Report(
        unseen_share={
            category: float(np.mean([scene.unseen_share for scene in members]))
            for category, members in groups.items()
        },
        clouds=tuple(
            means.over(_scores(members, cloud, part), SCORES, category, cloud, part=part)
            for category, members in groups.items()
            for cloud in (*names, *BASELINES)
            for part in PARTS
        ),
        differences=tuple(
            means.over(
                _less(_scores(members, cloud, part), _scores(members, other, part)),
                DIFFERENCES,
                category,
                cloud,
                part=part,
                less=other,
            )
            for category, members in groups.items()
            for cloud, other in _pairs(completers)
            for part in PARTS
        ),
        spreads=tuple(
            means.over(
                {
                    scene.scene_id: _Item(scene.object_name, asdict(scene.spreads[cloud]))
                    for scene in members
                    if cloud in scene.spreads
                },
                SPREADS,
                category,
                cloud,
            )
            for category, members in groups.items()
            for cloud in names
        ),
        handles=tuple(
            summary for cloud in names for summary in _handles(scenes, cloud, means=means)
        ),
        views=tuple(
            means.over(found, VIEWS, category, cloud)
            for category, members in groups.items()
            for cloud in names
            if (found := _views(members, cloud))
        ),
        latencies=tuple(_latencies(scenes, names)),
        uncompleted=dict(Counter(name for scene in scenes for name in scene.uncompleted)),
    )


@dataclass(frozen=True)
class _Means:
    seed: int

    def over(
        self,
        items: Mapping[str, _Item],
        keys: Iterable[str],
        category: str,
        cloud: str,
        *,
        part: str = "all",
        less: str = "",
    ) -> Summary:
        """Average the scenes' values."""
        objects = np.array([item.object_name for item in items.values()], dtype=np.str_)
        values = {}
        for key in keys:
            cells = [item.values[key] for item in items.values()]
            numbers = np.array([np.nan if cell is None else cell for cell in cells], np.float64)
            values[key] = mean_estimate(numbers, objects=objects, seed=self.seed)
        return Summary(category, cloud, part, less, len(items), len(set(objects)), values)


def _pairs(completers: Sequence[Completer]) -> list[tuple[str, str]]:
    """Completer and what it is held against: the baselines, itself unrefined, the next one."""
    refined = [item for item in completers if item.refine]
    names = {item.name for item in completers}
    pairs = [(item.name, other) for item in refined for other in BASELINES]
    pairs += [
        (item.name, plain)
        for item in refined
        if (plain := type(item)(item.setting, refine=False).name) in names
    ]
    return pairs + [(refined[0].name, other.name) for other in refined[1:]]


def _scores(scenes: Sequence[SceneRows], cloud: str, part: str) -> dict[str, _Item]:
    return {
        scene.scene_id: _Item(scene.object_name, asdict(row.score))
        for scene in scenes
        for row in scene.clouds
        if (row.cloud, row.part) == (cloud, part)
    }


def _less(first: Mapping[str, _Item], second: Mapping[str, _Item]) -> dict[str, _Item]:
    """Differences of the scenes that both have."""
    found = {}
    for scene_id in first.keys() & second.keys():
        mine, other = first[scene_id], second[scene_id]
        found[scene_id] = _Item(
            mine.object_name,
            {key: _difference(mine.values[key], other.values[key]) for key in DIFFERENCES},
        )
    return {scene_id: found[scene_id] for scene_id in sorted(found)}


def _difference(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else first - second


def _handles(scenes: Sequence[SceneRows], cloud: str, *, means: _Means) -> Iterable[HandleSummary]:
    for unseen in (True, False):
        rows = {
            scene.scene_id: (scene.object_name, row)
            for scene in scenes
            for row in scene.handles
            if row.cloud == cloud and (row.seen_share < UNSEEN_SHARE) == unseen
        }
        if rows:
            counts = Counter(row.outcome for _, row in rows.values())
            items = {key: _Item(name, asdict(row)) for key, (name, row) in rows.items()}
            yield HandleSummary(
                cloud=cloud,
                unseen=unseen,
                outcomes={outcome.value: counts[outcome.value] for outcome in Outcome},
                means=means.over(items, HANDLES, "mug", cloud),
            )


def _views(scenes: Sequence[SceneRows], cloud: str) -> dict[str, _Item]:
    return {
        scene.scene_id: _Item(
            scene.object_name,
            {
                "fused_mm": row.fused_mm,
                "best_mm": row.best_mm,
                "mean_mm": row.mean_mm,
                "fused_less_best_mm": row.fused_mm - row.best_mm,
                "fused_less_mean_mm": row.fused_mm - row.mean_mm,
            },
        )
        for scene in scenes
        for row in scene.views
        if row.cloud == cloud
    }


def _latencies(scenes: Sequence[SceneRows], names: Sequence[str]) -> Iterable[Latency]:
    times: defaultdict[tuple[str, int, str], list[float]] = defaultdict(list)
    for scene in scenes:
        for row in scene.latencies:
            times[row.cloud, row.objects, row.stage].append(row.milliseconds)
    # Stages keep the order in which they ran.
    for cloud, objects, stage in sorted(times, key=lambda key: (names.index(key[0]), key[1])):
        found = times[cloud, objects, stage]
        yield Latency(
            cloud, stage, objects, len(found), float(np.median(found)), float(np.max(found))
        )
