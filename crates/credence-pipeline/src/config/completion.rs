use serde::{Deserialize, Serialize};

use super::{PythonFunction, Weights, python::named_or_python, strict::refuse_empty};
use crate::PipelineError;

/// Most points of a completion.
const MOST_POINTS: usize = 16_384;

/// The completers by name.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum CompleterChoice {
    /// "none": no object is completed.
    None,
    /// "cloud": the network that is asked about points around what was seen of an object.
    #[default]
    Cloud,
    /// "centersnap": the network that finds all objects of a frame at once.
    CenterSnap,
    /// "python:module.function": a callable that Python imports.
    Python(PythonFunction),
}

named_or_python!(
    CompleterChoice,
    "completer",
    [None = "none", Cloud = "cloud", CenterSnap = "centersnap"]
);

/// Settings of shape completion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CompletionConfig {
    /// Whether completions are registered to the observed points.
    pub refine: bool,
    /// Points of a completion, at most.
    pub points: usize,
    /// Weights of the completer's network: "embedded" or a file. Beside that of "centersnap" lies
    /// its auto-encoder's, `autoencoder.safetensors`.
    pub weights: Weights,
}

impl Default for CompletionConfig {
    fn default() -> Self {
        Self {
            refine: true,
            points: 2048,
            weights: Weights::default(),
        }
    }
}

impl CompletionConfig {
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        if !(1..=MOST_POINTS).contains(&self.points) {
            return Err(PipelineError::Config(format!(
                "completion.points is {}; it must lie in [1, {MOST_POINTS}]",
                self.points
            )));
        }
        refuse_empty("completion.weights", &self.weights)
    }
}
