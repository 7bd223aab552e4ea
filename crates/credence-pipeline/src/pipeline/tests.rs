use credence_map::{Association, TrackedObject};
use credence_types::{Category, FREE_CLASS};

use super::*;
use crate::scene::{Solid, view};

const SETTINGS: &str = r#"{"segmenter": "oracle", "completer": "none", "training": {"points": 600},
        "gp": {"fit_points": 300}}"#;

fn mug() -> Solid {
    Solid::cube(Category::Mug, [0.0, 0.0])
}

fn mapped() -> Pipeline {
    let mut pipeline = Pipeline::new(Config::from_json(SETTINGS).unwrap()).unwrap();
    for azimuth_deg in [-60.0, 20.0] {
        pipeline.add_frame(&view(&[mug()], azimuth_deg)).unwrap();
    }
    pipeline
}

fn only_object(pipeline: &Pipeline) -> ObjectId {
    let objects: Vec<&TrackedObject> = pipeline.map().objects().collect();
    assert_eq!(objects.len(), 1);
    objects[0].id()
}

/// Points on the top, and on the sides x = 0.04 and y = -0.04, which both views see.
fn on_surface() -> Vec<Point> {
    let inner = [-0.025, 0.0, 0.025];
    let pairs = || inner.into_iter().flat_map(|a| inner.map(|b| (a, b)));
    let top = pairs().map(|(a, b)| Point::new(a, b, 0.08));
    let front = pairs().map(|(a, b)| Point::new(0.04, a, 0.04 + b));
    let side = pairs().map(|(a, b)| Point::new(a, -0.04, 0.04 + b));
    top.chain(front).chain(side).collect()
}

/// Points 2.5 cm before the same places.
fn in_free_space() -> Vec<Point> {
    let out = |p: Point| {
        let push = |value: f64, face: f64| if value == face { face * 1.625 } else { value };
        let z = if p.z == 0.08 { 0.105 } else { p.z };
        Point::new(push(p.x, 0.04), push(p.y, -0.04), z)
    };
    on_surface().into_iter().map(out).collect()
}

#[test]
fn the_surface_is_the_object_and_seen_space_is_free() {
    let mut pipeline = mapped();
    let id = only_object(&pipeline);
    assert_eq!(pipeline.map().object(id).unwrap().category(), Category::Mug);
    let training = pipeline.training_set(id, 1).unwrap();
    let test = [on_surface(), in_free_space()].concat();
    let result = pipeline
        .classify(id, &training, &test, None, ModelChoice::Classic)
        .unwrap();

    let predictions = &result.predictions;
    assert_eq!(predictions.classes, [FREE_CLASS, Category::Mug.class()]);
    assert_eq!(result.fits.len(), 2);
    assert!(result.fits.iter().all(|fit| fit.converged && !fit.at_bound));
    assert_eq!(predictions.clamped_share, 0.0);
    let (surface, free) = predictions.points.split_at(27);
    for (point, prediction) in test.iter().zip(surface) {
        assert_eq!(prediction.class, Category::Mug.class(), "{point}");
        assert!(prediction.confidence > 0.5 && prediction.confidence <= 1.0);
    }
    for (point, prediction) in test[27..].iter().zip(free) {
        assert_eq!(prediction.class, FREE_CLASS, "{point}");
        assert!(prediction.confidence < 0.5 && prediction.confidence >= 0.0);
    }
    let scores = || predictions.points.iter().map(|p| p.score);
    assert_eq!(scores().fold(f64::INFINITY, f64::min), 0.0);
    assert_eq!(scores().fold(0.0, f64::max), 1.0);
}

