"""The models as Python sees them; their mathematics is tested in Rust."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from harness.native import (
    CLASS_NAMES,
    Pipeline,
    Predictions,
    TrainingSet,
    check_pipeline_config,
)
from harness.tests.support import frame

MODELS = ("classic", "classic_tuned", "metric_literal", "metric", "network", "nearest")
PROCESSES = ("classic", "classic_tuned", "metric_literal", "metric")


def mapped(**settings: Any) -> Pipeline:
    small = {"training": {"points": 200}, "gp": {"fit_points": 60}}
    pipeline = Pipeline(json.dumps({"segmenter": "oracle"} | small | settings))
    assert pipeline.add_frame(**frame()) == [1]
    return pipeline


def near_and_far(training: TrainingSet) -> np.ndarray:
    """Observed points, points a centimetre off them, and one far away."""
    observed = training.points_world[:5]
    return np.concatenate([observed, observed + 0.01, [[3.0, -2.0, 1.0]]])


def classified(model: str, **settings: Any) -> Predictions:
    pipeline = mapped(**settings)
    training = pipeline.training_set(1, seed=0)
    return pipeline.classify(1, training, near_and_far(training), model=model)


@pytest.mark.parametrize("model", MODELS)
def test_every_model_answers_in_the_same_form(model: str) -> None:
    predictions = classified(model)
    n = 11
    assert predictions.class_names[0] == "free"
    assert predictions.probabilities.shape == (n, 2)
    assert np.allclose(predictions.probabilities.sum(axis=1), 1)
    for values in (predictions.variance, predictions.score, predictions.confidence):
        assert values.shape == (n,)
        assert np.isfinite(values).all()
    assert predictions.classes.shape == (n,)
    assert set(predictions.classes.tolist()) <= {0, CLASS_NAMES.index("mug")}
    assert predictions.gate == 1
    if model in PROCESSES:
        assert set(predictions.hyperparameters) == {"free", "mug"}
        assert predictions.difference_variance is not None
        assert predictions.difference_variance.shape == (n,)
    else:
        assert predictions.hyperparameters == {}
        assert predictions.difference_variance is None
        assert (predictions.variance == 0).all()
        assert (predictions.score == predictions.confidence).all()
    assert predictions.clamped.shape == (n,)
    assert predictions.clamped_share == predictions.clamped.mean()
    if model != "metric_literal":
        assert not predictions.clamped.any()
    if model in ("metric", "network"):
        assert predictions.prior_probability is not None
        assert predictions.embedding is not None
        assert predictions.ood is not None
        assert predictions.prior_probability.shape == (n,)
        assert predictions.embedding.shape == (n, 3)
        assert (np.linalg.norm(predictions.embedding, axis=1) <= 1 + 1e-6).all()
        assert predictions.ood >= 0
    else:
        assert predictions.prior_probability is None
        assert predictions.embedding is None
        assert predictions.ood is None


def before_a_cylinder(radius_m: np.ndarray, *, seed: int) -> np.ndarray:
    """Points (n, 3) in front of an upright axis, 0 to 9 cm above the table."""
    rng = np.random.default_rng(seed)
    angle, height_m = rng.uniform(-1.4, 1.4, len(radius_m)), rng.uniform(0, 0.09, len(radius_m))
    return np.stack([radius_m * np.cos(angle), radius_m * np.sin(angle), height_m], axis=1)


def test_the_network_alone_is_the_prior_of_metric_unless_it_is_divided() -> None:
    observed = before_a_cylinder(np.full(1000, 0.04), seed=0)
    free = before_a_cylinder(np.linspace(0.05, 0.07, 1000), seed=1)
    points = before_a_cylinder(np.linspace(0.042, 0.05, 200), seed=2)
    training = TrainingSet(
        np.concatenate([observed, free]),
        np.repeat(np.array([CLASS_NAMES.index("mug"), 0], dtype=np.uint8), 1000),
        viewpoint_world=np.array([0.4, 0.0, 0.3]),
    )
    network = mapped().classify(1, training, points, model="network")
    alone = mapped(metric={"parts": 1}).classify(1, training, points, model="metric")
    metric = mapped().classify(1, training, points, model="metric")
    assert network.prior_probability is not None
    assert metric.prior_probability is not None
    assert alone.prior_probability is not None
    assert (network.probabilities[:, 1] == network.prior_probability).all()
    assert (alone.prior_probability == network.prior_probability).all()
    # 1,000 points of a kind make two parts. Where the network is unsure, two looks differ from one.
    unsure = np.abs(network.prior_probability - 0.5) < 0.45
    assert unsure.sum() > 20
    assert (metric.prior_probability[unsure] != network.prior_probability[unsure]).all()


def test_the_gate_falls_back_to_classic_where_the_prior_is_absurd() -> None:
    sound = classified("metric", metric={"gate": True})
    assert sound.gate is not None
    assert 0 <= sound.gate <= 1
    # As if the table stood a metre under the floor.
    absurd = classified("metric", metric={"gate": True, "table_height_m": -1.0})
    classic = classified("classic")
    assert absurd.gate is not None
    assert absurd.gate < 1e-6
    assert np.allclose(absurd.probabilities, classic.probabilities, atol=1e-6)
    assert (absurd.variance == classic.variance).all()
    for name, own in classic.hyperparameters.items():
        assert absurd.hyperparameters[name].lengthscale_m == own.lengthscale_m


def test_recalibration_changes_the_confidence_and_nothing_else() -> None:
    before = classified("nearest")
    after = classified("nearest", recalibration={"nearest": {"slope": 2, "intercept": -1}})
    assert (before.probabilities == after.probabilities).all()
    off = np.abs(before.probabilities[:, 1] - 0.5) < 0.5 - 1e-6
    logit = np.log(before.probabilities[off, 1] / before.probabilities[off, 0])
    assert off.any()
    expected = np.exp(-np.logaddexp(0, 1 - 2 * logit))
    assert np.allclose(after.confidence[off], expected, rtol=1e-9, atol=0)


def test_a_completed_point_is_as_sure_as_its_completion() -> None:
    pipeline = mapped()
    training = pipeline.training_set(1, seed=0)
    points = near_and_far(training)
    share = np.linspace(0, 1, len(points))
    whole = pipeline.classify(1, training, points, model="nearest")
    completed = pipeline.classify(1, training, points, model="nearest", completion_confidence=share)
    assert np.allclose(completed.confidence, whole.confidence * share, rtol=1e-15, atol=0)
    with pytest.raises(ValueError, match=r"has shape \(1,\); expected \(11,\)"):
        pipeline.classify(1, training, points, completion_confidence=np.ones(1))
    share[3] = 1.5
    with pytest.raises(ValueError, match=r"completion_confidence is 1.5; it must lie in \[0, 1\]"):
        pipeline.classify(1, training, points, completion_confidence=share)


def test_the_embedding_of_the_network_is_at_hand() -> None:
    pipeline = mapped()
    training = pipeline.training_set(1, seed=0)
    points = near_and_far(training)
    logits, directions = pipeline.query_embedding(1, training, points)
    assert logits.shape == (len(points),)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1)
    predictions = pipeline.classify(1, training, points, model="network")
    assert predictions.embedding is not None
    radius = 1 / (1 + np.exp(-logits))
    assert np.allclose(predictions.embedding, radius[:, None] * directions)
    assert predictions.prior_probability is not None
    temperature = json.loads(check_pipeline_config("{}"))["metric"]["temperature"]
    probability = 1 / (1 + np.exp(-logits / temperature))
    assert np.allclose(predictions.prior_probability, probability, rtol=1e-12)


def test_the_order_of_a_given_set_does_not_matter_to_what_fits_nothing() -> None:
    pipeline = mapped()
    drawn = pipeline.training_set(1, seed=0)
    points, order = near_and_far(drawn), np.random.default_rng(0).permutation(len(drawn.classes))
    sets = [
        TrainingSet(
            drawn.points_world[at], drawn.classes[at], viewpoint_world=drawn.viewpoint_world
        )
        for at in (np.arange(len(order)), order)
    ]
    for model in ("metric", "network", "nearest"):
        ours, theirs = (pipeline.classify(1, given, points, model=model) for given in sets)
        assert np.allclose(ours.probabilities, theirs.probabilities, rtol=1e-6, atol=1e-9), model


def test_no_embedding_of_an_object_that_is_not_in_the_set() -> None:
    pipeline = mapped()
    drawn = pipeline.training_set(1, seed=0)
    other = CLASS_NAMES.index("bowl" if pipeline.objects()[0].category != "bowl" else "mug")
    classes = np.where(drawn.classes > 0, other, 0).astype(np.uint8)
    given = TrainingSet(drawn.points_world, classes, viewpoint_world=drawn.viewpoint_world)
    with pytest.raises(ValueError, match="no training point is of that category"):
        pipeline.query_embedding(1, given, drawn.points_world[:3])


def test_a_given_set_needs_a_viewpoint() -> None:
    pipeline = mapped()
    drawn = pipeline.training_set(1, seed=0)
    viewpoint = drawn.viewpoint_world
    assert viewpoint is not None
    assert np.allclose(viewpoint, frame()["world_from_camera"][:3, 3])
    bare = TrainingSet(drawn.points_world, drawn.classes)
    assert bare.viewpoint_world is None
    points = near_and_far(drawn)
    for model in ("metric", "network"):
        with pytest.raises(ValueError, match="the training set has no viewpoint"):
            pipeline.classify(1, bare, points, model=model)
    given = TrainingSet(drawn.points_world, drawn.classes, viewpoint_world=viewpoint)
    of_given = pipeline.classify(1, given, points, model="network")
    of_drawn = pipeline.classify(1, drawn, points, model="network")
    assert (of_given.probabilities == of_drawn.probabilities).all()
    with pytest.raises(ValueError, match=r"the viewpoint .* is not finite"):
        TrainingSet(drawn.points_world, drawn.classes, viewpoint_world=np.array([0.0, np.nan, 0.0]))


@pytest.mark.parametrize("key", ["query_weights", "metric_weights"])
def test_missing_weights_are_an_io_error(key: str, tmp_path: Any) -> None:
    missing = tmp_path / "none.safetensors"
    with pytest.raises(OSError, match=r"none\.safetensors"):
        Pipeline(json.dumps({"metric": {key: str(missing)}}))
    missing.write_bytes(b"no weights")
    with pytest.raises(ValueError, match=r"none\.safetensors"):
        Pipeline(json.dumps({"metric": {key: str(missing)}}))


def test_every_model_notes_its_stages() -> None:
    pipeline = mapped()
    training = pipeline.training_set(1, seed=0)
    for model in MODELS:
        pipeline.classify(1, training, near_and_far(training), model=model)
    stages = {model: [s for s, m, _ in pipeline.timings() if m == model] for model in MODELS}
    assert stages == {
        "classic": ["fit", "posterior"],
        "classic_tuned": ["fit", "posterior"],
        "metric_literal": ["embed", "fit", "posterior"],
        "metric": ["embed", "fit", "posterior"],
        "network": ["embed"],
        "nearest": ["posterior"],
    }


@pytest.mark.parametrize("model", MODELS)
def test_the_same_frames_and_seed_give_the_same_bits(model: str) -> None:
    first, second = classified(model), classified(model)
    assert (first.probabilities == second.probabilities).all()
    assert (first.score == second.score).all()


@pytest.mark.parametrize("model", MODELS)
def test_an_object_of_the_wrong_category_gets_sound_numbers(model: str) -> None:
    pipeline = Pipeline(
        json.dumps({"segmenter": "oracle", "training": {"points": 200}, "gp": {"fit_points": 60}})
    )
    pipeline.add_frame(**frame(categories={1: "laptop"}))
    training = pipeline.training_set(1, seed=0)
    predictions = pipeline.classify(1, training, near_and_far(training), model=model)
    assert predictions.class_names == ["free", "laptop"]
    assert np.isfinite(predictions.confidence).all()
    assert predictions.ood is None or predictions.ood >= 0
