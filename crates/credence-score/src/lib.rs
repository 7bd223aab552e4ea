//! The judge: what is true of a test point, and how good the predictions about it are.
//!
//! *Truth* is geometry. A point lies on an object when its unsigned distance to the object's true
//! mesh is at most a tolerance. [`MeshTruth`] measures the distances, and casts rays.
//!
//! *Metrics* are plain functions of slices. [`BinaryMetrics`] gathers them. They rank points in
//! two ways that must not be mixed up:
//!
//! - by the **probability that the point lies on the object**, held against the truth: AUROC and
//!   average precision ([`auroc`], [`average_precision`]), calibration ([`reliability`],
//!   [`expected_calibration_error`]), [`brier_score`], [`negative_log_likelihood`];
//! - by the **confidence in the decision**, whichever way it went, held against whether the
//!   decision was right: [`RiskCoverage`] with AURC, risk at a coverage, and, restricted to the
//!   points that were predicted to lie on the object, precision at a coverage.
//!
//! A metric without a value, such as recall without positives, is `None`: never 0, 1 or NaN.
//!
//! Two baselines that a confidence must beat: random order, whose expected AURC is the error rate
//! ([`RiskCoverage::random_aurc`]), and closeness to the data ([`nearest_observation`]).
//!
//! This crate knows nothing that predicts.

mod error;
mod metrics;
mod nearest;
mod truth;

pub use error::ScoreError;
pub use metrics::{
    BinaryMetrics, Binning, Confusion, DEFAULT_BINS, ReliabilityBin, RiskCoverage, auroc,
    average_precision, brier_score, expected_calibration_error, negative_log_likelihood,
    reliability,
};
pub use nearest::nearest_observation;
pub use truth::{MAX_COORDINATE_M, MeshTruth};
