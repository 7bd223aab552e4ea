"""One scene from its frames to its records: map, classify, score."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from harness.native import CLASS_NAMES, MeshTruth, Pipeline, binary_metrics, nearest_observation
from harness.protocol import box_test_points, true_categories
from harness.runs.records import Record, SceneResult, Timing, Variant
from sim_scenes import DepthNoise, SceneSpec, load_object_set, simulate

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from harness.config import Config
    from harness.native import MappedObject, Predictions, TrainingSet
    from harness.runs.job import SceneJob
    from sim_scenes import Scene, SceneObject

COMPLETION = "none"


class SceneFailure(Exception):
    """A scene that cannot be scored, with the reason."""


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
        """Note a stage that was timed elsewhere."""
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
        Variant(model=model, completion=COMPLETION, segmenter=pipeline.segmenter)
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
        One record per model and tolerance, and the time that each stage took.
    """
    clock = StageClock(job.scene_id)
    with clock.stage("render"):
        scene = simulate_job(job, config)
    records = evaluate_scene(scene, job=job, config=config, clock=clock)
    return SceneResult(records=records, timings=clock.timings)


def map_scene(scene: Scene, *, config: Config) -> Pipeline:
    """Feed a scene's frames to a new pipeline, in order."""
    pipeline = Pipeline(config.pipeline_json())
    for frame in scene.frames:
        camera = frame.intrinsics
        pipeline.add_frame(
            rgb=frame.rgb,
            depth_m=frame.depth_m,
            intrinsics=(camera.fx, camera.fy, camera.cx, camera.cy),
            world_from_camera=frame.world_from_camera,
            instance_ids=frame.instance_ids,
            categories=scene.categories,
        )
    return pipeline


def evaluate_scene(
    scene: Scene, *, job: SceneJob, config: Config, clock: StageClock
) -> list[Record]:
    """Map a scene, classify the target's test points with every model, and score them.

    Parameters
    ----------
    scene
        Frames and truth; the target is its first object.
    job, config
        What the records say of themselves, and the protocol.
    clock
        Takes the time of every stage.

    Raises
    ------
    SceneFailure
        The map holds no object where the target is.
    """
    protocol = config.protocol
    target = scene.objects[0]
    pipeline = map_scene(scene, config=config)
    mapped = find_mapped(pipeline.objects(), target)
    training = pipeline.training_set(mapped.id, seed=job.seed)
    test_points = box_test_points(target, count=protocol.test_points, seed=job.seed)

    with clock.stage("truth"):
        distances_m = np.stack([mesh_truth(item).distances(test_points) for item in scene.objects])
    data_distance_m = nearest_observation(points=test_points, observed=training.points_world)

    records = []
    for model in pipeline.models:
        predictions = pipeline.classify(mapped.id, training, test_points, model=model)
        if model == pipeline.models[0]:
            pipeline.annotate(mapped.id, test_points, predictions)
        with clock.stage("score", model=model):
            records += [
                score(
                    predictions,
                    truth=true_categories(distances_m, scene.objects, tolerance_m=tolerance_m)
                    == target.category,
                    data_distance_m=data_distance_m,
                    target=target,
                    training=training,
                    identity={
                        "scene_id": job.scene_id,
                        "category": target.category,
                        "object_name": target.name,
                        "seed": job.seed,
                        "model": model,
                        "completion": COMPLETION,
                        "segmenter": pipeline.segmenter,
                        "views": len(scene.frames),
                        "tolerance_m": tolerance_m,
                        "redraws": scene.redraw_count,
                    },
                )
                for tolerance_m in protocol.tolerances_m
            ]
    for stage, of_model, seconds in pipeline.timings():
        clock.add(stage, seconds, model=of_model)
    return records


def mesh_truth(item: SceneObject) -> MeshTruth:
    """Prepare an object's true mesh, in the world, to be measured against."""
    vertices, faces = item.mesh_world()
    return MeshTruth(np.ascontiguousarray(vertices), faces.astype(np.uint32))


def find_mapped(mapped: list[MappedObject], target: SceneObject) -> MappedObject:
    """Find the mapped object that stands where the target truly is.

    Its observed points must centre within the target's bounding sphere; of several the nearest
    is taken. The category is not asked for: a wrong one costs the scores what it should.
    """
    low, high = target.vertices.min(axis=0), target.vertices.max(axis=0)
    centre = target.world_from_object[:3, :3] @ ((low + high) / 2) + target.world_from_object[:3, 3]
    offsets_m = [float(np.linalg.norm(item.centroid_world - centre)) for item in mapped]
    radius_m = float(np.linalg.norm(high - low)) / 2
    if not mapped or min(offsets_m) > radius_m:
        nearest = f"the nearest is {min(offsets_m):.3f} m off" if mapped else "it is empty"
        raise SceneFailure(f"the map holds no object where {target.name} stands: {nearest}")
    return mapped[int(np.argmin(offsets_m))]


def score(
    predictions: Predictions,
    *,
    truth: npt.NDArray[np.bool_],
    data_distance_m: npt.NDArray[np.float64],
    target: SceneObject,
    training: TrainingSet,
    identity: dict[str, Any],
) -> Record:
    """Score one model's predictions at one tolerance.

    The metrics of ranking and calibration judge the classifier alone, by its raw probability of
    the target's category. Decisions are ranked by the confidence, that probability times the
    segmenter's score. Under the oracle, whose score is 1, the two are the same numbers.

    Parameters
    ----------
    predictions
        Of the test points.
    truth : (n,) bool
        Whether each point lies on an object of the target's category.
    data_distance_m : (n,) float64
        Distance of each point to the nearest training point, metres.
    target
        The object asked about.
    training
        What the model learned from.
    identity
        The fields of the record that say which result it is.
    """
    target_class = CLASS_NAMES.index(target.category)
    predicted = predictions.classes == target_class
    decision = np.where(predicted, predictions.confidence, 1.0 - predictions.confidence)
    metrics = binary_metrics(
        predicted=predicted,
        truth=truth,
        probability=category_probability(predictions, target.category),
        decision_confidence=decision,
    )
    aurc_by_score, aurc_by_nearness = (
        binary_metrics(predicted=predicted, truth=truth, decision_confidence=ranking)["aurc"]
        for ranking in (predictions.score, -data_distance_m)
    )
    names = {item.name for item in fields(Record)}
    # A map that takes the target for something else has no process of its category.
    object_process = predictions.hyperparameters.get(target.category)
    free_process = predictions.hyperparameters["free"]
    return Record(
        **identity,
        **cast("dict[str, Any]", {name: metrics[name] for name in metrics.keys() & names}),
        nearest_aurc=aurc_by_nearness,
        score_aurc=aurc_by_score,
        test_points=len(truth),
        object_training_points=int(np.count_nonzero(training.classes == target_class)),
        free_training_points=int(np.count_nonzero(training.classes == 0)),
        clamped_share=predictions.clamped_share,
        jitter=predictions.jitter,
        fits_unconverged=predictions.fits_unconverged,
        fits_at_bound=predictions.fits_at_bound,
        lengthscale_m=object_process.lengthscale_m if object_process else None,
        outputscale=object_process.outputscale if object_process else None,
        lengthscale_free_m=free_process.lengthscale_m,
        outputscale_free=free_process.outputscale,
    )


def category_probability(predictions: Predictions, category: str) -> npt.NDArray[np.float64]:
    """Probability (n,) of a category at each point; 0 where the classifier does not know it."""
    if category not in predictions.class_names:
        return np.zeros(len(predictions.probabilities))
    column = predictions.class_names.index(category)
    return np.ascontiguousarray(predictions.probabilities[:, column])
