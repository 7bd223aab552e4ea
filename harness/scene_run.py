"""One scene from its frames to its records: map, classify, score."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from harness.missed import answer_missed
from harness.native import Pipeline, check_pipeline_config, nearest_observation
from harness.protocol import COMPLETED, completion_name, true_categories
from harness.recordings.file import encode
from harness.recordings.make import model_answers, record_scene
from harness.runs.records import Record, SceneResult, Variant
from harness.scoring import Answers, confusion, scene_facts, score
from harness.stages.clock import StageClock
from harness.stages.mapping import frame_arguments
from harness.stages.memo import Memo
from harness.stages.scene import SceneStages
from harness.truth import ORACLE, TargetMissedError
from sim_scenes import DepthNoise, SceneSpec, load_object_set, simulate

if TYPE_CHECKING:
    from harness.config import Config
    from harness.recordings.recording import ModelAnswers
    from harness.runs.job import SceneJob
    from sim_scenes import Scene


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


def with_pipeline_defaults(config: Config) -> Config:
    """Write the defaults of the pipeline's settings out, which tell what each stage depends on."""
    return config.model_copy(update={"pipeline": json.loads(_whole(config.pipeline_json()))})


@lru_cache(maxsize=64)
def _whole(pipeline_json: str) -> str:
    return check_pipeline_config(pipeline_json)


def map_scene(scene: Scene, *, config: Config) -> Pipeline:
    """Feed a scene's frames to a new pipeline, in order."""
    pipeline = Pipeline(config.pipeline_json())
    for frame in scene.frames:
        pipeline.add_frame(**frame_arguments(frame, scene))
    return pipeline


def evaluate_scene(
    scene: Scene, *, job: SceneJob, config: Config, clock: StageClock, memo: Memo | None = None
) -> SceneResult:
    """Map a scene, classify the target's test points with every model, and score them.

    Parameters
    ----------
    scene
        Frames and truth; the target is its first object.
    job, config
        What the records say of themselves, and the protocol.
    clock
        Takes the time of every stage.
    memo
        What other configurations computed of this scene.

    Returns
    -------
    result
        One record per model, test set and tolerance, the confusions, the clock's timings, and the
        recording if the run keeps one.

    Raises
    ------
    SceneFailure
        The map holds no object where the target is although the oracle segmented, or no test set
        has points.
    """
    config = with_pipeline_defaults(without_idle_completer(config))
    return evaluate(SceneStages(scene, job=job, config=config, clock=clock, memo=memo or Memo()))


def evaluate(stages: SceneStages) -> SceneResult:
    """Score what the stages of a scene yield.

    A model is asked once about the points of all test sets, so that it learns once. A test set
    without points, for want of a completion, has failed records with the reason. A target that the
    segmenter missed is no failure of the scene but an answer: see `Record.target_missed`.

    Raises
    ------
    SceneFailure
        As `evaluate_scene`.
    """
    scene, job, config, clock = stages.scene, stages.job, stages.config, stages.clock
    protocol, target = config.protocol, scene.objects[0]
    pipeline, watch = stages.mapped.pipeline, stages.mapped.watch
    found = stages.find_target()
    if isinstance(found, TargetMissedError):
        if pipeline.segmenter == ORACLE or set(protocol.test_sets) == {COMPLETED}:
            raise found
        result = answer_missed(
            scene,
            job=job,
            config=config,
            pipeline=pipeline,
            truths=stages.truths,
            reason=str(found),
            watch=watch,
        )
        return replace(result, timings=clock.timings)
    question = stages.ask(found)
    data_distance_m = nearest_observation(
        points=question.points_world, observed=question.training.points_world
    )
    result = SceneResult(records=[], timings=clock.timings)
    kept: dict[str, ModelAnswers] = {}
    for model in pipeline.models:
        predictions = stages.classify(question, model=model)
        if watch:
            if model == pipeline.models[0]:
                pipeline.annotate(found.id, question.points_world, predictions)
            whole = Answers(predictions, slice(None), question.completer_confidence)
            kept[model] = model_answers(whole, category=target.category, item=found)
        for part in question.asked:
            answers = Answers(predictions, part.part, question.completer_confidence)
            with clock.stage("score", model=model):
                for tolerance_m in protocol.tolerances_m:
                    true = true_categories(
                        question.distances_m[:, part.part], scene.objects, tolerance_m=tolerance_m
                    )
                    identity = {
                        "scene_id": job.scene_id,
                        "model": model,
                        "completion": part.completion,
                        "tolerance_m": tolerance_m,
                    }
                    result.confusion.extend(confusion(answers, true=true, identity=identity))
                    identity |= {
                        "category": target.category,
                        "object_name": target.name,
                        "seed": job.seed,
                        "segmenter": pipeline.segmenter,
                        **scene_facts(scene),
                    }
                    result.records.append(
                        score(
                            answers,
                            truth=true == target.category,
                            data_distance_m=data_distance_m[part.part],
                            target=target,
                            item=found,
                            training=question.training,
                            identity=identity,
                        )
                    )
    result.records.extend(
        Record.failed(
            job,
            variant=Variant(model, part.completion, pipeline.segmenter),
            views=len(scene.frames),
            tolerance_m=tolerance_m,
            failure=part.reason,
        )
        for part in question.missing
        for model in pipeline.models
        for tolerance_m in protocol.tolerances_m
    )
    if watch is None:
        return result
    with clock.stage("record"):
        recording = record_scene(
            scene,
            job=job,
            pipeline=pipeline,
            watch=watch,
            target_id=found.id,
            training=question.training,
            asked=question.asked,
            distances_m=question.distances_m,
            data_distance_m=data_distance_m,
            answers=kept,
        )
        return replace(result, recording=encode(recording))
