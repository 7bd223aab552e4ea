"""The scorer against scikit-learn, trimesh and NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from sklearn import metrics  # type: ignore[import-untyped]
from sklearn.calibration import calibration_curve  # type: ignore[import-untyped]

from harness.native import MeshTruth, binary_metrics

if TYPE_CHECKING:
    import numpy.typing as npt

    Bools = npt.NDArray[np.bool_]
    Floats = npt.NDArray[np.float64]
    Sample = tuple[Bools, Bools, Floats, Floats]

COUNTS = ("tp", "tn", "fp", "fn")
RATES = ("precision", "recall", "f1", "accuracy", "mcc")
OF_PROBABILITY = ("auroc", "average_precision", "ece", "ece_equal_mass", "brier", "nll")
OF_CONFIDENCE = ("aurc", "excess_aurc", "risk_at_50", "risk_at_80")
BINS = 15
POINTS = 300


def draw(*, seed: int, steps: int | None = None) -> Sample:
    """Truth, decision and scores that know something of it, on `steps` levels where many tie."""
    rng = np.random.default_rng(seed)
    truth = rng.random(POINTS) < 0.3
    probability = np.clip(0.3 + 0.25 * truth + rng.normal(scale=0.2, size=POINTS), 0.0, 1.0)
    if steps is not None:
        probability = np.round(probability * steps) / steps
    predicted = probability > 0.45
    confidence = np.abs(probability - 0.45)
    return predicted, truth, probability, confidence


def score(
    predicted: Bools,
    truth: Bools,
    probability: Floats | None = None,
    confidence: Floats | None = None,
) -> dict[str, Any]:
    return binary_metrics(
        predicted=predicted,
        truth=truth,
        probability=probability,
        decision_confidence=confidence,
    )


@pytest.fixture(params=[(0, None), (1, None), (2, 10), (3, 3)], ids=lambda p: f"seed{p[0]}-{p[1]}")
def sample(request: pytest.FixtureRequest) -> Sample:
    seed, steps = request.param
    return draw(seed=seed, steps=steps)


def test_decisions_agree_with_sklearn(sample: Sample) -> None:
    predicted, truth, _, _ = sample
    found = score(predicted, truth)
    tn, fp, fn, tp = metrics.confusion_matrix(truth, predicted).ravel()
    assert [found[key] for key in COUNTS] == [tp, tn, fp, fn]
    assert_allclose(
        [found[key] for key in RATES],
        [
            metrics.precision_score(truth, predicted),
            metrics.recall_score(truth, predicted),
            metrics.f1_score(truth, predicted),
            metrics.accuracy_score(truth, predicted),
            metrics.matthews_corrcoef(truth, predicted),
        ],
        rtol=1e-12,
    )


def test_probabilities_agree_with_sklearn(sample: Sample) -> None:
    predicted, truth, probability, _ = sample
    found = score(predicted, truth, probability)
    assert_allclose(
        [found[key] for key in ("auroc", "average_precision", "brier", "nll")],
        [
            metrics.roc_auc_score(truth, probability),
            metrics.average_precision_score(truth, probability),
            metrics.brier_score_loss(truth, probability),
            metrics.log_loss(truth, probability),
        ],
        rtol=1e-12,
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_calibration_agrees_with_sklearn_where_nothing_ties(seed: int) -> None:
    # Probabilities off the bins' edges: sklearn's bins are closed above, ours below.
    rng = np.random.default_rng(seed)
    probability = rng.uniform(0.001, 0.999, size=20 * BINS)
    truth = rng.random(probability.size) < probability**2
    found = score(probability > 0.5, truth, probability)

    frequency, mean = calibration_curve(truth, probability, n_bins=BINS, strategy="uniform")
    weights = np.histogram(probability, bins=BINS, range=(0.0, 1.0))[0] / probability.size
    assert_allclose(found["ece"], np.sum(weights * np.abs(frequency - mean)), rtol=1e-12)

    by_probability = np.argsort(probability).reshape(BINS, -1)
    gaps = truth[by_probability].mean(axis=1) - probability[by_probability].mean(axis=1)
    assert_allclose(found["ece_equal_mass"], np.abs(gaps).mean(), rtol=1e-12)


def expected_risks(correct: Bools, confidence: Floats) -> Floats:
    """Risk among the k most confident points; tied points each count their group's mean error."""
    _, group = np.unique(-confidence, return_inverse=True)
    mean_error = np.bincount(group, weights=~correct) / np.bincount(group)
    errors = mean_error[group[np.argsort(-confidence, kind="stable")]]
    return np.cumsum(errors) / np.arange(1, errors.size + 1)


