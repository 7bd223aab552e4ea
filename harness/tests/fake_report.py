"""A scene of the completion report without a simulator, for tests of what is done with it."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from harness.completion.baselines import BASELINES
from harness.completion.metrics import PARTS, score_distances
from harness.completion.rows import CloudRow, SceneRows
from harness.pictures import write_picture

if TYPE_CHECKING:
    from harness.completion.scene import Plan
    from harness.config import Config
    from harness.runs.job import SceneJob

SCENE_FUNCTION = f"{__name__}:score_scene"


def score_scene(job: SceneJob, config: Config, plan: Plan) -> SceneRows:
    """Rows that a scene's seed decides; a file of the scene's name tells what goes wrong."""
    orders = Path(os.environ.get("FAKE_SCENES", os.devnull))
    with (orders / "begun").open("a", encoding="utf-8") as begun:
        begun.write(f"{os.getpid()} {job.scene_id}\n")
    if (orders / job.scene_id).exists():
        word = (orders / job.scene_id).read_text(encoding="utf-8")
        if word == "sleep":
            time.sleep(60)
        raise RuntimeError(word)
    picture = np.full((9, 12, 3), job.seed % 256, dtype=np.uint8)
    write_picture(plan.pictures / f"{job.scene_id}.png", picture)
    distances = np.random.default_rng(job.seed).uniform(0.0, 0.01, size=40)
    return SceneRows(
        scene_id=job.scene_id,
        category=job.category,
        object_name=job.object_name,
        unseen_share=0.5,
        clouds=tuple(
            CloudRow(name, part, score_distances(distances, distances + number / 1000))
            for number, name in enumerate([*(c.name for c in plan.completers), *BASELINES])
            for part in PARTS
        ),
    )
