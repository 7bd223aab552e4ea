"""A finished run in miniature for tests of its report: mugs and bowls, one failed, one missed."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.config import Config, ProtocolSection, RunSection
from harness.native import CLASS_NAMES
from harness.recordings.file import encode
from harness.recordings.recording import (
    MappedCloud,
    ModelAnswers,
    RecordedDetection,
    RecordedView,
    RecordedVoxels,
    Recording,
    TestSetPart,
    TrueObject,
)
from harness.runs.job import SceneJob
from harness.runs.opening import open_run
from harness.runs.records import (
    Record,
    SceneResult,
    Timing,
    Variant,
    write_records,
    write_timings,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

HOSTILE = (
    "</script><script>window.hacked = 1</script><img src=x onerror=\"window.hacked = 1\"> & 'so'"
)
"""A failure that would run as a script where it is not escaped."""

MODELS = ("metric", "classic_tuned", "nearest")
COMPLETIONS = ("none", "cloud")
OBJECTS = 6
"""Of each class, each in one scene: just enough for a test of signs."""

PRECISIONS = {"metric": 0.9, "classic_tuned": 0.7, "nearest": 0.8}
AURCS = {"metric": 0.1, "classic_tuned": 0.3, "nearest": 0.2}
FAILED, MISSED = "bowl-0005", "bowl-0004"


def job(category: str, index: int) -> SceneJob:
    return SceneJob(f"{category}-{index:04d}", category, f"{category}_{index}", index)


def record(scene: SceneJob, *, model: str, completion: str, **change: Any) -> Record:
    """A record whose precision falls, and whose AURC rises, by a hundredth from scene to scene."""
    whole: dict[str, Any] = {
        "scene_id": scene.scene_id,
        "category": scene.category,
        "object_name": scene.object_name,
        "seed": scene.seed,
        "model": model,
        "completion": completion,
        "segmenter": "oracle",
        "views": 1,
        "tolerance_m": 0.005,
        "redraws": 0,
        "test_points": 8,
        "tp": 3,
        "tn": 3,
        "fp": 1,
        "fn": 1,
        "base_rate": 0.5,
        "precision": PRECISIONS[model] - scene.seed / 100,
        "recall": 0.75,
        "accuracy": 0.75,
        "auroc": 1.0 - AURCS[model],
        "aurc": AURCS[model] + scene.seed / 100,
        "ece": AURCS[model],
        "log_loss": AURCS[model],
    }
    return Record(**(whole | change))


def scene_records(scene: SceneJob) -> list[Record]:
    """A scene's records; of the failed one, and of the missed one's completion, failures."""
    made = []
    for completion in COMPLETIONS:
        for model in MODELS:
            if scene.scene_id == FAILED or (scene.scene_id == MISSED and completion == "cloud"):
                why = HOSTILE if scene.scene_id == FAILED else "the target was missed"
                item = Record.failed(
                    scene,
                    variant=Variant(model, completion),
                    views=1,
                    tolerance_m=0.005,
                    failure=why,
                    target_missed=scene.scene_id == MISSED,
                )
            else:
                missed = scene.scene_id == MISSED
                item = record(scene, model=model, completion=completion, target_missed=missed)
            made.append(item)
    return made


def answers(confidence: Sequence[float], *, category: str) -> ModelAnswers:
    """Answers that put a point on the object from a confidence of 0.5 on."""
    values = np.array(confidence)
    return ModelAnswers(
        classes=np.where(values >= 0.5, CLASS_NAMES.index(category), 0).astype(np.uint8),
        probability=values,
        recalibrated=values,
        confidence=values,
        score=values,
        variance=1.0 - values,
    )


def recording(scene: SceneJob) -> Recording:
    """A block 10 cm wide, seen from above, with eight points of the box and eight completed ones.

    Every other point lies on it; the metric model is right of them all.
    """
    ids = np.zeros((48, 64), dtype=np.uint16)
    ids[16:32, 20:44] = 1
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.1
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    faces += [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    on_mesh = np.tile([True, False], 8)
    points = np.where(on_mesh, 0.1, 0.15)[:, None] * np.array([1.0, 0.5, 0.5])
    points[:, 1] = np.linspace(0.0, 0.1, 16)
    right = np.where(on_mesh, 0.95, 0.05)
    missed = scene.scene_id == MISSED
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = (0.3, 0.3, 0.6)
    keys = np.array([[x, y, 0] for x in range(20) for y in range(20)])
    by_model = {
        "metric": answers(right.tolist(), category=scene.category),
        "classic_tuned": answers((0.25 + right / 2).tolist(), category=scene.category),
        "nearest": answers(np.full(16, 0.6).tolist(), category=scene.category),
    }
    return Recording(
        scene_id=scene.scene_id,
        category=scene.category,
        seed=scene.seed,
        segmenter="oracle",
        completer="cloud",
        views=(
            RecordedView(
                rgb=np.full((48, 64, 3), 90, dtype=np.uint8),
                depth_m=np.full((48, 64), 0.5, dtype=np.float32),
                true_ids=ids,
                found=np.zeros((48, 64), np.uint8) if missed else (ids > 0).astype(np.uint8),
                detections=()
                if missed
                else (RecordedDetection(category=scene.category, score=0.75, object_id=1),),
                intrinsics=np.array([60.0, 60.0, 31.5, 23.5]),
                world_from_camera=pose,
                joint_positions_rad=None,
                tracked=(),
            ),
        ),
        objects=(
            TrueObject(
                instance_id=1,
                name=scene.object_name,
                category=scene.category,
                vertices_world=corners.astype(np.float32),
                faces=np.array(faces, dtype=np.int32),
            ),
        ),
        tracked=()
        if missed
        else (
            MappedCloud(
                id=1,
                category=scene.category,
                score=0.75,
                centroid_world=np.full(3, 0.05),
                observed_world=points.astype(np.float32),
                completed_world=points.astype(np.float32),
                spread_m=np.zeros(16, np.float32),
            ),
        ),
        target_id=None if missed else 1,
        voxels=RecordedVoxels(
            size_m=0.005,
            centres_world=((keys + 0.5) * 0.005).astype(np.float32),
            rgb=np.zeros((400, 3), np.uint8),
            classes=np.full(400, CLASS_NAMES.index(scene.category), np.uint8),
            object_ids=np.ones(400, np.uint32),
            confidence=np.ones(400, np.float32),
            first_view=np.zeros(400, np.uint8),
        ),
        training_world=np.zeros((0, 3), np.float32),
        training_classes=np.zeros(0, np.uint8),
        test_world=points.astype(np.float32),
        test_sets=(
            TestSetPart(completion="none", part=slice(0, 8)),
            TestSetPart(completion="cloud", part=slice(8, 8 if missed else 16)),
        ),
        distances_m=np.where(on_mesh, 0.001, 0.05)[None],
        data_distance_m=np.full(16, 0.01),
        completer_confidence=np.ones(16),
        answers=by_model,
    )


@dataclass(frozen=True)
class FakeRun:
    """A run's folder and what was written into it."""

    folder: Path
    records: list[Record]


