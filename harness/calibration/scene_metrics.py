"""The metrics of one scene, or of points from anywhere: NaN where they are undefined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.calibration.probabilities import brier_parts, negative_log_likelihood, reliability
from harness.calibration.ranking import COVERAGES, precision_at, risk_at, risk_coverage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.calibration.series import ScenePoints

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

PRECISION_COVERAGES: Floats = np.array([0.2, 0.5, 0.8])
"""Shares of the points put on the object at which precision is reported."""

PROBABILITY_METRICS = (
    "ece",
    "ece_equal_mass",
    "brier",
    "brier_reliability",
    "brier_resolution",
    "brier_uncertainty",
    "brier_within_bins",
    "nll",
)
"""Of a series read as a probability. Brier's parts are over bins of equal width, and
``brier_within_bins`` is `BrierParts`' within_variance less its within_covariance, so that
``brier = brier_reliability - brier_resolution + brier_uncertainty + brier_within_bins``."""

RANKING_METRICS = (
    "aurc",
    "excess_aurc",
    *(f"precision_at_{round(100 * share)}" for share in PRECISION_COVERAGES),
)
"""Of a series as a ranking: of all decisions, and of the points put on the object."""


def probability_metrics(probability: Floats, truth: Bools) -> dict[str, float]:
    """`PROBABILITY_METRICS` of a series (n,) against the truth (n,).

    All NaN without points, and where the series leaves [0, 1] anywhere: a mean over the points
    within would be one over points that the series itself has chosen.
    """
    parts = brier_parts(probability, truth) if inside(probability).all() else None
    if parts is None:
        return dict.fromkeys(PROBABILITY_METRICS, np.nan)
    values = (
        reliability(probability, truth).calibration_error,
        reliability(probability, truth, equal_mass=True).calibration_error,
        parts.brier,
        parts.reliability,
        parts.resolution,
        parts.uncertainty,
        parts.within_variance - parts.within_covariance,
        negative_log_likelihood(probability, truth),
    )
    return {
        name: np.nan if value is None else value
        for name, value in zip(PROBABILITY_METRICS, values, strict=True)
    }


def ranking_metrics(scene: ScenePoints, name: str) -> dict[str, float]:
    """`RANKING_METRICS` of a series of a scene; all NaN where it is not defined."""
    if name not in scene.of_decision:
        return dict.fromkeys(RANKING_METRICS, np.nan)
    ranking = scene.of_decision[name]
    curve = risk_coverage(ranking, scene.truth != scene.predicted)
    precisions = precision_at(
        ranking, predicted=scene.predicted, truth=scene.truth, coverages=PRECISION_COVERAGES
    )
    values = (
        np.nan if curve.aurc is None else curve.aurc,
        np.nan if curve.excess_aurc is None else curve.excess_aurc,
        *precisions.tolist(),
    )
    return dict(zip(RANKING_METRICS, values, strict=True))


def scene_risks(scenes: Sequence[ScenePoints], name: str) -> Floats:
    """Risks (scenes, 100) of a series at `COVERAGES`; NaN in scenes that do not define it."""
    risks = np.full((len(scenes), len(COVERAGES)), np.nan)
    for index, scene in enumerate(scenes):
        if name in scene.of_decision:
            curve = risk_coverage(scene.of_decision[name], scene.truth != scene.predicted)
            risks[index] = risk_at(curve, COVERAGES)
    return risks


def mean_risk(risks: Floats) -> Floats:
    """Mean (coverages,) of risks (scenes, coverages) over scenes that define it; NaN without."""
    defined = risks[~np.isnan(risks[:, 0])]
    return np.asarray(defined.mean(axis=0)) if len(defined) else np.full(risks.shape[1], np.nan)


def inside(values: Floats) -> Bools:
    """Whether each of values (n,) could be a probability."""
    return np.asarray((values >= 0.0) & (values <= 1.0))
