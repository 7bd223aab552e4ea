use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::strict::{finite, positive, refuse_empty};
use crate::{KernelInput, PipelineError};

/// Most parts of an observation.
const MAX_PARTS: usize = 32;

/// Where a network's weights come from: "embedded" for those that come with the library, else the
/// path of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Weights(String);

impl Weights {
    pub(super) const EMBEDDED: &str = "embedded";

    /// The file, if it is one.
    pub fn file(&self) -> Option<&Path> {
        (self.0 != Self::EMBEDDED).then(|| Path::new(&self.0))
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Default for Weights {
    fn default() -> Self {
        Self(Self::EMBEDDED.to_owned())
    }
}

impl From<PathBuf> for Weights {
    fn from(path: PathBuf) -> Self {
        Self(path.to_string_lossy().into_owned())
    }
}

/// Settings of the models that embed points by a network: `metric`, `network` and
/// `metric_literal`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MetricConfig {
    /// Disjoint random parts of the observation whose answers `metric` pools; 1 is one look at
    /// everything, as `network` takes. Small observations are divided into fewer.
    pub parts: usize,
    /// T in p = sigmoid(logit / T), the query network's probability.
    pub temperature: f64,
    /// Lengthscale of the process of `metric` between coordinates, metres.
    pub lengthscale_m: f64,
    /// Prior variance of its latent functions.
    pub outputscale: f64,
    /// What its kernel compares: `xyz` or `xyz_embedding`.
    pub kernel_input: KernelInput,
    /// Its lengthscale between embeddings, which lie in the unit ball.
    pub embedding_lengthscale: f64,
    /// Whether `metric` falls back to `classic` where the training points contradict the network.
    pub gate: bool,
    /// The gate's log evidence ratio is divided by this.
    pub gate_temperature: f64,
    /// Height of the table top in the world, metres.
    pub table_height_m: f64,
    /// Lengthscale of `metric_literal` between coordinates, metres: the marginal likelihood on
    /// embeddings says nothing about it.
    pub literal_lengthscale_m: f64,
    /// Weights of the query network: "embedded" or a file.
    pub query_weights: Weights,
    /// Weights of the network of `metric_literal`: "embedded" or a file.
    pub metric_weights: Weights,
}

impl Default for MetricConfig {
    fn default() -> Self {
        Self {
            parts: 3,
            temperature: 1.01,
            lengthscale_m: 0.00232,
            outputscale: 0.219,
            kernel_input: KernelInput::default(),
            embedding_lengthscale: 0.5,
            gate: false,
            gate_temperature: 1.0,
            table_height_m: 0.0,
            literal_lengthscale_m: 0.003,
            query_weights: Weights::default(),
            metric_weights: Weights::default(),
        }
    }
}

impl MetricConfig {
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        for (key, value) in [
            ("metric.temperature", self.temperature),
            ("metric.lengthscale_m", self.lengthscale_m),
            ("metric.outputscale", self.outputscale),
            ("metric.embedding_lengthscale", self.embedding_lengthscale),
            ("metric.gate_temperature", self.gate_temperature),
            ("metric.literal_lengthscale_m", self.literal_lengthscale_m),
        ] {
            positive(key, value)?;
        }
        if !(1..=MAX_PARTS).contains(&self.parts) {
            return Err(PipelineError::Config(format!(
                "metric.parts is {}; it must lie in [1, {MAX_PARTS}]: parts of few points say little",
                self.parts
            )));
        }
        finite("metric.table_height_m", self.table_height_m)?;
        for (key, weights) in [
            ("metric.query_weights", &self.query_weights),
            ("metric.metric_weights", &self.metric_weights),
        ] {
            refuse_empty(key, weights)?;
        }
        Ok(())
    }
}