def test_risk_coverage_agrees_with_numpy(sample: Sample) -> None:
    predicted, truth, _, confidence = sample
    found = score(predicted, truth, confidence=confidence)
    correct = predicted == truth
    risks = expected_risks(correct, confidence)
    best = expected_risks(correct, correct.astype(np.float64))
    # In the best order no error ties with a right decision, but errors tie among themselves: at
    # every cut all or none of the points kept from their group are wrong.
    assert_allclose(found["aurc"], risks.mean(), rtol=1e-12)
    assert_allclose(found["excess_aurc"], risks.mean() - best.mean(), rtol=1e-9)
    assert_allclose(found["risk_at_50"], risks[POINTS // 2 - 1], rtol=1e-12)
    assert_allclose(found["risk_at_80"], risks[POINTS * 4 // 5 - 1], rtol=1e-12)


def test_the_order_of_the_points_never_matters(sample: Sample) -> None:
    predicted, truth, probability, confidence = sample
    mixed = np.random.default_rng(9).permutation(POINTS)
    shuffled = score(predicted[mixed], truth[mixed], probability[mixed], confidence[mixed])
    assert shuffled == score(*sample)


def test_no_positives_leave_recall_and_ranking_undefined() -> None:
    truth = np.zeros(4, dtype=bool)
    predicted = np.array([True, False, False, False])
    probability = np.array([0.9, 0.2, 0.1, 0.3])
    found = score(predicted, truth, probability, probability)
    for key in ("recall", "f1", "mcc", "auroc", "average_precision"):
        assert found[key] is None
    assert found["precision"] == 0.0
    assert_allclose(found["brier"], metrics.brier_score_loss(truth, probability, pos_label=True))


def test_only_positives_leave_auroc_undefined_but_not_average_precision() -> None:
    truth = np.ones(3, dtype=bool)
    probability = np.array([0.9, 0.2, 0.4])
    found = score(probability > 0.3, truth, probability)
    assert found["auroc"] is None
    assert found["mcc"] is None
    assert found["average_precision"] == metrics.average_precision_score(truth, probability) == 1.0


def test_no_predicted_positive_leaves_precision_undefined() -> None:
    found = score(np.zeros(3, dtype=bool), np.array([True, False, False]))
    assert found["precision"] is None
    assert found["recall"] == 0.0
    assert found["f1"] == 0.0


def test_scores_that_are_not_given_have_no_metrics() -> None:
    predicted, truth, probability, confidence = draw(seed=5)
    bare = score(predicted, truth)
    assert all(bare[key] is None for key in OF_PROBABILITY + OF_CONFIDENCE)
    ranked = score(predicted, truth, confidence=confidence)
    assert all(ranked[key] is None for key in OF_PROBABILITY)
    assert all(ranked[key] is not None for key in OF_CONFIDENCE)
    likely = score(predicted, truth, probability)
    assert all(likely[key] is not None for key in OF_PROBABILITY)


def test_no_points_have_no_metrics() -> None:
    none = np.zeros(0)
    found = score(none.astype(bool), none.astype(bool), none, none)
    assert [found.pop(key) for key in COUNTS] == [0, 0, 0, 0]
    assert set(found.values()) == {None}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"truth": np.zeros(3, dtype=bool)}, r"predicted holds 2 values and truth 3"),
        ({"probability": np.array([0.5, 1.5])}, r"probability\[1\] is 1.5"),
        ({"probability": np.array([np.nan, 0.5])}, r"probability\[0\] is NaN"),
        ({"decision_confidence": np.array([0.5, np.inf])}, r"decision_confidence\[1\] is inf"),
        ({"decision_confidence": np.array([0.5])}, r"decision_confidence holds 1 values"),
    ],
)
def test_bad_scores_are_refused_by_name(change: dict[str, Any], message: str) -> None:
    arrays = {"predicted": np.zeros(2, dtype=bool), "truth": np.zeros(2, dtype=bool)}
    with pytest.raises(ValueError, match=message):
        binary_metrics(**(arrays | change))


