//! The models on scenes whose answer is known.

use burn::tensor::Device;
use credence_embed::{
    MetricEmbedder, QueryEmbedder,
    metric::{MetricNetwork, MetricWidths},
    query::{QueryNetwork, Widths},
};
use credence_gp::Covariance;
use credence_types::Category::{Bowl, Mug};

use super::{
    gaussian::{Setting, gp_points},
    *,
};

pub(super) fn config(metric: &str) -> Config {
    let text = format!(r#"{{"gp": {{"fit_points": 80}}, "metric": {metric}}}"#);
    Config::from_json(&text).unwrap()
}

/// A wall of 7 x 7 mug points in the plane x = 0, and free points 3 and 4 cm before it.
pub(super) fn wall() -> TrainingSet {
    let grid = |x: f64| {
        let place = |i: i32| 0.005 * f64::from(i);
        (0..49).map(move |i| Point::new(x, place(i % 7), place(i / 7)))
    };
    let points: Vec<Point> = grid(0.0).chain(grid(0.03)).chain(grid(0.04)).collect();
    let classes = [[Mug.class(); 49], [0; 49], [0; 49]].concat();
    TrainingSet::new(points, classes)
        .unwrap()
        .with_viewpoint(Point::new(0.5, 0.0, 0.4))
        .unwrap()
}

/// On the wall, in seen free space, and half a metre behind the wall, where nothing was seen.
pub(super) fn test_points() -> Vec<Point> {
    vec![
        Point::new(0.0, 0.0125, 0.0125),
        Point::new(0.035, 0.0125, 0.0125),
        Point::new(-0.5, 0.01, 0.01),
    ]
}

pub(super) fn ask<'a>(
    training: &'a TrainingSet,
    test: &'a [Point],
    model: ModelChoice,
) -> Question<'a> {
    Question::new(training, test, Mug, model).unwrap()
}

#[test]
fn the_tuned_classic_process_has_the_scales_of_the_configuration() {
    let (training, test) = (wall(), test_points());
    let question = ask(&training, &test, ModelChoice::ClassicTuned);
    let text = r#"{"gp": {"classic_tuned": {"lengthscale_m": 0.015, "outputscale": 9}}}"#;
    let gp = Config::from_json(text).unwrap().gp;
    let answer = classic::tuned(&question, &gp, &mut Stopwatch::default()).unwrap();
    assert_eq!(answer.class[..2], [1, 0]);
    let process = answer.process.unwrap();
    assert!(process.fits.is_empty());
    for own in &process.hyperparameters {
        assert_eq!((own.lengthscale, own.outputscale), (0.015, 9.0));
    }
    // Its posterior is that of a process with these hyperparameters.
    let setting = Setting::new(&question, &gp).unwrap();
    let posterior = setting
        .gp
        .posterior(
            &setting.set,
            &Covariance::Classic,
            &process.hyperparameters,
            &gp_points("test points", &test).unwrap(),
        )
        .unwrap();
    assert_eq!(posterior.probabilities(), answer.probabilities);
}

#[test]
fn nearest_is_an_exponential_of_the_distance_to_what_was_seen() {
    let points = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.05, 0.0, 0.0]].map(Point::from);
    let training = TrainingSet::new(points.to_vec(), vec![Mug.class(), Bowl.class(), 0]).unwrap();
    // On the mug, 4.9, 5.1 and 10 mm from it, 5 mm from the bowl, by the free point, far away.
    let test = [0.0, 0.0049, 0.0051, 0.01, 0.105, 0.05, 9.0].map(|x| Point::new(x, 0.0, 0.0));
    let question = ask(&training, &test, ModelChoice::Nearest);
    assert_eq!(question.classes, [0, 2, 6]);
    let answer = nearest::answer(&question);
    let rows: Vec<&[f64]> = answer.probabilities.chunks_exact(3).collect();
    assert_eq!(rows[0], [0.0, 0.0, 1.0]);
    assert!((rows[3][2] - 0.25).abs() < 1e-12);
    assert!((rows[4][1] - 0.5).abs() < 1e-12 && rows[4][2] == 0.0);
    assert!(
        rows.iter()
            .all(|row| (row.iter().sum::<f64>() - 1.0).abs() < 1e-15)
    );
    assert_eq!(answer.class[..4], [2, 2, 0, 0]);
    assert_eq!(answer.class[5..], [0, 0]);
}

#[test]
fn a_distance_tells_free_space_without_free_points_and_a_process_does_not() {
    let points = [0.0, 0.1].map(|x| Point::new(x, 0.0, 0.0));
    let training = TrainingSet::new(points.to_vec(), vec![Mug.class(); 2]).unwrap();
    let test = [Point::new(0.05, 0.0, 0.0)];
    let answer = nearest::answer(&ask(&training, &test, ModelChoice::Nearest));
    assert_eq!(answer.class, [0]);
    let refused = Question::new(&training, &test, Mug, ModelChoice::Classic).unwrap_err();
    assert!(refused.to_string().contains("at least 2 classes"));
    let free = TrainingSet::new(points.to_vec(), vec![0; 2]).unwrap();
    assert!(Question::new(&free, &test, Mug, ModelChoice::Nearest).is_err());
}

#[test]
fn a_category_that_is_not_in_the_training_set_is_an_error() {
    let training = wall();
    for model in ModelChoice::ALL {
        let refused = Question::new(&training, &[], Bowl, model).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "the object is a bowl, and no training point is of that category; draw the training \
             set for this object"
        );
    }
}

/// Networks that were never trained: every number they give is as good as any.
pub(super) fn untrained() -> Embedders {
    let device = Device::flex();
    let widths = Widths { point: 8, code: 8 };
    Embedders {
        query: Some(QueryEmbedder::new(QueryNetwork::new(widths, &device))),
        metric: Some(MetricEmbedder::new(MetricNetwork::new(
            &MetricWidths::default(),
            &device,
        ))),
    }
}

