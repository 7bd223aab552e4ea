use std::{fmt, str::FromStr};

use credence_map::{Association, SemanticMapConfig, TrackerConfig};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::PipelineError;

/// Everything that can be chosen in a run of the pipeline; [`Config::default`] is the protocol.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Config {
    /// Which segmenter finds the objects.
    pub segmenter: SegmenterChoice,
    /// The semantic map.
    pub map: MapConfig,
    /// The points that a classifier learns from.
    pub training: TrainingConfig,
    /// The Gaussian process.
    pub gp: GpConfig,
}

/// The segmenters by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SegmenterChoice {
    /// The true masks that the simulator or the dataset delivers.
    #[default]
    Oracle,
}

/// The classifiers by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelChoice {
    /// Every covariance on coordinates.
    Classic,
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

named_by_serde!(SegmenterChoice, "segmenter");
named_by_serde!(ModelChoice, "model");
named_by_serde!(SmoothnessChoice, "smoothness");

/// Most training points: the classifier's memory grows with their square, and 50,000 fill 20 GB
/// per class.
const MAX_POINTS: usize = 50_000;

/// Most iterations of a fit, far beyond what a search that gets anywhere takes.
const MAX_FIT_ITERATIONS: usize = 10_000;

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

/// Settings of the semantic map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MapConfig {
    /// Edge of the smallest voxel, metres.
    pub resolution_m: f64,
    /// Rays are cut at this range, metres.
    pub max_range_m: f64,
    /// How a detection finds its object.
    pub association: AssociationChoice,
    /// Largest distance of a detection from its object, by that measure, metres.
    pub association_gate_m: f64,
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

impl Default for MapConfig {
    fn default() -> Self {
        let map = SemanticMapConfig::default();
        let (association, association_gate_m) = match map.tracker.association {
            Association::Surface { gate_m } => (AssociationChoice::Surface, gate_m),
            Association::Centroid { gate_m } => (AssociationChoice::Centroid, gate_m),
        };
        Self {
            resolution_m: map.resolution_m,
            max_range_m: map.max_range_m.unwrap_or(2.0),
            association,
            association_gate_m,
        }
    }
}

impl MapConfig {
    /// What the map is made with.
    pub(crate) fn settings(&self) -> SemanticMapConfig {
        let gate_m = self.association_gate_m;
        SemanticMapConfig {
            resolution_m: self.resolution_m,
            max_range_m: Some(self.max_range_m),
            tracker: TrackerConfig {
                association: match self.association {
                    AssociationChoice::Surface => Association::Surface { gate_m },
                    AssociationChoice::Centroid => Association::Centroid { gate_m },
                },
                ..TrackerConfig::default()
            },
            ..SemanticMapConfig::default()
        }
    }
}

/// How training points are drawn (the seed's protocol).
///
/// Observed points come from the object and from whatever else was seen in its padded box, so that
/// a neighbour is neither free space nor ignored. Neighbours take their share of the points seen
/// in the box, but at most half: a large one cannot crowd out a small object. The object's points
/// take the rest, as far as it has them, and free space fills what is left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TrainingConfig {
    /// Training points of one object, observed and free together.
    pub points: usize,
    /// Share of them that is drawn from observed points, of the object and its neighbours; the rest
    /// is free space.
    pub object_share: f64,
    /// Free points keep this distance from every observed point, metres.
    pub free_margin_m: f64,
    /// Free points are drawn in the observed points' box, padded on each side by this, metres.
    pub box_padding_m: f64,
}

impl Default for TrainingConfig {
    fn default() -> Self {
        Self {
            points: 3600,
            object_share: 0.5,
            free_margin_m: 0.01,
            box_padding_m: 0.03,
        }
    }
}

/// Settings of the Gaussian process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct GpConfig {
    /// The classifiers to run, each a row of the result.
    pub models: Vec<ModelChoice>,
    /// Matérn smoothness: "1/2", "3/2" or "5/2".
    pub smoothness: SmoothnessChoice,
    /// Hyperparameters maximise the exact marginal likelihood of this many training points, drawn
    /// in proportion to the classes and at least one of each; the posterior always uses all of them.
    pub fit_points: usize,
    /// Iterations of L-BFGS, at most, in each of at most 3 runs.
    pub fit_iterations: usize,
}

impl Default for GpConfig {
    fn default() -> Self {
        Self {
            models: vec![ModelChoice::Classic],
            smoothness: SmoothnessChoice::FiveHalves,
            fit_points: 1800,
            fit_iterations: 50,
        }
    }
}

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
        let positive = |key: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            Err(PipelineError::Config(format!(
                "{key} is {value}; it must be positive"
            )))
        };
        positive("map.resolution_m", self.map.resolution_m)?;
        positive("map.max_range_m", self.map.max_range_m)?;
        positive("map.association_gate_m", self.map.association_gate_m)?;
        positive("training.free_margin_m", self.training.free_margin_m)?;
        positive("training.box_padding_m", self.training.box_padding_m)?;
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

/// Compares the keys found with those of the default, table by table.
fn refuse_unknown_keys(
    path: &str,
    found: &Map<String, Value>,
    known: &Map<String, Value>,
) -> Result<(), PipelineError> {
    for (key, value) in found {
        match (known.get(key), value) {
            (None, _) => {
                let nearest = known
                    .keys()
                    .max_by(|a, b| {
                        strsim::jaro_winkler(a, key).total_cmp(&strsim::jaro_winkler(b, key))
                    })
                    .map_or_else(String::new, |near| format!("; did you mean {path}{near}?"));
                return Err(PipelineError::Config(format!(
                    "unknown key {path}{key}{nearest}"
                )));
            }
            (Some(Value::Object(inner)), Value::Object(value)) => {
                refuse_unknown_keys(&format!("{path}{key}."), value, inner)?;
            }
            (Some(_), _) => {}
        }
    }
    Ok(())
}

