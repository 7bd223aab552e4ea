use credence_complete::{CompleteError, Completer, Uncompleted};
use credence_map::{ObjectId, TrackedObject};
use credence_types::{Category, Completion, Frame, Instance, Point};
use serde_json::{Value, json};

use crate::{
    Classification, Config, Foreign, ModelChoice, ObjectCompletion, Oracle, Pipeline, TrainingSet,
    scene::{Solid, view},
    segment::Segmenter as _,
};

/// The settings of a quick pipeline on true masks, with some changed.
fn config(change: &Value) -> Config {
    let mut settings = json!({"segmenter": "oracle", "completer": "none",
        "training": {"points": 600}, "gp": {"fit_points": 300}});
    for (key, value) in change.as_object().unwrap() {
        settings[key] = value.clone();
    }
    Config::from_json(&settings.to_string()).unwrap()
}

fn made(change: &Value) -> Pipeline {
    Pipeline::new(config(change)).unwrap()
}

fn reconfigured(pipeline: &Pipeline, change: &Value) -> Pipeline {
    let foreign = Foreign::default();
    pipeline.reconfigured(config(change), foreign).unwrap()
}

/// Two views of a mug and a bowl, and one where the bowl is gone, so that it leaves the map.
fn frames() -> Vec<Frame> {
    let mug = Solid::cube(Category::Mug, [0.0, 0.0]);
    let bowl = Solid::cube(Category::Bowl, [0.0, 0.15]);
    vec![
        view(&[mug, bowl], 20.0),
        view(&[mug, bowl], 50.0),
        view(&[mug], 35.0),
    ]
}

fn instances(frame: &Frame) -> Vec<Instance> {
    Oracle.segment(frame).unwrap()
}

fn with_frames(mut pipeline: Pipeline) -> Pipeline {
    for frame in frames() {
        pipeline.add_frame(&frame).unwrap();
    }
    pipeline
}

fn complete_all(pipeline: &mut Pipeline) {
    for (index, frame) in frames().iter().enumerate() {
        pipeline
            .complete_frame(index, frame, &instances(frame))
            .unwrap();
    }
}

fn ids(pipeline: &Pipeline) -> Vec<ObjectId> {
    pipeline.map().objects().map(TrackedObject::id).collect()
}

fn stages(pipeline: &Pipeline) -> Vec<&'static str> {
    pipeline.times().iter().map(|time| time.stage).collect()
}

/// All that a pipeline says of an object.
type Said = (
    Option<ObjectCompletion>,
    Vec<ObjectCompletion>,
    Option<String>,
    TrainingSet,
    Classification,
);

fn said(pipeline: &mut Pipeline) -> Vec<Said> {
    let points = [Point::new(0.04, 0.0, 0.04), Point::new(0.0, 0.0, 0.11)];
    let ids = ids(pipeline);
    let of = |id: ObjectId| {
        let training = pipeline.training_set(id, 3).unwrap();
        let classic = ModelChoice::Classic;
        let classified = pipeline.classify(id, &training, &points, None, classic);
        (
            pipeline.completion(id).unwrap(),
            pipeline.view_completions(id).unwrap().to_vec(),
            pipeline.uncompleted(id).unwrap(),
            training,
            classified.unwrap(),
        )
    };
    ids.into_iter().map(of).collect()
}

/// Completes every instance by one point at its depth, or declines.
struct Single;

impl Completer for Single {
    fn complete(
        &self,
        _frame: &Frame,
        instances: &[Instance],
    ) -> Result<Vec<Result<Completion, Uncompleted>>, CompleteError> {
        let complete = |instance: &Instance| match instance.category() {
            Category::Mug => Ok(Completion {
                category: Category::Mug,
                score: 0.5,
                points_camera: vec![Point::new(0.0, 0.0, 0.5)],
                spread_m: vec![0.001],
            }),
            _ => Err(Uncompleted::Declined("it is no mug".to_owned())),
        };
        Ok(instances.iter().map(complete).collect())
    }
}

#[test]
fn kept_instances_give_the_bits_of_the_segmenter() {
    let mut pipeline = made(&json!({"completer": "cloud"}));
    let mut segmented = made(&json!({"completer": "cloud"}));
    for frame in frames().into_iter().skip(2) {
        let report = segmented.add_segmented(&frame, &instances(&frame)).unwrap();
        assert_eq!(report, pipeline.add_frame(&frame).unwrap());
    }
    assert!(segmented.map().voxels().eq(pipeline.map().voxels()));
    assert_eq!(said(&mut segmented), said(&mut pipeline));
    assert!(!stages(&segmented).contains(&"segment"));
    // Instances of another segmenter, on a frame that this one refuses, are as good.
    let mut blind = made(&json!({}));
    let whole = view(&[Solid::cube(Category::Mug, [0.0, 0.0])], 0.0);
    let (rgb, depth_m) = (whole.rgb().to_vec(), whole.depth_m().to_vec());
    let (camera, pose) = (*whole.intrinsics(), *whole.world_from_camera());
    let unlabelled = Frame::new(rgb, depth_m, camera, pose, None).unwrap();
    assert!(blind.add_frame(&unlabelled).is_err());
    let report = blind.add_segmented(&unlabelled, &instances(&whole));
    assert_eq!(report.unwrap().objects, [Some(ObjectId(1))]);
    let small = Instance::certain(0, vec![true; 4], Category::Mug).unwrap();
    let refused = blind.add_segmented(&whole, &[small]).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "mask holds 4 values; a 96 x 72 image needs 6912"
    );
    assert_eq!(blind.map().objects().count(), 1);
}

