//! Which key or value of a configuration is wrong, by name.

use serde_json::{Map, Value};

use crate::{Config, PipelineError, Weights};

pub(super) fn positive(key: &str, value: f64) -> Result<(), PipelineError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(PipelineError::Config(format!(
        "{key} is {value}; it must be positive"
    )))
}

pub(super) fn finite(key: &str, value: f64) -> Result<(), PipelineError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(PipelineError::Config(format!(
        "{key} is {value}; it must be finite"
    )))
}

pub(super) fn refuse_empty(key: &str, weights: &Weights) -> Result<(), PipelineError> {
    if !weights.is_empty() {
        return Ok(());
    }
    Err(PipelineError::Config(format!(
        "{key} is empty; name a file of weights, or \"{}\" for those that come with the library",
        Weights::EMBEDDED
    )))
}

/// Compares the keys found with those of the default, table by table.
pub(super) fn refuse_unknown_keys(
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
pub(super) fn refuse_misfits<'a>(
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
        "a boolean" => "true or false",
        "a string" => "a text",
        table if table.starts_with("struct ") => "a table of settings",
        other => other,
    };
    Err(PipelineError::Config(format!(
        "{} is {value}; expected {expected}",
        path.join(".")
    )))
}
