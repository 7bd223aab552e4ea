"""A segmenter's best, median and worst frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.scene_run import simulate_job
from harness.segmentation.masks import decode
from harness.segmentation.pictures import Instance, draw_instances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.config import Config
    from harness.cubes import Picture
    from harness.runs.job import SceneJob
    from harness.segmentation.numbers import FrameQuality, Report
    from harness.segmentation.rows import SceneRows

SHOWN = 3
"""Frames of each kind, each of another scene."""


def choose_frames(qualities: Sequence[FrameQuality]) -> dict[str, list[FrameQuality]]:
    """Choose the best, the median and the worst frames, each kind best first."""
    ordered = sorted(qualities, key=lambda item: (-item.quality, item.scene_id, item.frame))
    middle = len(ordered) // 2
    # From the median outwards, to either side in turn.
    outwards = sorted(range(len(ordered)), key=lambda place: (abs(place - middle), place))
    kinds = {
        "best": ordered,
        "median": [ordered[place] for place in outwards],
        "worst": ordered[::-1],
    }
    chosen = {}
    for kind, items in kinds.items():
        first: dict[str, FrameQuality] = {}
        for item in items:
            first.setdefault(item.scene_id, item)
        some = list(first.values())[:SHOWN]
        chosen[kind] = sorted(some, key=lambda item: -item.quality)
    return chosen


def sheet_rows(
    report: Report,
    scenes: Sequence[SceneRows],
    *,
    segmenter: str,
    jobs: Sequence[SceneJob],
    config: Config,
) -> list[list[tuple[Picture, str]]]:
    """Draw the chosen frames with what the map would take of them; a row for each kind.

    Scenes are simulated again, which costs less than to keep every image of every scene.
    """
    by_id = {scene.scene_id: scene for scene in scenes}
    job_of = {job.scene_id: job for job in jobs}
    chosen = choose_frames([item for item in report.qualities if item.segmenter == segmenter])
    rows = []
    for kind, items in chosen.items():
        row = []
        for item in items:
            simulated = simulate_job(job_of[item.scene_id], config).frames[item.frame]
            frame = by_id[item.scene_id].frames[item.frame]
            picture = draw_instances(
                simulated.rgb,
                [
                    Instance(decode(found.mask), found.category, found.score)
                    for found in frame.found[segmenter]
                    if found.score >= report.least_score
                ],
                true_masks=[decode(truth.mask) for truth in frame.truths],
            )
            row.append((picture, f"{kind}: {item.scene_id}, view {item.frame}, {item.quality:.2f}"))
        rows.append(row)
    return rows
