use credence_complete::Completer;

use crate::{CompleterChoice, Config, PipelineError};

/// What completes objects, if anything does.
pub(crate) struct Completers(Option<Box<dyn Completer>>);

impl Completers {
    /// The configuration's choice.
    pub(crate) fn new(config: &Config) -> Result<Self, PipelineError> {
        match &config.completer {
            CompleterChoice::None => Ok(Self(None)),
            CompleterChoice::Python(function) => Err(PipelineError::Config(format!(
                "completer = \"{}\" needs Python; make the pipeline there, or pass a completer",
                CompleterChoice::Python(function.clone())
            ))),
        }
    }

    /// One from outside.
    pub(crate) fn foreign(completer: Box<dyn Completer>) -> Self {
        Self(Some(completer))
    }

    pub(crate) fn get(&self) -> Option<&dyn Completer> {
        self.0.as_deref()
    }
}
