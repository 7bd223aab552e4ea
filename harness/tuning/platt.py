"""Platt's recalibration: a line through the logits that makes the truth likeliest.

Platt (1999), "Probabilistic outputs for support vector machines": p' = sigmoid(slope logit(p) +
intercept), here without his smoothing of the targets, which tens of thousands of points need not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

LOGIT_CLIP = 1e-6
"""Distance from 0 and 1 at which a probability's logit is taken."""

LEAST_SLOPE = 0.01
"""A recalibration keeps the order of the points: the slope of a worthless ranking stops here."""

_STEPS = 100
_RIDGE = 1e-9
_CONVERGED = 1e-10


@dataclass(frozen=True)
class Platt:
    """Slope and intercept on the logit."""

    slope: float
    intercept: float

    def apply(self, probability: Floats) -> Floats:
        """Recalibrate probabilities (n,)."""
        return _sigmoid(self.slope * logit(probability) + self.intercept)


def logit(probability: Floats) -> Floats:
    """Log odds (n,) of probabilities clipped to `LOGIT_CLIP` from 0 and 1."""
    clipped = np.clip(probability, LOGIT_CLIP, 1.0 - LOGIT_CLIP)
    return np.asarray(np.log(clipped) - np.log1p(-clipped))


def fit_platt(probability: Floats, truth: npt.NDArray[np.bool_]) -> Platt:
    """Fit slope and intercept by damped Newton steps on the mean log loss, which is convex.

    Where the best slope lies below `LEAST_SLOPE`, the intercept alone is fitted.

    Parameters
    ----------
    probability : (n,) float64
        Raw probabilities.
    truth : (n,) bool
        Both values must occur.
    """
    features = np.stack([logit(probability), np.ones(len(truth))])
    slope, intercept = _newton(features, truth, start=np.array([1.0, 0.0]))
    if slope >= LEAST_SLOPE:
        return Platt(float(slope), float(intercept))
    (intercept,) = _newton(features[1:], truth, start=np.zeros(1), offset=LEAST_SLOPE * features[0])
    return Platt(LEAST_SLOPE, float(intercept))


def _newton(
    features: Floats, truth: npt.NDArray[np.bool_], *, start: Floats, offset: Floats | float = 0.0
) -> Floats:
    """Weights (k,) of features (k, n) that minimise the mean log loss."""
    weights, loss = start, _loss(start @ features + offset, truth)
    for _ in range(_STEPS):
        p = _sigmoid(weights @ features + offset)
        gradient = features @ (p - truth) / len(truth)
        curvature = (features * (p * (1.0 - p))) @ features.T / len(truth)
        step = np.linalg.solve(curvature + _RIDGE * np.eye(len(weights)), gradient)
        # Far from the optimum a whole step may overshoot.
        while (trial := _loss((weights - step) @ features + offset, truth)) > loss:
            step = step / 2.0
            if np.abs(step).max() < _CONVERGED:
                return weights
        weights, loss = weights - step, trial
        if np.abs(step).max() < _CONVERGED:
            break
    return weights


def _loss(logits: Floats, truth: npt.NDArray[np.bool_]) -> float:
    return float(np.logaddexp(0.0, np.where(truth, -logits, logits)).mean())


def _sigmoid(logits: Floats) -> Floats:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * logits)))