#[test]
fn annotating_gives_the_voxels_the_confidences_of_the_points_in_them() {
    let mut pipeline = mapped();
    let id = only_object(&pipeline);
    assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
    let training = pipeline.training_set(id, 1).unwrap();
    // Two observed points of one voxel, which takes their mean; a point in the air; no more.
    let cloud = &pipeline.map().object(id).unwrap().cloud().points_world;
    let shared = cloud
        .iter()
        .enumerate()
        .find_map(|(i, a)| {
            let near = |b: &&Point| {
                let centre = |p: &Point| pipeline.map().voxel_at(p).map(|v| v.centre);
                centre(a).is_some() && centre(a) == centre(b)
            };
            cloud[i + 1..].iter().find(near).map(|b| [*a, *b])
        })
        .unwrap();
    let test = [shared[0], shared[1], Point::new(0.0, 0.0, 0.15)];
    let result = pipeline
        .classify(id, &training, &test, None, ModelChoice::Classic)
        .unwrap();
    assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
    assert_eq!(pipeline.annotate(id, &test, &result).unwrap(), 1);
    let points = &result.predictions.points;
    let mean = f64::midpoint(points[0].confidence, points[1].confidence);
    assert_eq!(
        pipeline.map().voxel_at(&shared[0]).unwrap().confidence,
        Some(mean)
    );
    let set = pipeline.map().voxels().filter(|v| v.confidence.is_some());
    assert_eq!(set.count(), 1);
    assert_eq!(pipeline.map().object_confidence(id).unwrap(), Some(mean));

    let refused = pipeline.annotate(id, &test[..2], &result).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "confidences holds 3 values; 2 points need one each"
    );
    assert_eq!(pipeline.map().object_confidence(id).unwrap(), Some(mean));
    let elsewhere = [Point::new(0.0, 0.0, 0.15); 3];
    assert_eq!(pipeline.annotate(id, &elsewhere, &result).unwrap(), 0);
    assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
}

#[test]
fn a_configuration_is_checked_however_it_was_made() {
    for (points, message) in [(0, "training.points is 0"), (1, "training.points is 1")] {
        let mut config = Config::default();
        config.training.points = points;
        let refused = Pipeline::new(config).err().unwrap().to_string();
        assert!(refused.contains(message), "{refused}");
    }
    let mut config = Config::default();
    config.gp.models.clear();
    assert!(Pipeline::new(config).is_err());
}

#[test]
fn the_seeds_tracker_can_be_chosen() {
    let text = r#"{"map": {"association": "centroid", "association_gate_m": 0.06}}"#;
    let pipeline = Pipeline::new(Config::from_json(text).unwrap()).unwrap();
    assert_eq!(
        pipeline.map().config().tracker.association,
        Association::Centroid { gate_m: 0.06 }
    );
}

#[test]
fn the_same_frames_and_seed_give_the_same_bits() {
    let run = || {
        let mut pipeline = mapped();
        let id = only_object(&pipeline);
        let training = pipeline.training_set(id, 5).unwrap();
        pipeline
            .classify(id, &training, &on_surface(), None, ModelChoice::Classic)
            .unwrap()
    };
    assert_eq!(run(), run());
}

#[test]
fn every_stage_notes_its_time() {
    let mut pipeline = mapped();
    let stages = |pipeline: &Pipeline| -> Vec<(&str, Option<ModelChoice>)> {
        pipeline
            .times()
            .iter()
            .map(|time| (time.stage, time.model))
            .collect()
    };
    assert_eq!(stages(&pipeline), [("segment", None), ("map", None)]);
    let mapping = pipeline.times()[1].seconds;
    pipeline.add_frame(&view(&[mug()], 0.0)).unwrap();
    assert!(
        pipeline.times()[1].seconds > mapping,
        "calls of one stage add up"
    );
    let id = only_object(&pipeline);
    let training = pipeline.training_set(id, 1).unwrap();
    pipeline
        .classify(id, &training, &on_surface(), None, ModelChoice::Classic)
        .unwrap();
    assert_eq!(
        stages(&pipeline)[2..],
        [
            ("training points", None),
            ("fit", Some(ModelChoice::Classic)),
            ("posterior", Some(ModelChoice::Classic)),
        ]
    );
    assert!(pipeline.times().iter().all(|time| time.seconds > 0.0));
}