def broken_sphere() -> trimesh.Trimesh:
    """A sphere with holes, duplicate vertices, a duplicate face and two faces without area."""
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    corners = sphere.triangles[::2].reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    return trimesh.Trimesh(
        corners, np.vstack([faces, faces[:1], [[0, 0, 0]], [[0, 1, 0]]]), process=False
    )


MESHES = {
    "box": trimesh.creation.box(extents=(0.1, 0.06, 0.08)),
    "annulus": trimesh.creation.annulus(r_min=0.03, r_max=0.04, height=0.09),
    "triangle": trimesh.Trimesh(np.eye(3), [[0, 1, 2]]),
    "broken sphere": broken_sphere(),
}


def truth_of(mesh: trimesh.Trimesh) -> MeshTruth:
    return MeshTruth(
        np.ascontiguousarray(mesh.vertices, dtype=np.float64),
        np.ascontiguousarray(mesh.faces, dtype=np.uint32),
    )


def points_around(mesh: trimesh.Trimesh, *, seed: int, points: int = 500) -> Floats:
    rng = np.random.default_rng(seed)
    low, high = mesh.bounds
    return rng.uniform(low - 0.03, high + 0.03, size=(points, 3))


@pytest.mark.parametrize("name", MESHES)
def test_distances_agree_with_trimesh(name: str) -> None:
    mesh = MESHES[name]
    points = points_around(mesh, seed=3)
    with_area = trimesh.Trimesh(mesh.vertices, mesh.faces[mesh.area_faces > 0.0], process=False)
    proximity: Any = trimesh.proximity
    _, expected, _ = proximity.closest_point_naive(with_area, points)
    assert_allclose(truth_of(mesh).distances(points), expected, rtol=0.0, atol=1e-12)


def expected_depths(mesh: trimesh.Trimesh, origins: Floats, directions: Floats) -> Floats:
    """Depth along each ray to the nearest face, by solving for every ray and face in turn."""
    triangles = mesh.triangles[mesh.area_faces > 0.0]
    edges = triangles[:, 1:] - triangles[:, :1]
    depths = np.full(len(origins), np.nan)
    for ray, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        # origin + t direction = corner + u edge + v edge'
        system = np.stack(
            [edges[:, 0], edges[:, 1], np.broadcast_to(-direction, edges[:, 0].shape)], axis=2
        )
        u, v, t = np.linalg.solve(system, (origin - triangles[:, 0])[:, :, None])[:, :, 0].T
        hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= 0.0)
        depths[ray] = t[hit].min(initial=np.inf)
    depths[np.isinf(depths)] = np.nan
    return depths


@pytest.mark.parametrize("name", MESHES)
def test_ray_depths_agree_with_every_face_in_turn(name: str) -> None:
    mesh = MESHES[name]
    origins = points_around(mesh, seed=4, points=200)
    directions = points_around(mesh, seed=5, points=200) - origins
    found = truth_of(mesh).ray_depths(origins, directions)
    expected = expected_depths(mesh, origins, directions)
    assert np.isfinite(expected).sum() > 10
    assert_allclose(found, expected, rtol=0.0, atol=1e-9)


def test_bad_geometry_is_refused_by_index() -> None:
    truth = truth_of(MESHES["box"])
    points = np.zeros((3, 3))
    points[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"points\[2\] is"):
        truth.distances(points)
    with pytest.raises(ValueError, match=r"directions\[0\] is \[0.0, 0.0, 0.0\]"):
        truth.ray_depths(np.zeros((1, 3)), np.zeros((1, 3)))
    with pytest.raises(ValueError, match="all 1 faces of the mesh have zero area"):
        MeshTruth(np.zeros((3, 3)), np.array([[0, 1, 2]], dtype=np.uint32))
