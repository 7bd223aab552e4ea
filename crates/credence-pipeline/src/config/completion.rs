use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::{Weights, strict::refuse_empty};
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

impl CompleterChoice {
    const NONE: &str = "none";
    const CLOUD: &str = "cloud";
    const CENTERSNAP: &str = "centersnap";
    const PYTHON: &str = "python:";
}

impl fmt::Display for CompleterChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str(Self::NONE),
            Self::Cloud => f.write_str(Self::CLOUD),
            Self::CenterSnap => f.write_str(Self::CENTERSNAP),
            Self::Python(function) => write!(f, "{}{function}", Self::PYTHON),
        }
    }
}

impl From<CompleterChoice> for String {
    fn from(choice: CompleterChoice) -> Self {
        choice.to_string()
    }
}

impl FromStr for CompleterChoice {
    type Err = PipelineError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let function = name.strip_prefix(Self::PYTHON);
        let function = function.and_then(PythonFunction::parse).map(Self::Python);
        let choice = match name {
            Self::NONE => Some(Self::None),
            Self::CLOUD => Some(Self::Cloud),
            Self::CENTERSNAP => Some(Self::CenterSnap),
            _ => function,
        };
        choice.ok_or_else(|| PipelineError::Choice {
            what: "completer",
            why: format!(
                "unknown completer `{name}`, expected one of `none`, `cloud`, `centersnap` or \
                 \"python:module.function\", the function's full name in Python"
            ),
        })
    }
}

impl TryFrom<String> for CompleterChoice {
    type Error = PipelineError;

    fn try_from(name: String) -> Result<Self, Self::Error> {
        name.parse()
    }
}

/// A function of a Python module.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PythonFunction {
    /// The module's full name, its parts separated by dots.
    pub module: String,
    /// The function's name in it.
    pub function: String,
}

impl PythonFunction {
    /// Reads "module.function"; `None` if that cannot be names in Python.
    fn parse(text: &str) -> Option<Self> {
        let is_name = |part: &str| {
            let mut letters = part.chars();
            let first = letters.next();
            first.is_some_and(|c| c.is_alphabetic() || c == '_')
                && letters.all(|c| c.is_alphanumeric() || c == '_')
        };
        let (module, function) = text.rsplit_once('.')?;
        text.split('.').all(is_name).then(|| Self {
            module: module.to_owned(),
            function: function.to_owned(),
        })
    }
}

impl fmt::Display for PythonFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.module, self.function)
    }
}

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