#[test]
fn the_same_configuration_gives_the_same_bits() {
    let mut original = with_frames(made(&json!({"completer": "cloud"})));
    assert_eq!(ids(&original), [ObjectId(1)], "the bowl has left");
    let mut copy = reconfigured(&original, &json!({"completer": "cloud"}));
    assert_eq!(copy.times(), [], "what it did itself");
    assert!(copy.frames_to_complete().is_empty());
    let said_by_copy = said(&mut copy);
    assert!(said_by_copy[0].0.is_some());
    assert_eq!(said_by_copy, said(&mut original));
    assert_eq!(
        stages(&copy),
        ["training points", "fit", "posterior", "fuse"]
    );
}

#[test]
fn frames_completed_again_are_as_if_added_under_the_configuration() {
    let base = with_frames(made(&json!({})));
    for completion in [json!({}), json!({"refine": false, "points": 300})] {
        let change = json!({"completer": "cloud", "completion": completion});
        let mut again = reconfigured(&base, &change);
        assert_eq!(again.frames_to_complete(), 0..frames().len());
        complete_all(&mut again);
        assert!(again.frames_to_complete().is_empty());
        let mut from_the_start = with_frames(made(&change));
        assert_eq!(said(&mut again), said(&mut from_the_start));
        assert!(again.map().voxels().eq(from_the_start.map().voxels()));
        // It goes on as the other does, too.
        let next = &frames()[0];
        assert_eq!(
            again.add_frame(next).unwrap(),
            from_the_start.add_frame(next).unwrap()
        );
        assert_eq!(said(&mut again), said(&mut from_the_start));
    }
}

#[test]
fn completions_of_objects_that_left_are_forgotten_again() {
    let change = json!({"completer": "python:tests.single", "completion": {"refine": false}});
    let single = || Foreign {
        completer: Some(Box::new(Single)),
        ..Foreign::default()
    };
    let from_the_start = with_frames(Pipeline::with(config(&change), single()).unwrap());
    let base = with_frames(made(&json!({})));
    let mut again = base.reconfigured(config(&change), single()).unwrap();
    complete_all(&mut again);
    assert_eq!(again.completions, from_the_start.completions);
    assert_eq!(again.view_completions(ObjectId(1)).unwrap().len(), 3);
    // A stage from outside is shared with what stays the same.
    let mut copy = again
        .reconfigured(config(&change), Foreign::default())
        .unwrap();
    copy.add_frame(&frames()[0]).unwrap();
    assert_eq!(copy.view_completions(ObjectId(1)).unwrap().len(), 4);
    let refused = base.reconfigured(config(&change), Foreign::default());
    let refused = refused.err().unwrap().to_string();
    assert!(refused.contains("needs Python"), "{refused}");
}

#[test]
fn what_shapes_single_views_asks_for_them_again_and_nothing_else_does() {
    let mut base = made(&json!({"completer": "cloud"}));
    let mug = Solid::cube(Category::Mug, [0.0, 0.0]);
    base.add_frame(&view(&[mug], 20.0)).unwrap();
    let left = |change: &Value| reconfigured(&base, change).frames_to_complete().len();
    let cloud = |key: &str, value: Value| json!({"completer": "cloud", key: value});
    for same in [
        cloud("gp", json!({"models": ["nearest"]})),
        cloud("training", json!({"points": 500})),
        cloud("metric", json!({"parts": 1})),
        json!({"completer": "none"}),
        json!({"completer": "none", "completion": {"points": 100}}),
    ] {
        assert_eq!(left(&same), 0, "{same}");
    }
    for other in [
        cloud("completion", json!({"points": 100})),
        cloud("completion", json!({"refine": false})),
        cloud("metric", json!({"table_height_m": 0.01})),
        json!({"completer": "centersnap"}),
    ] {
        assert_eq!(left(&other), 1, "{other}");
    }
    let mut without = reconfigured(&base, &json!({"completer": "none"}));
    assert_eq!(without.completion(ObjectId(1)).unwrap(), None);
    assert_eq!(without.view_completions(ObjectId(1)).unwrap(), []);
    let why = without.uncompleted(ObjectId(1)).unwrap().unwrap();
    assert!(why.contains("no completer is chosen"), "{why}");
    // What the table's height shapes is "cloud" alone.
    let none = json!({"metric": {"table_height_m": 0.01}});
    assert!(
        reconfigured(&without, &none)
            .frames_to_complete()
            .is_empty()
    );
}

