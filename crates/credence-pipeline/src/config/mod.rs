mod choices;
mod completion;
mod difference;
mod gp;
mod map;
mod metric;
mod python;
mod recalibration;
mod segmentation;
mod strict;
#[cfg(test)]
mod tests;
mod training;

pub use choices::{AssociationChoice, KernelInput, ModelChoice, SmoothnessChoice};
pub use completion::{CompleterChoice, CompletionConfig};
pub use gp::{GpConfig, TunedConfig};
pub use map::MapConfig;
pub use metric::{MetricConfig, Weights};
pub use python::PythonFunction;
pub use recalibration::{Platt, RecalibrationConfig};
pub use segmentation::{SegmentationConfig, SegmenterChoice};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use strict::{positive, refuse_misfits, refuse_unknown_keys};
pub use training::TrainingConfig;

use crate::PipelineError;

/// Everything that can be chosen in a run of the pipeline; [`Config::default`] is the protocol.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Config {
    /// Which segmenter finds the objects.
    pub segmenter: SegmenterChoice,
    /// The segmentation.
    pub segmentation: SegmentationConfig,
    /// Which completer imagines their whole shapes.
    pub completer: CompleterChoice,
    /// The completions.
    pub completion: CompletionConfig,
    /// The semantic map.
    pub map: MapConfig,
    /// The points that a classifier learns from.
    pub training: TrainingConfig,
    /// The classifiers to run, and their Gaussian process.
    pub gp: GpConfig,
    /// The models that embed points.
    pub metric: MetricConfig,
    /// What makes a model's probabilities frequencies.
    pub recalibration: RecalibrationConfig,
}

/// Most training points: the classifier's memory grows with their square, and 50,000 fill 20 GB
/// per class.
pub(crate) const MAX_POINTS: usize = 50_000;

/// Most iterations of a fit, far beyond what a search that gets anywhere takes.
const MAX_FIT_ITERATIONS: usize = 10_000;

impl Config {
    /// Reads a JSON object; keys that are left out take their defaults.
    ///
    /// # Errors
    /// Text that is no JSON object, a key that does not exist (the nearest that does is named), a
    /// value of the wrong type or out of range.
    pub fn from_json(text: &str) -> Result<Self, PipelineError> {
        let value: Value =
            serde_json::from_str(text).map_err(|err| PipelineError::Config(err.to_string()))?;
        let Value::Object(found) = &value else {
            return Err(PipelineError::Config(
                "expected a table of settings".to_owned(),
            ));
        };
        if let Ok(Value::Object(known)) = serde_json::to_value(Self::default()) {
            refuse_unknown_keys("", found, &known)?;
            refuse_misfits(&mut Vec::new(), found, &known)?;
        }
        let config: Self =
            serde_json::from_value(value).map_err(|err| PipelineError::Config(err.to_string()))?;
        config.check()?;
        Ok(config)
    }

    /// Writes all settings, defaults included, as the JSON object that [`Config::from_json`] reads.
    ///
    /// # Errors
    /// None that is known: JSON holds every setting.
    pub fn to_json(&self) -> Result<String, PipelineError> {
        serde_json::to_string(self).map_err(|err| PipelineError::Config(err.to_string()))
    }

    pub(crate) fn check(&self) -> Result<(), PipelineError> {
        let tuned = self.gp.classic_tuned;
        for (key, value) in [
            ("map.resolution_m", self.map.resolution_m),
            ("map.max_range_m", self.map.max_range_m),
            ("map.association_gate_m", self.map.association_gate_m),
            ("training.free_margin_m", self.training.free_margin_m),
            ("training.box_padding_m", self.training.box_padding_m),
            ("gp.classic_tuned.lengthscale_m", tuned.lengthscale_m),
            ("gp.classic_tuned.outputscale", tuned.outputscale),
        ] {
            positive(key, value)?;
        }
        self.metric.check()?;
        self.segmentation.check()?;
        self.completion.check()?;
        self.recalibration.check()?;
        let TrainingConfig {
            points,
            object_share,
            ..
        } = self.training;
        if !(object_share > 0.0 && object_share < 1.0) {
            return Err(PipelineError::Config(format!(
                "training.object_share is {object_share}; it must lie strictly between 0 and 1"
            )));
        }
        for (key, value) in [
            ("training.points", points),
            ("gp.fit_points", self.gp.fit_points),
        ] {
            if value < 2 {
                return Err(PipelineError::Config(format!(
                    "{key} is {value}; it must be at least 2, one for each class"
                )));
            }
            if value > MAX_POINTS {
                return Err(PipelineError::Config(format!(
                    "{key} is {value}; it must be at most {MAX_POINTS}, as the classifier's \
                     memory grows with its square"
                )));
            }
        }
        if self.gp.fit_iterations > MAX_FIT_ITERATIONS {
            return Err(PipelineError::Config(format!(
                "gp.fit_iterations is {}; it must be at most {MAX_FIT_ITERATIONS}: a fit that \
                 converges takes some 20",
                self.gp.fit_iterations
            )));
        }
        if self.gp.models.is_empty() {
            return Err(PipelineError::Config(
                "gp.models is empty; name at least one, such as [\"classic\"]".to_owned(),
            ));
        }
        let models = &self.gp.models;
        if let Some(twice) = (1..models.len()).find(|i| models[..*i].contains(&models[*i])) {
            return Err(PipelineError::Config(format!(
                "gp.models names {} twice; list each model once",
                models[twice]
            )));
        }
        Ok(())
    }
}
