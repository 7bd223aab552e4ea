"""From the scenes' instances to the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harness.segmentation.numbers import CLUTTERED, POOLED, SINGLE, Latency, Report
from harness.segmentation.view import View

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from harness.segmentation.rows import Choice, SceneRows, TimedScene


def summarise(
    scenes: Sequence[SceneRows],
    timed: Sequence[TimedScene],
    *,
    choices: Sequence[Choice],
    least_score: float,
    seed: int,
) -> Report:
    """Summarise the scenes.

    Parameters
    ----------
    scenes, timed
        In any order.
    choices
        Order of the segmenters.
    least_score
        From which on the map takes detections.
    seed
        Of the resampling.
    """
    scenes = sorted(scenes, key=lambda scene: scene.scene_id)
    groups = {
        SINGLE: [scene for scene in scenes if not scene.cluttered],
        CLUTTERED: [scene for scene in scenes if scene.cluttered],
        POOLED: scenes,
    }
    groups = {name: members for name, members in groups.items() if members}
    views = [
        View(
            segmenter=item.name,
            group=name,
            scenes=members,
            least_score=least_score,
            seed=seed,
        )
        for item in choices
        for name, members in groups.items()
    ]
    temperatures = {key: value for scene in scenes for key, value in scene.temperatures.items()}
    return Report(
        scenes={name: len(members) for name, members in groups.items()},
        frames={
            name: sum(len(scene.frames) for scene in members) for name, members in groups.items()
        },
        least_score=least_score,
        temperatures=dict(sorted(temperatures.items())),
        precisions=tuple(row for view in views for row in view.precisions()),
        findings=tuple(row for view in views for row in view.findings()),
        false_finds=tuple(view.false_finds() for view in views),
        confusions=tuple(view.confusion() for view in views),
        calibrations=tuple(row for view in views for row in view.calibrations()),
        qualities=tuple(row for view in views if view.group == POOLED for row in view.qualities()),
        latencies=tuple(_latencies(timed, choices)),
    )


def _latencies(timed: Sequence[TimedScene], choices: Sequence[Choice]) -> Iterable[Latency]:
    for item in choices:
        times = [time for scene in timed for time in scene.milliseconds[item.name]]
        if times:
            yield Latency(
                item.name,
                len(times),
                float(np.median(times)),
                float(np.percentile(times, 95)),
            )