#[test]
fn the_original_is_untouched() {
    let mut original = with_frames(made(&json!({"completer": "cloud"})));
    let before = said(&mut original);
    let voxels: Vec<_> = original.map().voxels().collect();
    let times = original.times().to_vec();
    let mut copy = reconfigured(&original, &json!({"completer": "cloud"}));
    let mut other = reconfigured(&original, &json!({"completer": "centersnap"}));
    let bowl = Solid::cube(Category::Bowl, [0.0, -0.15]);
    copy.add_frame(&view(&[bowl], 10.0)).unwrap();
    complete_all(&mut other);
    let (training, classified) = (&before[0].3, &before[0].4);
    let points = training.points_world()[..2].to_vec();
    assert!(copy.map().object(ObjectId(1)).is_err());
    assert!(other.annotate(ObjectId(1), &points, classified).unwrap() > 0);
    assert!(original.map().voxels().eq(voxels));
    assert_eq!(original.times(), times);
    assert_eq!(said(&mut original), before);
}

#[test]
fn a_part_of_the_frames_is_no_answer() {
    let base = with_frames(made(&json!({})));
    let cloud = json!({"completer": "cloud"});
    let mut again = reconfigured(&base, &cloud);
    let first = &frames()[0];
    again.complete_frame(0, first, &instances(first)).unwrap();
    // What a copy of it lacks is the same.
    for pipeline in [&mut reconfigured(&again, &cloud), &mut again] {
        let id = ObjectId(1);
        let refusals = [
            pipeline.completion(id).unwrap_err(),
            pipeline.view_completions(id).unwrap_err(),
            pipeline.uncompleted(id).unwrap_err(),
            pipeline.add_frame(first).unwrap_err(),
            pipeline
                .add_segmented(first, &instances(first))
                .unwrap_err(),
        ];
        for refusal in refusals {
            assert_eq!(
                refusal.to_string(),
                "1 of 3 frames are completed under this configuration; pass the others to \
                 complete_frame in their order, frame 1 next"
            );
        }
        // What needs no completion is there.
        assert!(pipeline.training_set(id, 1).is_ok());
    }
    assert_eq!(stages(&again), ["complete", "refine", "training points"]);
}

#[test]
fn a_frame_that_is_not_the_next_is_refused_and_changes_nothing() {
    let base = with_frames(made(&json!({})));
    let mut again = reconfigured(&base, &json!({"completer": "cloud"}));
    let frames = frames();
    let mut message = |index: usize, frame: &Frame, instances: &[Instance]| {
        let refused = again.complete_frame(index, frame, instances);
        assert_eq!(again.frames_to_complete(), 0..3);
        refused.unwrap_err().to_string()
    };
    let found = instances(&frames[0]);
    assert_eq!(
        message(1, &frames[1], &found),
        "frame 1 cannot be completed now: frame 0 is the next"
    );
    assert_eq!(
        message(0, &frames[1], &found),
        "frame 0 was mapped with another pose of the camera; pass the frame and the detections \
         that it was added with"
    );
    assert_eq!(
        message(0, &frames[0], &found[..1]),
        "frame 0 was mapped with another number of detections (2, not 1); pass the frame and the \
         detections that it was added with"
    );
    let small = Instance::certain(0, vec![true; 4], Category::Mug).unwrap();
    let misfits = [found[0].clone(), small];
    assert!(message(0, &frames[0], &misfits).contains("mask holds 4 values"));
    complete_all(&mut again);
    let refused = again.complete_frame(3, &frames[0], &found).unwrap_err();
    assert_eq!(
        refused.to_string(),
        "frame 3 cannot be completed now: all 3 frames are completed"
    );
}

#[test]
fn another_segmentation_or_map_is_refused_by_name() {
    let base = made(&json!({}));
    let message = |change: &Value| {
        let refused = base.reconfigured(config(change), Foreign::default());
        refused.err().unwrap().to_string()
    };
    let why = "only later stages can be reconfigured: make a new pipeline";
    for (change, what) in [
        (
            json!({"segmenter": "maskrcnn"}),
            r#"segmenter is "maskrcnn", but the frames were mapped with "oracle""#,
        ),
        (
            json!({"segmentation": {"trim": false}}),
            "segmentation.trim is false, but the frames were mapped with true",
        ),
        (
            json!({"map": {"resolution_m": 0.01}}),
            "map.resolution_m is 0.01, but the frames were mapped with 0.005",
        ),
    ] {
        let expected = format!("pipeline configuration: {what}; {why}");
        assert_eq!(message(&change), expected);
    }
    let mut bad = config(&json!({}));
    bad.gp.models.clear();
    let refused = base.reconfigured(bad, Foreign::default()).err().unwrap();
    assert!(refused.to_string().contains("gp.models is empty"));
}
