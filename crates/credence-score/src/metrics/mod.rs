//! Metrics of binary predictions.

mod binary;
mod calibration;
mod confusion;
mod ranking;
mod selective;

pub use binary::BinaryMetrics;
pub use calibration::{
    Binning, DEFAULT_BINS, ReliabilityBin, brier_score, expected_calibration_error,
    negative_log_likelihood, reliability,
};
pub use confusion::Confusion;
pub use ranking::{auroc, average_precision};
pub use selective::RiskCoverage;
