"""How far confidences can be trusted, from what a run recorded.

For figures and reports, all from `summarise_run`:

- `Calibration`: a run at a tolerance; its `cells`, one `CalibrationCell` for each class, test set
  and model; a cell's `series`, a `SeriesSummary` for each score by name (`SERIES`).
- `SeriesSummary.pooled`, `.pooled_equal_mass`: `Reliability`, the diagram over the points of all
  scenes (None for the baselines, and where a series is no probability).
- `SeriesSummary.mean_risk` over `COVERAGES`: the mean over scenes of the risk-coverage curve, and
  `SeriesSummary.risks` (scenes, coverages) with `CalibrationCell.objects_of_scenes` for intervals.
- `SeriesSummary.metrics`: a `MeanEstimate` for each of `METRICS`, with intervals over objects.

On arrays: `reliability`, `brier_parts`, `risk_coverage`. On one scene: `scene_points`. Thresholds:
`find_threshold` on a run, `choose_threshold` on any objects' losses.
"""

from __future__ import annotations

from harness.calibration.choosing import (
    ThresholdOptions,
    ThresholdReport,
    Validation,
    find_threshold,
    validate,
)
from harness.calibration.losses import (
    THRESHOLDS,
    Kept,
    Losses,
    judge_threshold,
    object_losses,
)
from harness.calibration.probabilities import (
    BINS,
    BrierParts,
    Reliability,
    brier_parts,
    negative_log_likelihood,
    reliability,
)
from harness.calibration.ranking import (
    COVERAGES,
    RiskCoverage,
    precision_at,
    risk_at,
    risk_coverage,
)
from harness.calibration.read import read_points
from harness.calibration.scene_metrics import (
    PRECISION_COVERAGES,
    PROBABILITY_METRICS,
    RANKING_METRICS,
    mean_risk,
    scene_risks,
)
from harness.calibration.series import BASELINES, SCORES, SERIES, ScenePoints, scene_points
from harness.calibration.summary import (
    METRICS,
    Calibration,
    CalibrationCell,
    SeriesSummary,
    summarise_run,
)
from harness.calibration.threshold import Choice, Goal, choose_threshold

__all__ = [
    "BASELINES",
    "BINS",
    "BrierParts",
    "COVERAGES",
    "Calibration",
    "CalibrationCell",
    "Choice",
    "Goal",
    "Kept",
    "Losses",
    "METRICS",
    "PRECISION_COVERAGES",
    "PROBABILITY_METRICS",
    "RANKING_METRICS",
    "Reliability",
    "RiskCoverage",
    "SCORES",
    "SERIES",
    "ScenePoints",
    "SeriesSummary",
    "THRESHOLDS",
    "ThresholdOptions",
    "ThresholdReport",
    "Validation",
    "brier_parts",
    "choose_threshold",
    "find_threshold",
    "judge_threshold",
    "mean_risk",
    "negative_log_likelihood",
    "object_losses",
    "precision_at",
    "read_points",
    "reliability",
    "risk_at",
    "risk_coverage",
    "scene_points",
    "scene_risks",
    "summarise_run",
    "validate",
]