def write_run(
    folder: Path, *, record_scenes: bool = True, precision: float = 0.0, objects: int = OBJECTS
) -> FakeRun:
    """Write a finished run.

    Parameters
    ----------
    record_scenes
        Whether scenes that did not fail have recordings.
    precision
        Added to the precision of all.
    objects
        Scenes of each class, each of its own object.
    """
    config = Config(
        run=RunSection(scenes=objects, seed=3),
        protocol=ProtocolSection(tolerances_m=(0.005,)),
        pipeline={"segmenter": "oracle"},
    )
    run = open_run(folder, config=config, objects=["mug/m sha256:0"])
    jobs = [job(category, index) for category in ("mug", "bowl") for index in range(objects)]
    records, timings = [], []
    for item in jobs:
        of_scene = [
            replace(row, precision=row.precision + precision) if row.precision else row
            for row in scene_records(item)
        ]
        records += of_scene
        if item.scene_id != FAILED:
            data = encode(recording(item)) if record_scenes else None
            run.keep(item, SceneResult(of_scene, recording=data))
            timings += [
                Timing(scene_id=item.scene_id, stage="render", model=None, seconds=1.0 + item.seed),
                Timing(scene_id=item.scene_id, stage="fit", model="metric", seconds=2.0),
                Timing(
                    scene_id=item.scene_id,
                    stage="scene",
                    model=None,
                    seconds=4.0 + item.seed,
                    peak_memory_mib=100.0 + item.seed,
                ),
            ]
    write_records(records, run.records_path)
    write_timings(timings, run.timings_path)
    manifest = run.manifest() | {"sessions": [session()]}
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    return FakeRun(folder, records)


def session() -> dict[str, Any]:
    return {
        "started": "2030-01-01T00:00:00+00:00",
        "git": {"revision": "0123abc", "dirty": True},
        "python": "3.11.7",
        "packages": {"numpy": "2.4.6", "credence": "0.1.0"},
        "machine": {"system": "Linux", "cpu": "Fast", "cores": 2, "memory_mib": 1000},
    }
