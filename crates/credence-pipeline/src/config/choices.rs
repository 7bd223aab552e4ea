use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::PipelineError;

/// The classifiers by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelChoice {
    /// A Gaussian process with every covariance on coordinates; its hyperparameters maximise the
    /// marginal likelihood of the scene's training points.
    Classic,
    /// The same process with hyperparameters from the configuration, chosen once on validation
    /// scenes.
    ClassicTuned,
    /// The seed paper's Eq. 1 as written: K(X,X) on embeddings, the other covariances on
    /// coordinates.
    MetricLiteral,
    /// A Gaussian process that corrects the query network by the scene's training points.
    Metric,
    /// The query network alone.
    Network,
    /// The distance to the nearest observed point alone.
    Nearest,
}

impl ModelChoice {
    /// Every model.
    pub const ALL: [Self; 6] = [
        Self::Classic,
        Self::ClassicTuned,
        Self::MetricLiteral,
        Self::Metric,
        Self::Network,
        Self::Nearest,
    ];
}

/// The trackers by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AssociationChoice {
    /// By the distance of their surfaces.
    #[default]
    Surface,
    /// By the distance of their centroids, as in the seed paper.
    Centroid,
}

/// Smoothness of the Matérn kernel by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum SmoothnessChoice {
    /// Continuous, not differentiable.
    #[serde(rename = "1/2")]
    Half,
    /// Once differentiable.
    #[serde(rename = "3/2")]
    ThreeHalves,
    /// Twice differentiable.
    #[default]
    #[serde(rename = "5/2")]
    FiveHalves,
}

/// Between which places of two points the kernel of [`ModelChoice::Metric`] measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelInput {
    /// Their coordinates.
    #[default]
    Xyz,
    /// Their coordinates and their embeddings by the query network, each with a lengthscale of its
    /// own.
    XyzEmbedding,
}

/// Names that a configuration spells an enum's values by.
macro_rules! named_by_serde {
    ($choice:ty, $what:literal) => {
        impl fmt::Display for $choice {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.serialize(f)
            }
        }

        impl FromStr for $choice {
            type Err = PipelineError;

            fn from_str(name: &str) -> Result<Self, Self::Err> {
                serde_json::from_value(Value::String(name.to_owned())).map_err(|err| {
                    PipelineError::Choice {
                        what: $what,
                        why: err.to_string(),
                    }
                })
            }
        }
    };
}

named_by_serde!(ModelChoice, "model");
named_by_serde!(SmoothnessChoice, "smoothness");
