use credence_complete::Completer;
use credence_map::MapError;

use super::*;
use crate::{
    Config, Foreign, Pipeline, PipelineError,
    scene::{Solid, view},
};

/// What a completer for tests does with every instance.
#[derive(Clone)]
enum Behaviour {
    /// The cube's true surface, displaced in the world.
    Displaced([f64; 3]),
    /// The cube's true surface, with points floating above it.
    Floaters,
    Declines,
    Forgets,
    Fails,
}

/// Completes 8 cm cubes that stand at the origin.
struct Cubes(Behaviour);

impl Completer for Cubes {
    fn complete(
        &self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<Vec<Result<Completion, Uncompleted>>, CompleteError> {
        let camera = frame.world_from_camera().inverse();
        let complete = |points: Vec<Point>| {
            Ok(Completion {
                category: Category::Mug,
                score: 0.5,
                spread_m: vec![0.001; points.len()],
                points_camera: points.iter().map(|p| camera.transform_point(p)).collect(),
            })
        };
        let answer = |_instance: &Instance| match &self.0 {
            Behaviour::Displaced(by) => {
                complete(cube().iter().map(|p| p + Vector3::from(*by)).collect())
            }
            Behaviour::Floaters => {
                let above = cube().into_iter().filter(|p| p.z > 0.079);
                let above = above.map(|p| p + Vector3::new(0.0, 0.0, 0.04));
                complete(cube().into_iter().chain(above).collect())
            }
            Behaviour::Declines => Err(Uncompleted::Declined("it is too shiny".to_owned())),
            Behaviour::Forgets | Behaviour::Fails => Err(Uncompleted::NotDetected),
        };
        match self.0 {
            Behaviour::Forgets => Ok(Vec::new()),
            Behaviour::Fails => Err(CompleteError::TooManyPoints { count: 7 }),
            _ => Ok(instances.iter().map(answer).collect()),
        }
    }
}

fn mug() -> Solid {
    Solid::cube(Category::Mug, [0.0, 0.0])
}

/// Points on the cube's surface, 4 mm apart, the top first.
fn cube() -> Vec<Point> {
    let inner = || (0..20).map(|i| -0.038 + 0.004 * f64::from(i));
    let pairs = || inner().flat_map(|a| inner().map(move |b| (a, b)));
    let top = pairs().map(|(a, b)| Point::new(a, b, 0.08));
    let x = [-0.04, 0.04].into_iter();
    let x = x.flat_map(|x| pairs().map(move |(a, b)| Point::new(x, a, 0.04 + b)));
    let y = [-0.04, 0.04].into_iter();
    let y = y.flat_map(|y| pairs().map(move |(a, b)| Point::new(a, y, 0.04 + b)));
    top.chain(x).chain(y).collect()
}

fn pipeline(behaviour: Behaviour, completion: &str) -> Pipeline {
    let settings = format!(
        r#"{{"segmenter": "oracle", "completer": "python:tests.cubes",
            "completion": {{{completion}}}}}"#
    );
    let config = Config::from_json(&settings).unwrap();
    let foreign = Foreign {
        completer: Some(Box::new(Cubes(behaviour))),
        ..Foreign::default()
    };
    Pipeline::with(config, foreign).unwrap()
}

/// A pipeline whose completer goes by its name.
fn on_true_masks(completer: &str) -> Pipeline {
    let settings = serde_json::json!({"segmenter": "oracle", "completer": completer});
    Pipeline::new(Config::from_json(&settings.to_string()).unwrap()).unwrap()
}

/// Adds the views and returns the one object.
fn mapped(pipeline: &mut Pipeline, azimuths_deg: &[f64]) -> ObjectId {
    for azimuth_deg in azimuths_deg {
        pipeline.add_frame(&view(&[mug()], *azimuth_deg)).unwrap();
    }
    let mut objects = pipeline.map().objects();
    objects.next().unwrap().id()
}

fn stages(pipeline: &Pipeline) -> Vec<&'static str> {
    pipeline.times().iter().map(|time| time.stage).collect()
}

/// Mean distance from the cube's surface.
fn off_m(points: &[Point]) -> f64 {
    let off = points.iter().map(|p| mug().signed_distance_m(p).abs());
    off.sum::<f64>() / points.len() as f64
}

#[test]
fn a_completion_goes_to_the_world_and_its_spread_to_a_confidence() {
    let settings = r#""refine": false, "points": 500"#;
    let mut pipeline = pipeline(Behaviour::Displaced([0.0; 3]), settings);
    let id = mapped(&mut pipeline, &[20.0]);
    let completion = pipeline.completion(id).unwrap().unwrap();
    assert_eq!(completion.points_world.len(), 500);
    for (found, expected) in completion.points_world.iter().zip(cube()) {
        assert!((found - expected).norm() < 1e-12);
    }
    assert_eq!(
        (completion.category, completion.score),
        (Category::Mug, 0.5)
    );
    let confidence = completion.confidence();
    assert_eq!(confidence.len(), 500);
    assert!((confidence[0] - (1.0 - (-5.0_f64).exp())).abs() < 1e-12);
    assert_eq!(completion.registration, None);
    assert_eq!(pipeline.uncompleted(id).unwrap(), None);
    assert_eq!(stages(&pipeline), ["segment", "complete", "map", "fuse"]);
}

