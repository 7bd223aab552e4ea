use serde::{Deserialize, Serialize};

use crate::{ModelChoice, SmoothnessChoice};

/// Settings of the Gaussian process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct GpConfig {
    /// The classifiers to run, each a row of the result; the first one's confidences go into the map.
    pub models: Vec<ModelChoice>,
    /// Matérn smoothness: "1/2", "3/2" or "5/2".
    pub smoothness: SmoothnessChoice,
    /// Hyperparameters maximise the exact marginal likelihood of this many training points, drawn
    /// in proportion to the classes and at least one of each; the posterior always uses all of them.
    pub fit_points: usize,
    /// Iterations of L-BFGS, at most, in each of at most 3 runs.
    pub fit_iterations: usize,
    /// Hyperparameters of the model `classic_tuned`.
    pub classic_tuned: TunedConfig,
}

/// Hyperparameters that all classes share, by default those that `harness tune` chose; the constant mean of each is its likeliest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TunedConfig {
    /// Lengthscale, metres.
    pub lengthscale_m: f64,
    /// Prior variance of the latent functions.
    pub outputscale: f64,
}

impl Default for TunedConfig {
    fn default() -> Self {
        Self {
            lengthscale_m: 0.0106,
            outputscale: 25.6,
        }
    }
}

impl Default for GpConfig {
    fn default() -> Self {
        Self {
            models: vec![
                ModelChoice::Metric,
                ModelChoice::Classic,
                ModelChoice::ClassicTuned,
                ModelChoice::MetricLiteral,
                ModelChoice::Network,
                ModelChoice::Nearest,
            ],
            smoothness: SmoothnessChoice::FiveHalves,
            fit_points: 1800,
            fit_iterations: 50,
            classic_tuned: TunedConfig::default(),
        }
    }
}