#[test]
fn recalibration_completion_and_segmenter_make_the_confidence() {
    let settings = r#"{"segmenter": "oracle", "training": {"points": 600}, "gp": {"fit_points": 300},
        "recalibration": {"nearest": {"slope": 0.5, "intercept": 0.1}}}"#;
    let mut pipeline = Pipeline::new(Config::from_json(settings).unwrap()).unwrap();
    pipeline.add_frame(&view(&[mug()], 20.0)).unwrap();
    let id = only_object(&pipeline);
    let training = pipeline.training_set(id, 1).unwrap();
    let test = on_surface();
    let completion: Vec<f64> = (0..27).map(|i| f64::from(i) / 26.0).collect();
    let mut ask = |completion: Option<&[f64]>| {
        let nearest = ModelChoice::Nearest;
        pipeline.classify(id, &training, &test, completion, nearest)
    };
    let whole = ask(None).unwrap().predictions;
    let completed = ask(Some(&completion)).unwrap().predictions;
    assert_eq!(whole.probabilities, completed.probabilities);
    for (point, (a, b)) in whole.points.iter().zip(&completed.points).enumerate() {
        let p = whole.probabilities[2 * point + 1];
        let logit = 0.5 * (p / (1.0 - p)).ln() + 0.1;
        assert!((a.confidence - 1.0 / (1.0 + (-logit).exp())).abs() < 1e-12);
        assert!((b.confidence - a.confidence * completion[point]).abs() < 1e-15);
        // Without a variance, the confidence is the score.
        assert_eq!((a.variance, a.score), (0.0, a.confidence));
    }
    let refused = ask(Some(&[0.5])).unwrap_err().to_string();
    assert!(refused.contains("completion_confidence holds 1 values"));
}

#[test]
fn weights_that_are_not_there_are_found_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("weights.safetensors");
    for key in ["query_weights", "metric_weights"] {
        let text = serde_json::json!({"metric": {key: path.to_str().unwrap()}}).to_string();
        let made = || {
            Pipeline::new(Config::from_json(&text).unwrap())
                .err()
                .unwrap()
        };
        if path.exists() {
            std::fs::remove_file(&path).unwrap();
        }
        let missing = made();
        assert!(
            missing.to_string().contains("weights.safetensors"),
            "{missing}"
        );
        std::fs::write(&path, b"no weights").unwrap();
        let corrupt = made();
        assert!(
            corrupt.to_string().contains("weights.safetensors"),
            "{corrupt}"
        );
        assert_ne!(missing.to_string(), corrupt.to_string());
    }
}

#[test]
fn a_refused_input_changes_nothing() {
    let mut pipeline = mapped();
    let id = only_object(&pipeline);
    let voxels = |pipeline: &Pipeline| pipeline.map().voxels().count();
    let before = voxels(&pipeline);
    let seen = view(&[mug()], 90.0);
    let blind = Frame::new(
        seen.rgb().to_vec(),
        seen.depth_m().to_vec(),
        *seen.intrinsics(),
        *seen.world_from_camera(),
        None,
    );
    let refusal = pipeline.add_frame(&blind.unwrap()).unwrap_err().to_string();
    assert!(refusal.contains("needs true masks"));
    assert_eq!(voxels(&pipeline), before);

    let training = pipeline.training_set(id, 1).unwrap();
    let mut message = |training: &TrainingSet, points: &[Point]| {
        let refused = pipeline.classify(id, training, points, None, ModelChoice::Classic);
        refused.unwrap_err().to_string()
    };
    let mugs = TrainingSet::new(on_surface(), vec![Category::Mug.class(); 27]).unwrap();
    assert!(message(&mugs, &on_surface()).contains("use at least 2 classes"));
    let nan = Point::new(f64::NAN, 0.0, 0.0);
    assert!(message(&training, &[nan]).contains("test points[0]"));
    assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
    let stray = pipeline.classify(ObjectId(99), &training, &[], None, ModelChoice::Classic);
    assert!(
        stray
            .unwrap_err()
            .to_string()
            .contains("there is no object 99")
    );
}
