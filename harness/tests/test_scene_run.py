"""One scene from frames to records, small enough for seconds."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from harness import scene_run
from harness.config import Config
from harness.protocol import box_test_points
from harness.runs.job import SceneJob
from harness.runs.records import METRICS, Record, Variant
from harness.scene_run import (
    SceneFailure,
    StageClock,
    category_probability,
    evaluate_scene,
    find_mapped,
    map_scene,
    run_scene,
    simulate_job,
    variants,
)

if TYPE_CHECKING:
    from harness.native import MappedObject, Pipeline
    from sim_scenes import Scene

CONFIG = Config.model_validate(
    {
        "scenes": {"width": 160, "height": 120},
        "protocol": {"test_points": 300},
        "pipeline": {"training": {"points": 240}, "gp": {"fit_points": 120}},
    }
)
JOB = SceneJob(scene_id="mug-0000", category="mug", object_name="mug_pybullet", seed=11)
CLUTTERED = replace(JOB, cluttered=True)

STAGES = ["truth", "score", "segment", "map", "training points", "fit", "posterior"]

DIGEST = """
from harness.scene_run import simulate_job
from harness.tests.test_scene_run import CONFIG, JOB, digest, evaluate
print(digest(evaluate(simulate_job(JOB, CONFIG))))
"""


def evaluate(scene: Scene, job: SceneJob = JOB, *, clock: StageClock | None = None) -> list[Record]:
    clock = clock or StageClock(job.scene_id)
    return evaluate_scene(scene, job=job, config=CONFIG, clock=clock)


def digest(records: list[Record]) -> str:
    """Hash of every field; repr of a float is exact."""
    return hashlib.blake2b(repr(records).encode(), digest_size=16).hexdigest()


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate_job(JOB, CONFIG)


@pytest.fixture(scope="module")
def records(scene: Scene) -> list[Record]:
    return evaluate(scene)


def test_records_are_complete(scene: Scene, records: list[Record]) -> None:
    assert [record.tolerance_m for record in records] == [0.0025, 0.005, 0.01]
    assert [record.variant for record in records] == [Variant("classic")] * 3
    for record in records:
        assert (record.status, record.failure) == ("ok", None)
        assert (record.scene_id, record.category, record.object_name, record.seed) == (
            "mug-0000",
            "mug",
            "mug_pybullet",
            11,
        )
        assert (record.views, record.test_points) == (3, 300)
        assert record.redraws == scene.redraw_count
        assert (record.object_training_points, record.free_training_points) == (120, 120)
        assert [name for name in METRICS if getattr(record, name) is None] == []
        assert (record.clamped_share, record.jitter) == (0.0, 0.0)
        for fits in (record.fits_unconverged, record.fits_at_bound):
            assert fits is not None
            assert 0 <= fits <= 2
        assert record.accuracy is not None
        assert record.random_aurc == pytest.approx(1 - record.accuracy, abs=1e-12)
        assert record.nearest_aurc is not None
        assert record.nearest_aurc < 1 - record.accuracy
        for scale in (record.lengthscale_m, record.lengthscale_free_m):
            assert scale is not None
            assert scale > 0


def test_a_wider_tolerance_finds_more_positives(records: list[Record]) -> None:
    counts = np.array([[r.tp, r.tn, r.fp, r.fn] for r in records])
    tp, tn, fp, fn = counts.T
    assert (counts.sum(axis=1) == 300).all()
    assert (np.diff(tp + fn) > 0).all()
    assert (np.diff(tp) >= 0).all()
    assert (np.diff(tn) <= 0).all()
    assert len(set(tp + fp)) == 1, "the predictions do not know the tolerance"


def test_a_classifier_is_better_than_chance(records: list[Record]) -> None:
    assert all(record.auroc is not None and record.auroc > 0.6 for record in records)


def test_under_the_oracle_the_confidence_is_the_probability(scene: Scene) -> None:
    pipeline = map_scene(scene, config=CONFIG)
    (item,) = pipeline.objects()
    training = pipeline.training_set(item.id, seed=JOB.seed)
    points = box_test_points(scene.objects[0], count=100, seed=JOB.seed)
    predictions = pipeline.classify(item.id, training, points)
    assert_array_equal(category_probability(predictions, "mug"), predictions.confidence)


def test_the_maps_voxels_carry_the_confidences(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    pipelines: list[Pipeline] = []

    def mapped_scene(scene: Scene, *, config: Config) -> Pipeline:
        pipelines.append(map_scene(scene, config=config))
        assert np.isnan(pipelines[0].voxels().confidence).all()
        return pipelines[0]

    monkeypatch.setattr(scene_run, "map_scene", mapped_scene)
    evaluate(scene)
    voxels = pipelines[0].voxels()
    known = voxels.confidence[~np.isnan(voxels.confidence)]
    assert len(known) > 20
    assert ((known >= 0) & (known <= 1)).all()
    assert set(voxels.object_ids[~np.isnan(voxels.confidence)]) == {1}


def test_the_same_scene_gives_the_same_bits(scene: Scene, records: list[Record]) -> None:
    assert digest(evaluate(scene)) == digest(records)


def test_the_number_of_threads_changes_no_bit(records: list[Record]) -> None:
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", DIGEST],
            env={**os.environ, "RAYON_NUM_THREADS": threads},
            stdout=subprocess.PIPE,
            text=True,
        )
        for threads in ("1", "2")
    ]
    digests = [process.communicate(timeout=60)[0].split()[-1] for process in processes]
    assert digests == [digest(records)] * 2


def test_every_stage_is_timed_once() -> None:
    result = run_scene(JOB, CONFIG)
    assert [timing.stage for timing in result.timings] == ["render", *STAGES]
    models = {timing.stage: timing.model for timing in result.timings}
    assert {stage for stage, model in models.items() if model == "classic"} == {
        "score",
        "fit",
        "posterior",
    }
    assert all(timing.seconds > 0 for timing in result.timings)
    assert len(result.records) == 3


def test_a_cluttered_scene_is_scored_too() -> None:
    scene = simulate_job(CLUTTERED, CONFIG)
    assert 2 <= len(scene.objects) <= 5
    assert scene.objects[0].name == "mug_pybullet"
    records = evaluate(scene, CLUTTERED)
    assert [record.status for record in records] == ["ok"] * 3
    assert all(record.auroc is not None for record in records)
    assert digest(evaluate(scene, CLUTTERED)) == digest(records)


def test_a_run_knows_its_variants_before_any_scene() -> None:
    assert variants(CONFIG) == [Variant("classic", completion="none", segmenter="oracle")]


def mapped(scene: Scene) -> list[MappedObject]:
    return map_scene(scene, config=CONFIG).objects()


def test_the_mapped_object_is_found_by_its_place_alone(scene: Scene) -> None:
    objects = mapped(scene)
    assert len(objects) == 1
    target = replace(scene.objects[0], category="bowl")
    assert find_mapped(objects, target).id == objects[0].id


def test_an_object_that_the_map_lacks_is_said(scene: Scene) -> None:
    target = scene.objects[0]
    with pytest.raises(
        SceneFailure, match="the map holds no object where mug_pybullet stands: it is empty"
    ):
        find_mapped([], target)
    pose = target.world_from_object.copy()
    pose[0, 3] += 0.5
    elsewhere = replace(target, world_from_object=pose)
    with pytest.raises(SceneFailure, match=r"stands: the nearest is 0\.(4|5)\d\d m off"):
        find_mapped(mapped(scene), elsewhere)


def test_a_target_that_no_mask_shows_fails_its_scene(scene: Scene) -> None:
    blank = np.zeros((120, 160), dtype=np.uint16)
    frames = tuple(replace(frame, instance_ids=blank) for frame in scene.frames)
    with pytest.raises(SceneFailure, match="where mug_pybullet stands: it is empty"):
        evaluate(replace(scene, frames=frames))
