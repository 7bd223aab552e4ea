"""One scene from frames to records, small enough for seconds."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from harness.config import Config
from harness.drawn_points import box_test_points, draw_test_points, surface_points
from harness.native import CLASS_NAMES, binary_metrics
from harness.protocol import COMPLETIONS
from harness.recordings.file import decode
from harness.runs.job import SceneJob
from harness.runs.records import METRICS, Record, SceneResult, Variant
from harness.scene_run import evaluate_scene, map_scene, run_scene, simulate_job, variants
from harness.scoring import Answers
from harness.stages.clock import StageClock
from harness.table.summary import MODEL_ORDER
from harness.truth import SceneFailure, TargetMissedError, find_mapped, mesh_truth

if TYPE_CHECKING:
    from harness.native import MappedObject, MeshTruth
    from harness.recordings.recording import Recording
    from sim_scenes import Scene, SceneObject

MODELS = list(MODEL_ORDER)
PROCESSES = MODELS[:4]
CONFIG = Config.model_validate(
    {
        "scenes": {"width": 160, "height": 120},
        "protocol": {"test_points": 300, "test_sets": ["box", "perturbed"]},
        "pipeline": {
            "completer": "none",
            "segmenter": "oracle",
            "training": {"points": 240},
            "gp": {"models": MODELS, "fit_points": 120},
            "recalibration": {"classic": {"slope": 1.0, "intercept": 0.0}},
        },
    }
)
JOB = SceneJob(scene_id="mug-0000", category="mug", object_name="mug_pybullet", seed=11)
CLUTTERED = replace(JOB, cluttered=True)

STAGES = [
    "segment",
    "map",
    "truth",
    "training points",
    "fit",
    "posterior",
    "score",
    "embed",
    "record",
]

DIGEST = """
from harness.scene_run import simulate_job
from harness.tests.test_scene_run import CONFIG, JOB, digest, evaluate
print(digest(evaluate(simulate_job(JOB, CONFIG))))
"""


def evaluate(scene: Scene, job: SceneJob = JOB) -> SceneResult:
    return evaluate_scene(scene, job=job, config=CONFIG, clock=StageClock(job.scene_id))


def digest(result: SceneResult) -> str:
    """Hash of every field but the times; repr of a float is exact."""
    text = repr((result.records, result.confusion))
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


@pytest.fixture(scope="module")
def scene() -> Scene:
    return simulate_job(JOB, CONFIG)


@pytest.fixture(scope="module")
def result(scene: Scene) -> SceneResult:
    return evaluate(scene)


@pytest.fixture(scope="module")
def records(result: SceneResult) -> list[Record]:
    return result.records


def of_completion(
    records: list[Record], completion: str, *, model: str = "classic"
) -> list[Record]:
    return [row for row in records if (row.completion, row.model) == (completion, model)]


def test_records_are_complete(scene: Scene, records: list[Record]) -> None:
    assert [record.key()[1:] for record in records] == [
        (model, completion, "oracle", tolerance_m)
        for model in MODELS
        for completion in ("none", "perturbed")
        for tolerance_m in (0.0025, 0.005, 0.01)
    ]
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
        undefined = [name for name in METRICS if getattr(record, name) is None]
        # Who calls every point object has no correlation with the truth.
        assert undefined == (["mcc"] if record.tn == record.fn == 0 else [])
        assert record.jitter == 0.0
        assert record.clamped_share == 0.0 or record.model == "metric_literal"
        assert record.gate == 1.0
        assert (record.ood is None) == (record.model not in ("metric", "network"))
        for fits in (record.fits_unconverged, record.fits_at_bound):
            assert fits is not None
            assert 0 <= fits <= 2
        assert record.accuracy is not None
        assert record.random_aurc == pytest.approx(1 - record.accuracy, abs=1e-12)
        assert record.nearest_aurc is not None
        assert record.tp is not None
        assert record.fn is not None
        assert record.base_rate == (record.tp + record.fn) / 300
        for scale in (record.lengthscale_m, record.lengthscale_free_m):
            assert (scale is None) == (record.model not in PROCESSES)
            assert scale is None or scale > 0


@pytest.mark.parametrize("completion", ["none", "perturbed"])
def test_a_wider_tolerance_finds_more_positives(records: list[Record], completion: str) -> None:
    counts = np.array([[r.tp, r.tn, r.fp, r.fn] for r in of_completion(records, completion)])
    tp, tn, fp, fn = counts.T
    assert (counts.sum(axis=1) == 300).all()
    assert (np.diff(tp + fn) > 0).all()
    assert (np.diff(tp) >= 0).all()
    assert (np.diff(tn) <= 0).all()
    assert len(set(tp + fp)) == 1, "the predictions do not know the tolerance"


def test_a_classifier_is_better_than_chance(records: list[Record]) -> None:
    for model in ("classic", "classic_tuned"):
        for record in of_completion(records, "none", model=model):
            assert record.auroc is not None
            assert record.auroc > 0.6


def test_literal_variances_are_clamped_in_each_test_set_by_itself(
    scene: Scene, records: list[Record]
) -> None:
    pipeline = map_scene(scene, config=CONFIG)
    (item,) = pipeline.objects()
    training = pipeline.training_set(item.id, seed=JOB.seed)
    for test_set, completion in COMPLETIONS.items():
        points = draw_test_points(scene.objects[0], test_set=test_set, count=300, seed=JOB.seed)
        alone = pipeline.classify(item.id, training, points, model="metric_literal")
        stated = of_completion(records, completion, model="metric_literal")
        assert {row.clamped_share for row in stated} == {alone.clamped_share}


def test_a_wrong_instance_lies_closer_to_the_mesh_than_the_box_does(records: list[Record]) -> None:
    box, perturbed = (of_completion(records, name)[-1] for name in ("none", "perturbed"))
    assert box.base_rate is not None
    assert perturbed.base_rate is not None
    assert box.base_rate < perturbed.base_rate < 1


def test_confusion_counts_what_the_records_count(result: SceneResult) -> None:
    for record in result.records:
        cells = {
            (row.true, row.predicted): row.points
            for row in result.confusion
            if row.result() == (record.model, record.completion, record.tolerance_m)
        }
        assert cells.get(("mug", "mug"), 0) == record.tp
        assert cells.get(("free", "mug"), 0) == record.fp
        assert sum(cells.values()) == record.test_points


def test_one_test_set_alone_is_the_same_as_beside_another(scene: Scene) -> None:
    alone = CONFIG.model_copy(
        update={"protocol": CONFIG.protocol.model_copy(update={"test_sets": ("perturbed",)})}
    )
    clock = StageClock(JOB.scene_id)
    found = evaluate_scene(scene, job=JOB, config=alone, clock=clock).records
    beside = [row for row in evaluate(scene).records if row.completion == "perturbed"]
    for mine, theirs in zip(found, beside, strict=True):
        assert (mine.tp, mine.tn, mine.fp, mine.fn) == (theirs.tp, theirs.tn, theirs.fp, theirs.fn)
        assert mine.model == theirs.model
        assert mine.log_loss == pytest.approx(theirs.log_loss, rel=1e-6)


def test_under_the_oracle_the_confidence_is_the_probability(scene: Scene) -> None:
    pipeline = map_scene(scene, config=CONFIG)
    (item,) = pipeline.objects()
    training = pipeline.training_set(item.id, seed=JOB.seed)
    points = box_test_points(scene.objects[0], count=100, seed=JOB.seed)
    predictions = pipeline.classify(item.id, training, points, model="classic")
    answers = Answers(predictions, slice(None))
    assert_array_equal(answers.probability("mug"), answers.confidence)


def test_the_recorded_voxels_carry_the_confidences(result: SceneResult) -> None:
    voxels = recording_of(result).voxels
    known = voxels.confidence[~np.isnan(voxels.confidence)]
    assert len(known) > 20
    assert ((known >= 0) & (known <= 1)).all()
    assert set(voxels.object_ids[~np.isnan(voxels.confidence)]) == {1}


def recording_of(result: SceneResult) -> Recording:
    assert result.recording is not None
    return decode(result.recording)


def test_the_recording_gives_the_records_again(result: SceneResult) -> None:
    recording = recording_of(result)
    for record in result.records:
        part = recording.part(record.completion)
        truth = recording.on_target(record.tolerance_m)[part]
        answers = recording.answers[record.model]
        predicted = answers.classes[part] == CLASS_NAMES.index("mug")
        confidence = answers.confidence[part]
        metrics = binary_metrics(
            predicted=predicted,
            truth=truth,
            probability=answers.probability[part],
            decision_confidence=np.where(predicted, confidence, 1 - confidence),
        )
        for name in ("tp", "fp", "precision", "auroc", "ece", "brier", "aurc", "nll"):
            assert metrics[name] == getattr(record, name)


def test_a_run_may_record_nothing(scene: Scene, result: SceneResult) -> None:
    section = CONFIG.run.model_copy(update={"record": "nothing"})
    config = CONFIG.model_copy(update={"run": section})
    bare = evaluate_scene(scene, job=JOB, config=config, clock=StageClock(JOB.scene_id))
    assert bare.recording is None
    assert digest(bare) == digest(result)


def test_the_same_scene_gives_the_same_bits(scene: Scene, result: SceneResult) -> None:
    assert digest(evaluate(scene)) == digest(result)


def test_the_number_of_threads_changes_no_bit(result: SceneResult) -> None:
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
    assert digests == [digest(result)] * 2


def test_fewer_views_look_at_the_same_scene(scene: Scene) -> None:
    once = CONFIG.model_copy(update={"scenes": CONFIG.scenes.model_copy(update={"views": 1})})
    fewer = simulate_job(JOB, once)
    assert (len(fewer.frames), len(scene.frames)) == (1, 3)
    assert fewer.redraw_count == scene.redraw_count
    for mine, theirs in zip(fewer.objects, scene.objects, strict=True):
        assert mine.name == theirs.name
        assert_array_equal(mine.world_from_object, theirs.world_from_object)
    # What a comparison of runs relies on: the points asked about are the same.
    rates = [
        evaluate_scene(item, job=JOB, config=config, clock=StageClock(JOB.scene_id))
        for item, config in ((fewer, once), (scene, CONFIG))
    ]
    assert [r.base_rate for r in rates[0].records] == [r.base_rate for r in rates[1].records]


def test_every_stage_is_timed_once() -> None:
    result = run_scene(JOB, CONFIG)
    stages = [(timing.stage, timing.model) for timing in result.timings]
    assert len(set(stages)) == len(stages)
    assert list(dict.fromkeys(stage for stage, _ in stages)) == ["render", *STAGES]
    of_classic = [timing.stage for timing in result.timings if timing.model == "classic"]
    assert sorted(of_classic) == ["fit", "posterior", "score"]
    assert all(timing.seconds > 0 for timing in result.timings)
    assert len(result.records) == 6 * len(MODELS)


def test_a_cluttered_scene_is_scored_too() -> None:
    scene = simulate_job(CLUTTERED, CONFIG)
    assert 2 <= len(scene.objects) <= 5
    assert scene.objects[0].name == "mug_pybullet"
    result = evaluate(scene, CLUTTERED)
    assert [record.status for record in result.records] == ["ok"] * 6 * len(MODELS)
    assert all(record.auroc is not None for record in result.records)
    assert digest(evaluate(scene, CLUTTERED)) == digest(result)
    known = {"free", *(item.category for item in scene.objects)}
    assert {row.true for row in result.confusion} <= known


def test_a_run_knows_its_variants_before_any_scene() -> None:
    assert variants(CONFIG) == [
        Variant(model, completion) for completion in ("none", "perturbed") for model in MODELS
    ]


def mapped(scene: Scene) -> list[MappedObject]:
    return map_scene(scene, config=CONFIG).objects()


def truths(*items: SceneObject) -> list[MeshTruth]:
    return [mesh_truth(item) for item in items]


def moved(item: SceneObject, *, x_m: float) -> SceneObject:
    pose = item.world_from_object.copy()
    pose[0, 3] += x_m
    return replace(item, world_from_object=pose)


def test_the_mapped_object_is_found_by_its_place_alone(scene: Scene) -> None:
    objects = mapped(scene)
    assert len(objects) == 1
    assert find_mapped(objects, truths(scene.objects[0]), name="mug").id == objects[0].id


def test_an_object_that_the_map_lacks_is_said(scene: Scene) -> None:
    target = scene.objects[0]
    with pytest.raises(
        SceneFailure, match="the map holds no object where mug_pybullet stands: it is empty"
    ):
        find_mapped([], truths(target), name=target.name)
    with pytest.raises(
        SceneFailure, match=r"stands: the points of the nearest are 0\.4\d\d m off in the median"
    ):
        find_mapped(mapped(scene), truths(moved(target, x_m=0.5)), name=target.name)


@dataclass(frozen=True)
class FakeMapped:
    """A mapped object of which only the points are asked."""

    id: int
    points_world: np.ndarray


def test_what_is_beside_the_target_does_not_stand_for_it(scene: Scene) -> None:
    target = scene.objects[0]
    vertices, faces = target.mesh_world()
    on_it = surface_points(vertices, faces, count=400, random=np.random.default_rng(0))
    neighbour = moved(target, x_m=0.004)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    # A piece of the table around the target's foot: its centre lies within the target.
    table = np.random.default_rng(1).uniform(low - 0.05, high + 0.05, size=(400, 3))
    table[:, 2] = low[2]
    whole, twice = FakeMapped(1, on_it[:100]), FakeMapped(2, on_it)
    mixed = FakeMapped(3, np.concatenate([on_it[:190], table[:210] - (0, 0, 0.02)]))

    def find(*items: FakeMapped, objects: tuple[SceneObject, ...] = (target,)) -> int:
        return find_mapped(items, truths(*objects), name="it").id  # type: ignore[arg-type]

    assert find(FakeMapped(4, table), whole, mixed) == 1
    assert find(whole, twice, mixed) == 2
    for items in ((FakeMapped(4, table),), (mixed,), (FakeMapped(5, np.zeros((0, 3))),)):
        with pytest.raises(TargetMissedError, match="the map holds no object where it stands"):
            find(*items)
    with pytest.raises(TargetMissedError, match=r"are 0\.00\d m off in the median"):
        find(whole, objects=(neighbour, target))


def test_a_target_that_no_mask_shows_fails_its_scene(scene: Scene) -> None:
    blank = np.zeros((120, 160), dtype=np.uint16)
    frames = tuple(replace(frame, instance_ids=blank) for frame in scene.frames)
    with pytest.raises(SceneFailure, match="where mug_pybullet stands: it is empty"):
        evaluate(replace(scene, frames=frames))
