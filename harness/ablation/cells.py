"""A scene under every cell of a grid: one job, so that a worker holds what the cells share."""

from __future__ import annotations

import time
import traceback
from functools import partial
from typing import TYPE_CHECKING

from harness.ablation.job import CellResults
from harness.runs.records import SceneResult, Timing
from harness.scene_run import evaluate_scene, simulate_job
from harness.stages.clock import StageClock, Times
from harness.stages.keys import StageKeys
from harness.stages.memo import Memo

if TYPE_CHECKING:
    from harness.ablation.job import CellScene, SceneCells
    from sim_scenes import Scene


def run_cells(job: SceneCells) -> CellResults:
    """Evaluate a scene under every cell; the workers' function.

    Cells of the same frames follow each other, and what they share is kept until the frames change.
    A cell that fails takes no other with it.
    """
    memo = Memo()
    results: dict[str, SceneResult] = {}
    failures: dict[str, str] = {}
    before = ""
    for part in sorted(job.parts, key=lambda part: StageKeys(part.config, part.job).scene):
        key = StageKeys(part.config, part.job).scene
        if key != before:
            memo.clear()
            before = key
        clock = StageClock(job.scene_id)
        try:
            scene = memo.get("render", key, partial(_render, part), clock=clock)
            found = evaluate_scene(scene, job=part.job, config=part.config, clock=clock, memo=memo)
        except Exception as error:
            traceback.print_exc()
            failures[part.cell] = " ".join(f"{type(error).__name__}: {error}".split())
            continue
        whole = sum(timing.seconds for timing in found.timings)
        timing = Timing(scene_id=job.scene_id, stage="scene", model=None, seconds=whole)
        results[part.cell] = SceneResult(
            found.records, [*found.timings, timing], found.confusion, found.recording
        )
    return CellResults(results, failures, dict(memo.computed))


def _render(part: CellScene) -> tuple[Scene, Times]:
    start = time.perf_counter()
    scene = simulate_job(part.job, part.config)
    return scene, (("render", None, time.perf_counter() - start),)