/// Tries every value by itself in the defaults' place, so that the one which does not fit is named.
fn refuse_misfits<'a>(
    path: &mut Vec<&'a str>,
    found: &'a Map<String, Value>,
    known: &Map<String, Value>,
) -> Result<(), PipelineError> {
    for (key, value) in found {
        path.push(key);
        match (known.get(key), value) {
            (Some(Value::Object(inner)), Value::Object(value)) => {
                refuse_misfits(path, value, inner)?;
            }
            _ => try_value(path, value)?,
        }
        path.pop();
    }
    Ok(())
}

fn try_value(path: &[&str], value: &Value) -> Result<(), PipelineError> {
    let alone = path.iter().rfold(value.clone(), |inner, key| {
        Value::Object(Map::from_iter([((*key).to_owned(), inner)]))
    });
    let Err(err) = serde_json::from_value::<Config>(alone) else {
        return Ok(());
    };
    let why = err.to_string();
    let expected = match why
        .rsplit_once("expected ")
        .map_or(why.as_str(), |(_, what)| what)
    {
        "usize" => "a whole number that is not negative",
        "f64" => "a number",
        "a sequence" => "a list",
        table if table.starts_with("struct ") => "a table of settings",
        other => other,
    };
    Err(PipelineError::Config(format!(
        "{} is {value}; expected {expected}",
        path.join(".")
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        Config::from_json(text).unwrap_err().to_string()
    }

    #[test]
    fn what_is_left_out_takes_its_default() {
        assert_eq!(Config::from_json("{}").unwrap(), Config::default());
        let config = Config::from_json(r#"{"training": {"points": 200}}"#).unwrap();
        assert_eq!(config.training.points, 200);
        assert_eq!(config.training.object_share, 0.5);
    }

    #[test]
    fn what_is_written_holds_every_default_and_reads_back() {
        let text = Config::default().to_json().unwrap();
        assert_eq!(Config::from_json(&text).unwrap(), Config::default());
        let partial = Config::from_json(r#"{"map": {"max_range_m": 3}}"#).unwrap();
        let whole: Value = serde_json::from_str(&partial.to_json().unwrap()).unwrap();
        assert_eq!(whole["map"]["max_range_m"], Value::from(3.0));
        assert_eq!(
            whole["gp"],
            serde_json::to_value(GpConfig::default()).unwrap()
        );
    }

    #[test]
    fn the_defaults_of_the_map_are_its_own() {
        assert_eq!(
            MapConfig::default().settings(),
            SemanticMapConfig::default()
        );
    }

    #[test]
    fn a_misspelt_key_is_refused_with_the_nearest() {
        let text = r#"{"training": {"piont": 200}}"#;
        assert!(
            message(text).ends_with("unknown key training.piont; did you mean training.points?")
        );
        assert!(message(r#"{"segmentor": "oracle"}"#).ends_with("did you mean segmenter?"));
    }

    #[test]
    fn values_of_another_type_are_refused_by_name() {
        let ends = |text, end: &str| assert!(message(text).ends_with(end), "{}", message(text));
        ends(
            r#"{"map": {"resolution_m": 0.01}, "gp": {"fit_iterations": -1}}"#,
            "configuration: gp.fit_iterations is -1; expected a whole number that is not negative",
        );
        ends(
            r#"{"training": {"points": 1.5}}"#,
            "points is 1.5; expected a whole number that is not negative",
        );
        ends(
            r#"{"map": {"resolution_m": "5"}}"#,
            "resolution_m is \"5\"; expected a number",
        );
        ends(r#"{"map": 5}"#, "map is 5; expected a table of settings");
        ends(
            r#"{"gp": {"models": "classic"}}"#,
            "models is \"classic\"; expected a list",
        );
        ends(
            r#"{"gp": {"models": ["classical"]}}"#,
            "gp.models is [\"classical\"]; expected `classic`",
        );
        ends(
            r#"{"map": {"association": "nearest"}}"#,
            "map.association is \"nearest\"; expected `surface` or `centroid`",
        );
        ends(
            r#"{"gp": {"smoothness": "7/2"}}"#,
            "smoothness is \"7/2\"; expected one of `1/2`, `3/2`, `5/2`",
        );
    }

    #[test]
    fn a_name_that_no_choice_has_says_what_was_chosen() {
        let message = "metal".parse::<ModelChoice>().unwrap_err().to_string();
        assert_eq!(
            message,
            "model: unknown variant `metal`, expected `classic`"
        );
        assert_eq!(
            "classic".parse::<ModelChoice>().unwrap(),
            ModelChoice::Classic
        );
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        assert!(message(r#"{"map": {"resolution_m": 0}}"#).contains("map.resolution_m is 0"));
        assert!(message(r#"{"training": {"object_share": 1}}"#).contains("strictly between"));
        assert!(message(r#"{"gp": {"fit_points": 1}}"#).contains("gp.fit_points is 1"));
        assert!(message(r#"{"gp": {"models": []}}"#).contains("gp.models is empty"));
        assert!(message(r#"{"gp": {"models": ["classic", "classic"]}}"#).contains("classic twice"));
        assert!(message(r#"{"gp": {"fit_iterations": 10001}}"#).contains("at most 10000"));
        assert!(
            message(r#"{"map": {"association_gate_m": 0}}"#).contains("association_gate_m is 0")
        );
        assert!(message(r#"{"training": {"points": 50001}}"#).contains("at most 50000"));
        assert!(message("[]").contains("expected a table"));
        assert!(message("{").contains("EOF"));
    }
}
