"""One scene from its frames to its records: map, classify, score."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.asked import gather_test_sets
from harness.missed import answer_missed
from harness.native import MeshTruth, Pipeline, Segmenter, nearest_observation
from harness.protocol import COMPLETED, completion_name, true_categories
from harness.recordings.file import encode
from harness.recordings.make import model_answers, record_scene
from harness.recordings.watch import MapWatch
from harness.runs.records import Record, SceneResult, Timing, Variant
from harness.scoring import Answers, confusion, score
from sim_scenes import DepthNoise, SceneSpec, load_object_set, simulate

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.config import Config
    from harness.native import MappedObject
    from harness.recordings.recording import ModelAnswers
    from harness.runs.job import SceneJob
    from sim_scenes import Frame, Scene, SceneObject


ORACLE = "oracle"
"""The segmenter that stands for the truth."""

ON_TARGET_M = 0.010
"""Points of a mapped object within this distance of the target's mesh are of the target."""
MOST_ASKED = 1000
"""Of a mapped object's points, about so many are asked whose they are."""


class SceneFailure(Exception):
    """A scene that cannot be scored, with the reason."""


class TargetMissedError(SceneFailure):
    """No mapped object is the target."""


@dataclass
class StageClock:
    """Wall time per stage, in the order in which the stages ended."""

    scene_id: str
    timings: list[Timing] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str, *, model: str | None = None) -> Iterator[None]:
        """Time the block as one stage."""
        start = time.perf_counter()
        yield
        self.add(name, time.perf_counter() - start, model=model)

    def add(self, name: str, seconds: float, *, model: str | None = None) -> None:
        """Note a stage that was timed elsewhere; what one stage takes adds up."""
        for index, timing in enumerate(self.timings):
            if (timing.stage, timing.model) == (name, model):
                self.timings[index] = replace(timing, seconds=timing.seconds + seconds)
                return
        self.timings.append(
            Timing(scene_id=self.scene_id, stage=name, model=model, seconds=seconds)
        )


def scene_spec(job: SceneJob, config: Config) -> SceneSpec:
    """Describe the family of scenes that a job's scene is drawn from."""
    scenes = config.scenes
    noise = DepthNoise(**scenes.depth_noise.model_dump())
    family = SceneSpec.clutter if job.cluttered else SceneSpec
    return family(
        models=(job.object_name,),
        views=scenes.views,
        image_size=(scenes.width, scenes.height),
        depth_noise=noise,
    )


def variants(config: Config) -> list[Variant]:
    """List what every scene compares: the rows that a failed scene leaves empty."""
    pipeline = Pipeline(config.pipeline_json())
    return [
        Variant(
            model=model,
            completion=completion_name(test_set, pipeline),
            segmenter=pipeline.segmenter,
        )
        for test_set in config.protocol.test_sets
        for model in pipeline.models
    ]


def simulate_job(job: SceneJob, config: Config) -> Scene:
    """Render a job's scene."""
    objects = load_object_set(config.scenes.objects)
    return simulate(scene_spec(job, config), seed=job.seed, objects=objects)


def run_scene(job: SceneJob, config: Config) -> SceneResult:
    """Render a job's scene and evaluate it.

    Parameters
    ----------
    job
        Which scene.
    config
        The run's configuration.

    Returns
    -------
    result
        One record per model, test set and tolerance, the confusions, and the time that each stage
        took.
    """
    clock = StageClock(job.scene_id)
    with clock.stage("render"):
        scene = simulate_job(job, config)
    return evaluate_scene(scene, job=job, config=config, clock=clock)


def without_idle_completer(config: Config) -> Config:
    """Leave the completer out where no test set asks what it made."""
    if COMPLETED in config.protocol.test_sets:
        return config
    return config.model_copy(update={"pipeline": config.pipeline | {"completer": "none"}})


