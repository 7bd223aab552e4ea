"""Scene functions without a simulator, for tests of everything around them.

Their records are a function of the job alone. What goes wrong is told by files in the folder that
the environment variable FAKE_SCENES names, so that the configuration of a disturbed run equals
that of an undisturbed one.
"""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from harness.runs.confusion import Confusion
from harness.runs.job import SceneJob
from harness.runs.records import Record, SceneResult, Timing, Variant

if TYPE_CHECKING:
    from harness.config import Config

SCENE_FUNCTION = f"{__name__}:run_scene"
RECORDED_FUNCTION = f"{__name__}:recorded_scene"
VARIANTS_FUNCTION = f"{__name__}:variants"


@dataclass(frozen=True)
class FakeModel:
    name: str
    category: str
    path: Path = Path(__file__)


MODELS = [FakeModel(f"{category}_{i}", category) for category in ("mug", "bowl") for i in range(3)]


def variants(config: Config) -> list[Variant]:
    return [Variant("classic"), Variant("metric")]


def fake_record(
    job: SceneJob, *, variant: Variant, tolerance_m: float, views: int = 3, points: int = 1000
) -> Record:
    rng = np.random.default_rng([job.seed, len(variant.model)])
    tp, tn, fp = (int(n) for n in rng.integers(0, points // 3, size=3))
    return Record(
        scene_id=job.scene_id,
        category=job.category,
        object_name=job.object_name,
        seed=job.seed,
        model=variant.model,
        completion=variant.completion,
        segmenter=variant.segmenter,
        views=views,
        tolerance_m=tolerance_m,
        redraws=0,
        test_points=points,
        tp=tp,
        tn=tn,
        fp=fp,
        fn=points - tp - tn - fp,
        precision=tp / (tp + fp) if tp + fp else None,
        accuracy=(tp + tn) / points,
        auroc=float(rng.uniform()),
    )


def run_scene(job: SceneJob, config: Config) -> SceneResult:
    """The result of a scene, unless a file of the scene's name tells otherwise."""
    if (folder := os.environ.get("FAKE_SCENES")) is not None:
        _disturb(Path(folder) / job.scene_id)
    records = [
        fake_record(job, variant=variant, tolerance_m=tolerance_m, views=config.scenes.views)
        for variant in variants(config)
        for tolerance_m in config.protocol.tolerances_m
    ]
    timing = Timing(scene_id=job.scene_id, stage="render", model=None, seconds=0.5)
    return SceneResult(records, [timing], [row for item in records for row in fake_confusion(item)])


def recorded_scene(job: SceneJob, config: Config) -> SceneResult:
    """The same, with bytes that stand for a recording."""
    recording = np.random.default_rng(job.seed).bytes(5000)
    return replace(run_scene(job, config), recording=recording)


def fake_confusion(record: Record) -> list[Confusion]:
    """The confusion of a scene without neighbours."""
    names = ("free", record.category)
    cells = {(1, 1): record.tp, (0, 0): record.tn, (0, 1): record.fp, (1, 0): record.fn}
    return [
        Confusion(
            scene_id=record.scene_id,
            model=record.model,
            completion=record.completion,
            tolerance_m=record.tolerance_m,
            true=names[true],
            predicted=names[predicted],
            points=points,
        )
        for (true, predicted), points in cells.items()
        if points
    ]


def _disturb(order: Path) -> None:
    """Do what the file says: once if its first word is ``once``, and note that it was begun."""
    with (order.parent / "begun").open("a", encoding="utf-8") as begun:
        begun.write(f"{os.getpid()} {order.name}\n")
    if not order.exists():
        return
    words = order.read_text(encoding="utf-8").split()
    if words[0] == "once":
        order.unlink()
        words = words[1:]
    if words[0] == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    elif words[0] == "exit":
        raise SystemExit(3)
    elif words[0] == "raise":
        raise RuntimeError(f"no such luck\nin {order.name}")
    elif words[0] == "limits":
        raise RuntimeError(_thread_limits())
    elif words[0] == "sleep":
        time.sleep(60)
    elif words[0] == "wait":
        deadline = time.monotonic() + 60
        while order.exists() and time.monotonic() < deadline:
            time.sleep(0.02)


def begun(orders: Path) -> list[tuple[int, str]]:
    """Process and scene of every scene that was begun."""
    lines = (orders / "begun").read_text(encoding="utf-8").splitlines()
    return [(int(line.split()[0]), line.split()[1]) for line in lines]


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that ended may wait to be collected, where nobody does it."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except FileNotFoundError:
        return False
    return status.rpartition(")")[2].split()[0] != "Z"


def returns_nothing(job: SceneJob, config: Config) -> None:
    """Not a scene function."""


def thread_limits(job: SceneJob, config: Config) -> SceneResult:
    """The worker's thread limits, as the text of a failure."""
    raise RuntimeError(_thread_limits())


def _thread_limits() -> str:
    return " ".join(os.environ[name] for name in ("OMP_NUM_THREADS", "RAYON_NUM_THREADS"))


def foreign_records(job: SceneJob, config: Config) -> SceneResult:
    """Records of another scene."""
    other = SceneJob("other-0000", job.category, job.object_name, job.seed)
    return run_scene(other, config)


def lost_confusion(job: SceneJob, config: Config) -> SceneResult:
    """Records with a confusion that lacks its first row."""
    result = run_scene(job, config)
    return SceneResult(result.records, result.timings, result.confusion[1:])
