use serde_json::Value;

use super::Config;
use crate::PipelineError;

/// What decides how frames are segmented and mapped.
const MAPPING: [&str; 3] = ["segmenter", "segmentation", "map"];

impl Config {
    /// Checks that `other` segments and maps frames as this configuration does.
    ///
    /// # Errors
    /// The first setting that differs, by name.
    pub(crate) fn check_maps_as(&self, other: &Self) -> Result<(), PipelineError> {
        let values = |config: &Self| {
            serde_json::to_value(config).map_err(|err| PipelineError::Config(err.to_string()))
        };
        let (own, others) = (values(self)?, values(other)?);
        for key in MAPPING {
            if let Some((key, own, other)) = difference(key, &own[key], &others[key]) {
                return Err(PipelineError::Config(format!(
                    "{key} is {other}, but the frames were mapped with {own}; only later stages can \
                     be reconfigured: make a new pipeline"
                )));
            }
        }
        Ok(())
    }
}

/// The first setting in which two tables of the same keys differ: its name and both values.
fn difference<'a>(
    key: &str,
    one: &'a Value,
    other: &'a Value,
) -> Option<(String, &'a Value, &'a Value)> {
    match (one, other) {
        (Value::Object(entries), Value::Object(_)) => entries
            .iter()
            .find_map(|(name, value)| difference(&format!("{key}.{name}"), value, &other[name])),
        _ => (one != other).then(|| (key.to_owned(), one, other)),
    }
}