def map_scene(scene: Scene, *, config: Config, watch: MapWatch | None = None) -> Pipeline:
    """Feed a scene's frames to a new pipeline, in order.

    Parameters
    ----------
    scene
        The frames.
    config
        Of the pipeline.
    watch
        Notes what becomes of the map.
    """
    pipeline = Pipeline(config.pipeline_json())
    segmenter = Segmenter(config.pipeline_json()) if watch else None
    for frame in scene.frames:
        given = frame_arguments(frame, scene)
        if watch is None or segmenter is None:
            pipeline.add_frame(**given)
        else:
            detections = segmenter.segment(**given)
            watch.note(frame, detections, pipeline.add_frame(**given), pipeline)
    return pipeline


def frame_arguments(frame: Frame, scene: Scene) -> dict[str, Any]:
    """Arguments of a pipeline's and a segmenter's methods that take a frame."""
    camera = frame.intrinsics
    return {
        "rgb": frame.rgb,
        "depth_m": frame.depth_m,
        "intrinsics": (camera.fx, camera.fy, camera.cx, camera.cy),
        "world_from_camera": frame.world_from_camera,
        "instance_ids": frame.instance_ids,
        "categories": scene.categories,
    }


def evaluate_scene(
    scene: Scene, *, job: SceneJob, config: Config, clock: StageClock
) -> SceneResult:
    """Map a scene, classify the target's test points with every model, and score them.

    A model is asked once about the points of all test sets, so that it learns once. A test set
    without points, for want of a completion, has failed records with the reason. A target that the
    segmenter missed is no failure of the scene but an answer: see `Record.target_missed`.

    Parameters
    ----------
    scene
        Frames and truth; the target is its first object.
    job, config
        What the records say of themselves, and the protocol.
    clock
        Takes the time of every stage.

    Returns
    -------
    result
        One record per model, test set and tolerance, the confusions, and the clock's timings.

    Raises
    ------
    SceneFailure
        The map holds no object where the target is although the oracle segmented, or no test set
        has points.
    """
    protocol = config.protocol
    target = scene.objects[0]
    watch = MapWatch() if config.run.record == "all" else None
    pipeline = map_scene(scene, config=without_idle_completer(config), watch=watch)
    with clock.stage("truth"):
        truths = [mesh_truth(item) for item in scene.objects]
        try:
            mapped = find_mapped(pipeline.objects(), truths, name=target.name)
        except TargetMissedError as missed:
            if pipeline.segmenter == ORACLE or set(protocol.test_sets) == {COMPLETED}:
                raise
            result = answer_missed(
                scene,
                job=job,
                config=config,
                pipeline=pipeline,
                truths=truths,
                reason=str(missed),
                watch=watch,
            )
            _add_timings(clock, pipeline)
            return replace(result, timings=clock.timings)
    training = pipeline.training_set(mapped.id, seed=job.seed)
    asked, missing = gather_test_sets(
        protocol.test_sets,
        target=target,
        object_id=mapped.id,
        pipeline=pipeline,
        count=protocol.test_points,
        seed=job.seed,
    )
    if not asked:
        raise SceneFailure(missing[0].reason)
    test_points = np.concatenate([item.points_world for item in asked])
    completer_confidence = None
    if protocol.use_spread and COMPLETED in protocol.test_sets:
        completer_confidence = np.concatenate([item.confidence for item in asked])
    with clock.stage("truth"):
        distances_m = np.stack([truth.distances(test_points) for truth in truths])
    data_distance_m = nearest_observation(points=test_points, observed=training.points_world)

    result = SceneResult(records=[], timings=clock.timings)
    kept: dict[str, ModelAnswers] = {}
    for model in pipeline.models:
        predictions = pipeline.classify(
            mapped.id,
            training,
            test_points,
            model=model,
            completion_confidence=completer_confidence,
        )
        if model == pipeline.models[0]:
            pipeline.annotate(mapped.id, test_points, predictions)
        if watch:
            whole = Answers(predictions, slice(None), completer_confidence)
            kept[model] = model_answers(whole, category=target.category, item=mapped)
        for item in asked:
            answers = Answers(predictions, item.part, completer_confidence)
            with clock.stage("score", model=model):
                for tolerance_m in protocol.tolerances_m:
                    true = true_categories(
                        distances_m[:, item.part], scene.objects, tolerance_m=tolerance_m
                    )
                    identity = {
                        "scene_id": job.scene_id,
                        "model": model,
                        "completion": item.completion,
                        "tolerance_m": tolerance_m,
                    }
                    result.confusion.extend(confusion(answers, true=true, identity=identity))
                    identity |= {
                        "category": target.category,
                        "object_name": target.name,
                        "seed": job.seed,
                        "segmenter": pipeline.segmenter,
                        "views": len(scene.frames),
                        "redraws": scene.redraw_count,
                    }
                    result.records.append(
                        score(
                            answers,
                            truth=true == target.category,
                            data_distance_m=data_distance_m[item.part],
                            target=target,
                            item=mapped,
                            training=training,
                            identity=identity,
                        )
                    )
    result.records.extend(
        Record.failed(
            job,
            variant=Variant(model, item.completion, pipeline.segmenter),
            views=len(scene.frames),
            tolerance_m=tolerance_m,
            failure=item.reason,
        )
        for item in missing
        for model in pipeline.models
        for tolerance_m in protocol.tolerances_m
    )
    _add_timings(clock, pipeline)
    if watch is None:
        return result
    with clock.stage("record"):
        recording = record_scene(
            scene,
            job=job,
            pipeline=pipeline,
            watch=watch,
            target_id=mapped.id,
            training=training,
            asked=asked,
            distances_m=distances_m,
            data_distance_m=data_distance_m,
            answers=kept,
        )
        return replace(result, recording=encode(recording))