#[test]
fn a_spread_of_nothing_is_certainty() {
    let completion = ObjectCompletion {
        category: Category::Can,
        score: 1.0,
        points_world: vec![Point::origin(); 2],
        spread_m: vec![0.0, f64::INFINITY],
        registration: None,
    };
    assert_eq!(completion.confidence(), [1.0, 0.0]);
}

#[test]
fn refinement_registers_each_view() {
    let mut pipeline = pipeline(Behaviour::Displaced([0.006, -0.004, 0.003]), "");
    let id = mapped(&mut pipeline, &[30.0, -50.0]);
    let views = pipeline.view_completions(id).unwrap();
    assert_eq!(views.len(), 2);
    for view in views {
        let registration = view.registration.unwrap();
        assert!(registration.residual_before_m > 0.002, "{registration:?}");
        assert!(registration.residual_after_m < 0.0005, "{registration:?}");
        assert!(off_m(&view.points_world) < 0.001);
    }
    let fused = pipeline.completion(id).unwrap().unwrap();
    assert_eq!(fused.registration, None);
    assert!(off_m(&fused.points_world) < 0.001);
    assert_eq!(
        stages(&pipeline),
        ["segment", "complete", "refine", "map", "fuse"]
    );
}

#[test]
fn fused_views_hold_nothing_that_was_looked_through() {
    let settings = r#""refine": false, "points": 1000"#;
    let mut pipeline = pipeline(Behaviour::Floaters, settings);
    let id = mapped(&mut pipeline, &[0.0, 120.0, 240.0]);
    let alone = &pipeline.view_completions(id).unwrap()[0];
    assert_eq!(alone.points_world.len(), 1000);
    let fused = pipeline.completion(id).unwrap().unwrap();
    assert_eq!(fused.points_world.len(), 1000);
    assert!(fused.points_world.iter().all(|p| p.z < 0.1));
    assert!(off_m(&fused.points_world) < 1e-9);
}

#[test]
fn a_reason_stands_until_a_view_completes_the_object() {
    let mut declining = pipeline(Behaviour::Declines, "");
    let id = mapped(&mut declining, &[0.0]);
    assert_eq!(declining.completion(id).unwrap(), None);
    assert_eq!(declining.view_completions(id).unwrap(), []);
    let why = declining.uncompleted(id).unwrap();
    assert_eq!(why.as_deref(), Some("it is too shiny"));
    // A stage that did nothing has no time.
    assert_eq!(stages(&declining), ["segment", "complete", "refine", "map"]);

    let mut completions = Completions::default();
    let frame = view(&[mug()], 0.0);
    let completion = Completion {
        category: Category::Mug,
        score: 1.0,
        points_camera: vec![Point::origin()],
        spread_m: vec![0.0],
    };
    let few = Uncompleted::TooFewPoints {
        found: 3,
        least: 50,
    };
    completions.note(id, Err(few), &frame, 9);
    let why = completions.uncompleted(id).unwrap().to_string();
    assert!(
        why.starts_with("3 of its pixels have a valid depth"),
        "{why}"
    );
    completions.note(id, Ok((completion, None)), &frame, 9);
    completions.note(id, Err(Uncompleted::NotDetected), &frame, 9);
    assert_eq!(completions.uncompleted(id), None);
    assert_eq!(completions.of(id).len(), 1);
    completions.forget(id);
    assert!(completions.of(id).is_empty());
}

#[test]
fn without_a_completer_nothing_is_done_and_that_is_the_reason() {
    let mut pipeline = on_true_masks("none");
    let id = mapped(&mut pipeline, &[0.0]);
    assert_eq!(pipeline.completion(id).unwrap(), None);
    let why = pipeline.uncompleted(id).unwrap().unwrap();
    assert!(why.contains("no completer is chosen"), "{why}");
    assert_eq!(stages(&pipeline), ["segment", "map"]);
}

#[test]
fn a_completer_that_fails_or_forgets_leaves_the_map_alone() {
    for (behaviour, message) in [
        (
            Behaviour::Forgets,
            "the completer gave 0 answers; 1 instances need one each",
        ),
        (
            Behaviour::Fails,
            "7 points are more than a neighbour search can hold; pass fewer",
        ),
    ] {
        let mut pipeline = pipeline(behaviour, "");
        let refused = pipeline.add_frame(&view(&[mug()], 0.0)).unwrap_err();
        assert_eq!(refused.to_string(), message);
        assert_eq!(pipeline.map().voxels().count(), 0);
    }
}

