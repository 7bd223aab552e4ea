use std::sync::Arc;

use credence_complete::{Completer, centersnap::CenterSnap, cloud::CloudCompleter};

use crate::{CompleterChoice, CompletionConfig, Config, PipelineError};

/// What completes objects, loaded when it is first needed; clones share what is loaded.
#[derive(Clone)]
pub(crate) struct Completers {
    choice: CompleterChoice,
    completion: CompletionConfig,
    table_height_m: f64,
    loaded: Option<Arc<dyn Completer>>,
}

impl Completers {
    /// The configuration's choice, or `foreign` in its place. Files of weights are read at once, so
    /// that a wrong one is found before any work is done.
    pub(crate) fn new(
        config: &Config,
        foreign: Option<Box<dyn Completer>>,
    ) -> Result<Self, PipelineError> {
        let mut completers = Self {
            choice: config.completer.clone(),
            completion: config.completion.clone(),
            table_height_m: config.metric.table_height_m,
            loaded: foreign.map(Arc::from),
        };
        let is_python = matches!(completers.choice, CompleterChoice::Python(_));
        if is_python || config.completion.weights.file().is_some() {
            completers.get()?;
        }
        Ok(completers)
    }

    /// Whether two configurations make the same of every view. All of `[completion]` shapes that,
    /// `points` too: it is the size of the completions of single views, not only of the fused one.
    pub(crate) fn are_alike(one: &Config, other: &Config) -> bool {
        // What the network "cloud" is asked about, it sees above the table.
        let by_table = one.completer == CompleterChoice::Cloud;
        one.completer == other.completer
            && one.completion == other.completion
            && (!by_table || one.metric.table_height_m == other.metric.table_height_m)
    }

    /// Whether nothing completes objects.
    pub(crate) fn is_none(&self) -> bool {
        self.loaded.is_none() && self.choice == CompleterChoice::None
    }

    /// The completer; `None` if nothing completes objects.
    pub(crate) fn get(&mut self) -> Result<Option<&dyn Completer>, PipelineError> {
        if self.loaded.is_none() {
            self.loaded = self.load()?;
        }
        Ok(self.loaded.as_deref())
    }

    fn load(&self) -> Result<Option<Arc<dyn Completer>>, PipelineError> {
        let CompletionConfig {
            points, weights, ..
        } = &self.completion;
        Ok(match &self.choice {
            CompleterChoice::Cloud => Some(Arc::new(match weights.file() {
                None => CloudCompleter::embedded(self.table_height_m, *points)?,
                Some(path) => CloudCompleter::from_file(path, self.table_height_m, *points)?,
            })),
            CompleterChoice::CenterSnap => Some(Arc::new(match weights.file() {
                None => CenterSnap::embedded()?,
                Some(path) => CenterSnap::from_file(path)?,
            })),
            CompleterChoice::None => None,
            CompleterChoice::Python(function) => {
                return Err(PipelineError::Config(format!(
                    "completer = \"{function}\" needs Python; make the pipeline there, or pass a \
                     completer"
                )));
            }
        })
    }
}