def _add_timings(clock: StageClock, pipeline: Pipeline) -> None:
    for stage, of_model, seconds in pipeline.timings():
        clock.add(stage, seconds, model=of_model)


def mesh_truth(item: SceneObject) -> MeshTruth:
    """Prepare an object's true mesh, in the world, to be measured against."""
    vertices, faces = item.mesh_world()
    return MeshTruth(np.ascontiguousarray(vertices), faces.astype(np.uint32))


def find_mapped(
    mapped: Sequence[MappedObject], truths: Sequence[MeshTruth], *, name: str
) -> MappedObject:
    """Find the mapped object that is the target.

    More than half of its observed points must lie within `ON_TARGET_M` of the target's mesh, and
    nearer to it than to any other object's: an object beside the target does not stand for one
    that was missed, nor does a piece of the table. Of several the one with the most such points is
    taken. The category is not asked for: a wrong one costs the scores what it should.

    Parameters
    ----------
    mapped
        The map's objects.
    truths
        The true meshes of the scene's objects; the target's is the first.
    name
        The target's, for the message.

    Raises
    ------
    TargetMissedError
        No mapped object is the target.
    """
    best: MappedObject | None = None
    most, nearest_m = 0.0, np.inf
    for item in mapped:
        points = item.points_world
        some = np.ascontiguousarray(points[:: -(-len(points) // MOST_ASKED) or 1])
        distances_m = np.stack([truth.distances(some) for truth in truths])
        if len(some) == 0:
            continue
        own = (distances_m.argmin(axis=0) == 0) & (distances_m[0] <= ON_TARGET_M)
        nearest_m = min(nearest_m, float(np.median(distances_m[0])))
        if own.mean() > 0.5 and (count := own.mean() * len(points)) > most:
            best, most = item, count
    if best is None:
        where = "it is empty"
        if np.isfinite(nearest_m):
            where = f"the points of the nearest are {nearest_m:.3f} m off in the median"
        raise TargetMissedError(f"the map holds no object where {name} stands: {where}")
    return best
