use credence_map::SemanticMapConfig;

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
    assert!(message(text).ends_with("unknown key training.piont; did you mean training.points?"));
    assert!(message(r#"{"segmentor": "oracle"}"#).ends_with("did you mean segmenter?"));
}

#[test]
fn a_model_without_recalibration_is_refused_with_the_nearest() {
    assert!(
        message(r#"{"recalibration": {"metrik": {"slope": 1}}}"#)
            .ends_with("unknown key recalibration.metrik; did you mean recalibration.metric?")
    );
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
        "gp.models is [\"classical\"]; expected one of `classic`, `classic_tuned`, \
         `metric_literal`, `metric`, `network`, `nearest`",
    );
    ends(
        r#"{"map": {"association": "nearest"}}"#,
        "map.association is \"nearest\"; expected `surface` or `centroid`",
    );
    ends(
        r#"{"metric": {"kernel_input": "embedding"}}"#,
        "metric.kernel_input is \"embedding\"; expected `xyz` or `xyz_embedding`",
    );
    ends(
        r#"{"metric": {"gate": 1}}"#,
        "metric.gate is 1; expected true or false",
    );
    ends(
        r#"{"metric": {"metric_weights": 1}}"#,
        "metric.metric_weights is 1; expected a text",
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
        "model: unknown variant `metal`, expected one of `classic`, `classic_tuned`, \
         `metric_literal`, `metric`, `network`, `nearest`"
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
    assert!(message(r#"{"map": {"association_gate_m": 0}}"#).contains("association_gate_m is 0"));
    assert!(message(r#"{"training": {"points": 50001}}"#).contains("at most 50000"));
    for (table, key) in [
        ("metric", "temperature"),
        ("metric", "lengthscale_m"),
        ("metric", "outputscale"),
        ("metric", "embedding_lengthscale"),
        ("metric", "gate_temperature"),
        ("metric", "literal_lengthscale_m"),
    ] {
        let refused = message(&format!(r#"{{"{table}": {{"{key}": 0}}}}"#));
        let expected = format!("{table}.{key} is 0; it must be positive");
        assert!(refused.ends_with(&expected), "{refused}");
    }
    assert!(
        message(r#"{"gp": {"classic_tuned": {"outputscale": -1}}}"#)
            .ends_with("gp.classic_tuned.outputscale is -1; it must be positive")
    );
    assert!(
        message(r#"{"recalibration": {"metric": {"slope": 0}}}"#)
            .ends_with("recalibration.metric.slope is 0; it must be positive")
    );
    assert!(message(r#"{"metric": {"query_weights": ""}}"#).contains("query_weights is empty"));
    assert!(message("[]").contains("expected a table"));
    assert!(message("{").contains("EOF"));
}

#[test]
fn completers_go_by_name_or_by_the_functions() {
    let completer = |name: &str| {
        let text = serde_json::json!({ "completer": name }).to_string();
        Config::from_json(&text).map(|config| config.completer)
    };
    assert_eq!(completer("none").unwrap(), CompleterChoice::None);
    assert_eq!(completer("cloud").unwrap(), CompleterChoice::Cloud);
    let centersnap = completer("centersnap").unwrap();
    assert_eq!(centersnap, CompleterChoice::CenterSnap);
    assert_eq!(centersnap.to_string(), "centersnap");
    let python = completer("python:tools.shapes.complete").unwrap();
    assert_eq!(
        python,
        CompleterChoice::Python(PythonFunction {
            module: "tools.shapes".to_owned(),
            function: "complete".to_owned(),
        })
    );
    assert_eq!(python.to_string(), "python:tools.shapes.complete");
    let config = Config {
        completer: python,
        ..Config::default()
    };
    assert_eq!(
        Config::from_json(&config.to_json().unwrap()).unwrap(),
        config
    );
    for name in [
        "clod",
        "",
        "python:",
        "python:complete",
        "python:a..b",
        "python:a.b c",
        "python:a.1b",
        "tools.complete",
    ] {
        let refused = completer(name).unwrap_err().to_string();
        let expected = format!(
            "configuration: completer is \"{name}\"; expected one of `none`, `cloud`, `centersnap`"
        );
        assert!(refused.contains(&expected), "{refused}");
        assert!(refused.contains("\"python:module.function\""), "{refused}");
    }
}

#[test]
fn segmenters_go_by_name_or_by_the_functions() {
    let segmenter = |name: &str| {
        let text = serde_json::json!({ "segmenter": name }).to_string();
        Config::from_json(&text).map(|config| config.segmenter)
    };
    for (name, choice) in [
        ("maskrcnn", SegmenterChoice::MaskRcnn),
        ("maskrcnn_rgbd", SegmenterChoice::MaskRcnnRgbd),
        ("oracle", SegmenterChoice::Oracle),
    ] {
        assert_eq!(choice.to_string(), name);
        assert_eq!(segmenter(name).unwrap(), choice);
    }
    let python = segmenter("python:tools.masks.find").unwrap();
    assert_eq!(python.to_string(), "python:tools.masks.find");
    let config = Config {
        segmenter: python,
        ..Config::default()
    };
    assert_eq!(
        Config::from_json(&config.to_json().unwrap()).unwrap(),
        config
    );
    for name in ["orakel", "", "python:", "python:find", "tools.masks.find"] {
        let refused = segmenter(name).unwrap_err().to_string();
        let expected = format!(
            "configuration: segmenter is \"{name}\"; expected one of `maskrcnn`, `maskrcnn_rgbd`, `oracle`"
        );
        assert!(refused.contains(&expected), "{refused}");
        assert!(refused.contains("\"python:module.function\""), "{refused}");
    }
}

#[test]
fn settings_of_segmentation_are_checked() {
    let config =
        Config::from_json(r#"{"segmentation": {"least_score": 1, "calibrated": false}}"#).unwrap();
    assert_eq!(
        config.segmentation,
        SegmentationConfig {
            least_score: 1.0,
            calibrated: false,
            ..SegmentationConfig::default()
        }
    );
    for value in [-0.1, 1.5] {
        let refused = message(&format!(
            r#"{{"segmentation": {{"least_score": {value}}}}}"#
        ));
        let expected = format!("segmentation.least_score is {value}; it must lie in [0, 1]");
        assert!(refused.ends_with(&expected), "{refused}");
    }
    assert!(message(r#"{"segmenter": 1}"#).ends_with("segmenter is 1; expected a text"));
    assert!(
        message(r#"{"segmentation": {"weight": "a"}}"#)
            .ends_with("unknown key segmentation.weight; did you mean segmentation.weights?")
    );
    assert!(
        message(r#"{"segmentation": {"weights": ""}}"#).contains("segmentation.weights is empty")
    );
    assert!(
        message(r#"{"segmentation": {"calibrated": 1}}"#)
            .ends_with("segmentation.calibrated is 1; expected true or false")
    );
}

#[test]
fn settings_of_completion_are_checked() {
    assert!(message(r#"{"completer": 1}"#).ends_with("completer is 1; expected a text"));
    assert!(
        message(r#"{"completion": {"refin": true}}"#).ends_with("did you mean completion.refine?")
    );
    assert!(
        message(r#"{"completion": {"points": 0}}"#)
            .contains("completion.points is 0; it must lie in [1, 16384]")
    );
    assert!(message(r#"{"completion": {"weights": ""}}"#).contains("completion.weights is empty"));
}
