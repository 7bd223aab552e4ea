"""What an order of decisions is worth: risk against coverage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

COVERAGES: Floats = np.arange(1, 101) / 100.0
"""Where curves of several scenes are averaged."""

_COUNT_ROUNDING = 1e-9
"""By how much a coverage times the number of points may exceed a whole number by rounding."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RiskCoverage:
    """Risk against coverage: of the most confident decisions, the share that is wrong.

    Where a cut falls between points of equal confidence, the risk is its mean over their orders,
    as in `harness.native.binary_metrics`: no order of points counts, and decisions that are all
    tied are those in random order.

    Attributes
    ----------
    coverage : (n,) float64
        k / n, for k of 1 to n points kept.
    risk : (n,) float64
        Share of the k most confident that is wrong.
    aurc
        Mean risk over all coverages (Geifman and El-Yaniv 2017); None without points.
    excess_aurc
        AURC less that of the best order of the same decisions, which puts all errors last
        (Geifman et al. 2019); None without points.
    """

    coverage: Floats
    risk: Floats
    aurc: float | None
    excess_aurc: float | None


def risk_coverage(confidence_of_decision: Floats, wrong: Bools) -> RiskCoverage:
    """Rank decisions by confidence.

    Parameters
    ----------
    confidence_of_decision : (n,) float64
        Finite; its order alone counts.
    wrong : (n,) bool
        Whether each decision is wrong.

    Raises
    ------
    ValueError
        Arrays of unlike shapes, a confidence that is not finite.
    """
    if confidence_of_decision.shape != wrong.shape or wrong.ndim != 1:
        raise ValueError(
            f"confidence_of_decision has shape {confidence_of_decision.shape} and wrong "
            f"{wrong.shape}; both must be (n,)"
        )
    finite = np.isfinite(confidence_of_decision)
    if not finite.all():
        index = int(np.argmin(finite))
        raise ValueError(
            f"confidence_of_decision[{index}] is {confidence_of_decision[index]}; it must be finite"
        )
    total = len(wrong)
    kept = np.arange(1, total + 1)
    # The negative of a float turns the order around without loss, and makes -0 and 0 one value.
    _, member, sizes = np.unique(-confidence_of_decision, return_inverse=True, return_counts=True)
    errors = np.bincount(member, weights=wrong, minlength=len(sizes))
    group = np.repeat(np.arange(len(sizes)), sizes)
    points_before, errors_before = np.cumsum(sizes) - sizes, np.cumsum(errors) - errors
    taken = kept - points_before[group]
    risk = (errors_before[group] + taken * (errors / sizes)[group]) / kept
    if total == 0:
        return RiskCoverage(coverage=risk, risk=risk, aurc=None, excess_aurc=None)
    aurc = float(risk.mean())
    worst = np.arange(1, int(wrong.sum()) + 1)
    best = float((worst / (total - len(worst) + worst)).sum()) / total
    return RiskCoverage(
        coverage=kept / total, risk=risk, aurc=aurc, excess_aurc=max(aurc - best, 0.0)
    )


def risk_at(curve: RiskCoverage, coverages: Floats) -> Floats:
    """Risk (m,) at coverages (m,) in (0, 1], each rounded up to whole points; NaN without points.

    Raises
    ------
    ValueError
        A coverage outside (0, 1].
    """
    if not ((coverages > 0.0) & (coverages <= 1.0)).all():
        raise ValueError(f"coverages {coverages.tolist()} must lie in (0, 1]")
    total = len(curve.risk)
    if total == 0:
        return np.full(coverages.shape, np.nan)
    kept = np.ceil(coverages * total - _COUNT_ROUNDING).astype(np.intp)
    return np.asarray(curve.risk[np.maximum(kept, 1) - 1])


def precision_at(
    confidence_of_decision: Floats, *, predicted: Bools, truth: Bools, coverages: Floats
) -> Floats:
    """Precision (m,) among the most confident shares (m,) of the points put on the object.

    Parameters
    ----------
    confidence_of_decision : (n,) float64
        Finite; its order alone counts.
    predicted, truth : (n,) bool
        Whether each point is said to lie on the object, and whether it does.
    coverages : (m,) float64
        Of the points that are said to, in (0, 1].

    Returns
    -------
    precision : (m,) float64
        NaN where no point is said to.
    """
    curve = risk_coverage(confidence_of_decision[predicted], ~truth[predicted])
    return 1.0 - risk_at(curve, coverages)
