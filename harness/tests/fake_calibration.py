"""Recorded runs without a simulator, for tests of what is read from them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harness.config import Config, ProtocolSection, RunSection
from harness.native import CLASS_NAMES
from harness.recordings.file import encode
from harness.recordings.recording import (
    MappedCloud,
    ModelAnswers,
    RecordedVoxels,
    Recording,
    TestSetPart,
    TrueObject,
)
from harness.runs.job import SceneJob
from harness.runs.opening import open_run
from harness.runs.records import Record, SceneResult, Variant, write_records
from harness.tests.fake_scenes import fake_record

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from pathlib import Path

    from harness.config import Category
    from harness.runs.directory import RunDirectory

SEGMENTER_SCORE = 0.9


def answers(
    *,
    category: str,
    confidence: Sequence[float],
    variance: Sequence[float] | None = None,
    predicted: Sequence[bool] | None = None,
) -> ModelAnswers:
    """Answers whose probability is 0.9 of the confidence; on the object from 0.5, unless told."""
    values = np.array(confidence)
    spread = np.zeros(len(values)) if variance is None else np.array(variance)
    on_object = values >= 0.5 if predicted is None else np.array(predicted)
    width = np.ptp(spread) or 1.0
    return ModelAnswers(
        classes=np.where(on_object, CLASS_NAMES.index(category), 0).astype(np.uint8),
        probability=0.9 * values,
        recalibrated=values,
        confidence=values,
        score=SEGMENTER_SCORE * (spread.max(initial=0.0) - spread) / width,
        variance=spread,
    )


def recording(
    scene_id: str,
    *,
    object_name: str,
    truth: Sequence[bool],
    models: Mapping[str, ModelAnswers],
    category: str = "mug",
    box: int | None = None,
    missed: bool = False,
) -> Recording:
    """A scene whose true points lie 1 mm from the mesh and the others 8 mm.

    Parameters
    ----------
    truth : (n,) bool
        Whether each point lies on the mesh.
    box
        How many points are the box's, by default all; the rest are the completer's.
    missed
        Whether the map does not hold the target.
    """
    count = len(truth)
    box = count if box is None else box
    parts = [("none", slice(0, box)), ("cloud", slice(box, count))]
    return Recording(
        scene_id=scene_id,
        category=category,
        seed=1,
        segmenter="oracle",
        completer="cloud",
        views=(),
        objects=(
            TrueObject(
                instance_id=1,
                name=object_name,
                category=category,
                vertices_world=np.eye(3, dtype=np.float32),
                faces=np.array([[0, 1, 2]], dtype=np.int32),
            ),
        ),
        tracked=(
            MappedCloud(
                id=1,
                category=category,
                score=SEGMENTER_SCORE,
                centroid_world=np.zeros(3),
                observed_world=np.zeros((1, 3), np.float32),
                completed_world=np.zeros((0, 3), np.float32),
                spread_m=np.zeros(0, np.float32),
            ),
        ),
        target_id=None if missed else 1,
        voxels=RecordedVoxels(
            size_m=0.005,
            centres_world=np.zeros((0, 3), np.float32),
            rgb=np.zeros((0, 3), np.uint8),
            classes=np.zeros(0, np.uint8),
            object_ids=np.zeros(0, np.uint32),
            confidence=np.zeros(0, np.float32),
            first_view=np.zeros(0, np.uint8),
        ),
        training_world=np.zeros((0, 3), np.float32),
        training_classes=np.zeros(0, np.uint8),
        test_world=np.zeros((count, 3), np.float32),
        test_sets=tuple(TestSetPart(completion=name, part=part) for name, part in parts),
        distances_m=np.where(np.array(truth), 0.001, 0.008)[np.newaxis],
        # Ever farther from the data.
        data_distance_m=np.full(count, np.inf) if missed else np.arange(count) / 1000.0,
        completer_confidence=np.ones(count),
        answers=models,
    )


def recorded_run(
    folder: Path,
    recordings: Sequence[Recording],
    *,
    classes: Sequence[Category] = ("mug", "bowl"),
    finished: bool = True,
    contents: Mapping[str, str] | None = None,
    failed: Collection[str] = (),
) -> RunDirectory:
    """Write a run of these scenes.

    Parameters
    ----------
    contents
        By object, what stands for the hash of its file; by default its name.
    failed
        Scenes that failed in the last sitting, and whose recordings are an earlier one's.
    """
    config = Config(
        run=RunSection(scenes=max(len(recordings), 1), classes=tuple(classes)),
        protocol=ProtocolSection(tolerances_m=(0.005,)),
    )
    names = {(item.category, item.target.name) for item in recordings}
    run = open_run(
        folder,
        config=config,
        objects=[
            f"{category}/{name} sha256:{(contents or {}).get(name, name)}"
            for category, name in sorted(names)
        ],
    )
    records = []
    for item in recordings:
        job = SceneJob(item.scene_id, item.category, item.target.name, item.seed)
        of_scene = [fake_record(job, variant=Variant("metric"), tolerance_m=0.005)]
        run.keep(job, SceneResult(of_scene, recording=encode(item)))
        if item.scene_id in failed:
            (folder / "scenes" / f"{item.scene_id}.json").unlink()
            of_scene = [
                Record.failed(
                    job, variant=Variant("metric"), views=3, tolerance_m=0.005, failure="no arm"
                )
            ]
        records += of_scene
    if finished:
        write_records(records, run.records_path)
    return run