#[test]
fn objects_that_are_gone_or_never_were_have_no_completion() {
    let mut pipeline = pipeline(Behaviour::Displaced([0.0; 3]), "");
    let id = mapped(&mut pipeline, &[0.0]);
    while pipeline.map().object(id).is_ok() {
        pipeline.add_frame(&view(&[], 0.0)).unwrap();
    }
    let is_unknown = |err: PipelineError| {
        assert!(
            matches!(err, PipelineError::Map(MapError::UnknownObject { .. })),
            "{err}"
        );
    };
    is_unknown(pipeline.completion(id).unwrap_err());
    is_unknown(pipeline.view_completions(ObjectId(99)).unwrap_err());
    is_unknown(pipeline.uncompleted(ObjectId(99)).unwrap_err());
}

#[test]
fn an_object_cut_by_the_image_border_is_completed() {
    // Half of it lies to the right of the image.
    let cut = Solid::cube(Category::Mug, [0.0, 0.28]);
    let frame = view(&[cut], 0.0);
    let ids = &frame.truth().unwrap().instance_ids;
    let width = frame.intrinsics().width();
    let at_border = |column: usize| ids.iter().skip(column).step_by(width).any(|id| *id == 1);
    assert!(at_border(0) || at_border(width - 1));
    let mut pipeline = pipeline(Behaviour::Displaced([0.003, 0.28, 0.0]), "");
    let report = pipeline.add_frame(&frame).unwrap();
    let id = report.objects[0].unwrap();
    assert!(pipeline.completion(id).unwrap().is_some());
}

#[test]
fn a_python_completer_needs_python() {
    let config = Config::from_json(r#"{"completer": "python:tests.cubes"}"#).unwrap();
    let refused = Pipeline::new(config).err().unwrap().to_string();
    assert!(
        refused.contains("completer = \"python:tests.cubes\" needs Python"),
        "{refused}"
    );
}

#[test]
fn the_cloud_completer_comes_with_the_library() {
    let mut pipeline = on_true_masks("cloud");
    let id = mapped(&mut pipeline, &[30.0, 75.0]);
    let views = pipeline.view_completions(id).unwrap();
    assert_eq!(views.len(), 2);
    for view in views {
        let registration = view.registration.unwrap();
        assert!(registration.residual_after_m <= registration.residual_before_m);
        // No category is a cube, but its top and two of its sides are seen.
        assert!(off_m(&view.points_world) < 0.02);
    }
    let fused = pipeline.completion(id).unwrap().unwrap();
    assert!(fused.points_world.len() > 1000);
    assert!(fused.spread_m.iter().all(|s| *s > 0.0));
}

#[test]
fn centersnap_comes_with_the_library() {
    let mut pipeline = on_true_masks("centersnap");
    let id = mapped(&mut pipeline, &[30.0]);
    // Whether it takes a grey cube for any of its objects does not matter here.
    let completion = pipeline.completion(id).unwrap();
    assert_eq!(
        completion.is_none(),
        pipeline.uncompleted(id).unwrap().is_some()
    );
    assert_eq!(
        stages(&pipeline)[..4],
        ["segment", "complete", "refine", "map"]
    );
}

#[test]
fn an_object_of_few_measured_pixels_has_no_completion_and_a_reason() {
    let mut pipeline = on_true_masks("cloud");
    let whole = view(&[mug()], 30.0);
    let ids = &whole.truth().unwrap().instance_ids;
    let mut left = 40;
    let measured = ids.iter().zip(whole.depth_m()).map(|(id, depth_m)| {
        let is_left = *id == 0 || left > 0;
        left -= u32::from(*id == 1 && left > 0);
        if is_left { *depth_m } else { f32::NAN }
    });
    let frame = Frame::new(
        whole.rgb().to_vec(),
        measured.collect(),
        *whole.intrinsics(),
        *whole.world_from_camera(),
        whole.truth().cloned(),
    )
    .unwrap();
    let report = pipeline.add_frame(&frame).unwrap();
    let id = report.objects[0].unwrap();
    assert_eq!(pipeline.completion(id).unwrap(), None);
    assert_eq!(
        pipeline.uncompleted(id).unwrap().as_deref(),
        Some("40 of its pixels have a valid depth; a completion needs at least 50")
    );
}

#[test]
fn weights_that_are_not_there_are_found_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.safetensors");
    let refusal = |completer: &str| {
        let settings = serde_json::json!({
            "completer": completer, "completion": {"weights": path.to_str().unwrap()}
        });
        let config = Config::from_json(&settings.to_string()).unwrap();
        Pipeline::new(config).err().unwrap().to_string()
    };
    let completers = ["cloud", "centersnap"];
    let missing = completers.map(refusal);
    std::fs::write(&path, b"no weights").unwrap();
    let corrupt = completers.map(refusal);
    for (missing, corrupt) in missing.iter().zip(&corrupt) {
        assert!(missing.contains("mine.safetensors"), "{missing}");
        assert!(corrupt.contains("mine.safetensors"), "{corrupt}");
        assert_ne!(missing, corrupt);
    }
}