fn asked_of(
    model: ModelChoice,
    training: &TrainingSet,
    test: &[Point],
) -> Result<Answer, PipelineError> {
    let question = Question::new(training, test, Mug, model)?;
    let mut watch = Stopwatch::default();
    answer(
        model,
        &question,
        &config(r#"{"lengthscale_m": 0.01, "outputscale": 2}"#),
        &mut untrained(),
        &mut watch,
    )
}

fn assert_sound(model: ModelChoice, answer: &Answer, classes: usize) {
    let rows = answer.probabilities.chunks_exact(classes);
    for row in rows {
        assert!(
            row.iter().all(|p| (0.0..=1.0).contains(p)),
            "{model}: {row:?}"
        );
        assert!(
            (row.iter().sum::<f64>() - 1.0).abs() < 1e-9,
            "{model}: {row:?}"
        );
    }
    if let Some(process) = &answer.process {
        let numbers = [
            &process.variance,
            &process.score,
            &process.difference_variance,
        ];
        assert!(
            numbers.iter().all(|of| of.iter().all(|v| v.is_finite())),
            "{model}"
        );
        assert!((0.0..=1.0).contains(&process.clamped_share));
    }
    if let Some(network) = &answer.network {
        assert!(network.ood.is_finite());
        let norms = network
            .embedding
            .iter()
            .map(|e| e.iter().map(|c| c * c).sum::<f64>());
        assert!(norms.into_iter().all(|norm| norm <= 1.0 + 1e-6));
    }
}

#[test]
fn nothing_is_nan_wherever_the_points_are() {
    let far = |training: &TrainingSet, by: f64| {
        let moved = |p: &Point| Point::new(p.x + by, p.y - by, p.z + by);
        let points = training.points_world().iter().map(moved).collect();
        TrainingSet::new(points, training.classes().to_vec())
            .unwrap()
            .with_viewpoint(Point::new(0.5 + by, -by, 0.4 + by))
            .unwrap()
    };
    let doubled = {
        let points = [wall().points_world(), wall().points_world()].concat();
        let classes = [wall().classes(), wall().classes()].concat();
        TrainingSet::new(points, classes)
            .unwrap()
            .with_viewpoint(Point::new(0.5, 0.0, 0.4))
            .unwrap()
    };
    let one_point = {
        let points = wall().points_world()[48..].to_vec();
        let classes = wall().classes()[48..].to_vec();
        TrainingSet::new(points, classes)
            .unwrap()
            .with_viewpoint(Point::new(0.5, 0.0, 0.4))
            .unwrap()
    };
    for (name, training) in [
        ("as seen", wall()),
        ("metres away", far(&wall(), 7.0)),
        ("every point twice", doubled),
        ("one object point", one_point),
    ] {
        let mut test = test_points();
        test.push(training.points_world()[0]);
        test.push(Point::new(1e3, -1e3, 1e3));
        for model in ModelChoice::ALL {
            let answer = asked_of(model, &training, &test)
                .unwrap_or_else(|err| panic!("{name}, {model}: {err}"));
            assert_sound(model, &answer, 2);
        }
    }
}

#[test]
fn a_network_says_what_it_lacks() {
    let message = |model, training: &TrainingSet| {
        let refused = asked_of(model, training, &test_points());
        refused.unwrap_err().to_string()
    };
    let given = wall();
    let points = given.points_world().to_vec();
    let from_nowhere = TrainingSet::new(points, given.classes().to_vec()).unwrap();
    let viewpoint = given.viewpoint_world().unwrap();
    let mugs = TrainingSet::new(given.points_world()[..49].to_vec(), vec![Mug.class(); 49])
        .unwrap()
        .with_viewpoint(viewpoint)
        .unwrap();
    for model in [ModelChoice::Metric, ModelChoice::Network] {
        assert_eq!(
            message(model, &from_nowhere),
            "the training set has no viewpoint, and the network needs one; draw the set from the \
             pipeline, or pass viewpoint_world, the mean camera centre"
        );
        assert!(
            message(model, &mugs).contains("no free points"),
            "{}",
            message(model, &mugs)
        );
    }
    let few = TrainingSet::new(
        given.points_world()[40..55].to_vec(),
        given.classes()[40..55].to_vec(),
    );
    let refused = message(ModelChoice::MetricLiteral, &few.unwrap());
    assert!(
        refused.contains("15") && refused.contains("20"),
        "{refused}"
    );
}

#[test]
fn several_objects_get_a_class_each() {
    let (points, classes) = {
        let wall = wall();
        let bowl = wall.points_world()[..49]
            .iter()
            .map(|p| p + nalgebra::Vector3::new(0.0, 0.1, 0.0));
        let points: Vec<Point> = wall.points_world().iter().copied().chain(bowl).collect();
        let classes = [wall.classes(), &[Bowl.class(); 49]].concat();
        (points, classes)
    };
    let training = TrainingSet::new(points, classes)
        .unwrap()
        .with_viewpoint(Point::new(0.5, 0.0, 0.4))
        .unwrap();
    let test = [
        Point::new(0.0, 0.0125, 0.0125),
        Point::new(0.0, 0.1125, 0.0125),
    ];
    for model in ModelChoice::ALL {
        let question = ask(&training, &test, model);
        assert_eq!(question.classes, [0, 2, 6]);
        let answer = asked_of(model, &training, &test).unwrap();
        assert_sound(model, &answer, 3);
        if !matches!(model, ModelChoice::Network | ModelChoice::MetricLiteral) {
            assert_eq!(answer.class, [2, 1], "{model}");
        }
    }
}
