//! What bad input gets: the message that names it.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use credence_gp::{
    Covariance, DirichletGp, FitConfig, GpError, Hyperparameters, Points, Start, TrainingSet,
};

fn message<T: std::fmt::Debug>(result: Result<T, GpError>) -> String {
    result.unwrap_err().to_string()
}

fn points(rows: &[f64]) -> Points {
    Points::from_rows("points", rows, 1).unwrap()
}

fn training() -> TrainingSet {
    TrainingSet::new(points(&[0.0, 1.0, 2.0]), &[0, 1, 1], 2).unwrap()
}

const GOOD: Hyperparameters = Hyperparameters {
    lengthscale: 1.0,
    outputscale: 1.0,
    mean: 0.0,
};

const GP: DirichletGp = DirichletGp {
    smoothness: credence_gp::Smoothness::FiveHalves,
    alpha_epsilon: 0.01,
};

#[test]
fn malformed_points() {
    assert_eq!(
        message(Points::from_rows("test points", &[1.0], 0)),
        "test points has dimension 0; each point needs at least one coordinate"
    );
    assert_eq!(
        message(Points::from_rows("test points", &[1.0; 7], 3)),
        "test points holds 7 values, which is not a multiple of the dimension 3"
    );
    for (value, shown) in [(f64::NAN, "NaN"), (f64::NEG_INFINITY, "-inf")] {
        assert_eq!(
            message(Points::from_rows("test points", &[0.0, 0.0, 0.0, value], 2)),
            format!(
                "test points[1] has the coordinate {shown}; remove non-finite points, \
                 and keep coordinates within 1e150 of zero"
            )
        );
    }
    assert!(Points::from_rows("test points", &[1e151], 1).is_err());
    assert!(Points::from_rows("test points", &[], 3).unwrap().is_empty());
}

#[test]
fn malformed_training_sets() {
    assert_eq!(
        message(TrainingSet::new(points(&[0.0]), &[0], 1)),
        "a classifier of 1 classes has nothing to decide; use at least 2 classes"
    );
    assert_eq!(
        message(TrainingSet::new(points(&[]), &[], 2)),
        "there are no training points; pass at least one point of each class"
    );
    assert_eq!(
        message(TrainingSet::new(points(&[0.0, 1.0]), &[0], 2)),
        "labels has 1 entries; it needs 2, one per training point"
    );
    assert_eq!(
        message(TrainingSet::new(points(&[0.0, 1.0]), &[0, 2], 2)),
        "label 2 of training point 1 is out of range; labels run from 0 to 1"
    );
    assert_eq!(
        message(TrainingSet::new(points(&[0.0, 1.0]), &[1, 1], 2)),
        "class 0 has no training point; add one, or leave the class out"
    );
    assert_eq!(
        message(TrainingSet::new(points(&[0.0, 1.0]), &[0, 1], usize::MAX)),
        "class 2 has no training point; add one, or leave the class out"
    );
}

#[test]
fn hyperparameters_out_of_range() {
    let posterior = |own: Hyperparameters| {
        GP.posterior(
            &training(),
            &Covariance::Classic,
            &[GOOD, own],
            &points(&[0.0]),
        )
    };
    assert!(posterior(GOOD).is_ok());
    for (own, expected) in [
        (
            Hyperparameters {
                lengthscale: 0.0,
                ..GOOD
            },
            "lengthscale is 0; it must be positive and finite",
        ),
        (
            Hyperparameters {
                lengthscale: f64::NAN,
                ..GOOD
            },
            "lengthscale is NaN; it must be positive and finite",
        ),
        (
            Hyperparameters {
                outputscale: -1.0,
                ..GOOD
            },
            "outputscale is -1; it must be positive and finite",
        ),
        (
            Hyperparameters {
                mean: f64::INFINITY,
                ..GOOD
            },
            "mean is inf; it must be finite",
        ),
    ] {
        assert_eq!(message(posterior(own)), expected);
        assert!(
            GP.likelihood(&training(), &Covariance::Classic, &[GOOD, own])
                .is_err()
        );
    }
    let far = Hyperparameters {
        mean: 1e300,
        ..GOOD
    };
    assert_eq!(
        message(GP.likelihood(&training(), &Covariance::Classic, &[GOOD, far])),
        "the likelihood of class 1 overflows with lengthscale 1e0, outputscale 1e0 and mean 1e300; \
         use less extreme hyperparameters"
    );
    assert_eq!(
        message(GP.likelihood(&training(), &Covariance::Classic, &[GOOD])),
        "hyperparameters has 1 entries; it needs 2, one per class"
    );
    assert_eq!(
        message(
            DirichletGp {
                alpha_epsilon: 0.0,
                ..GP
            }
            .targets(&training())
        ),
        "alpha_epsilon is 0; it must be between 1e-12 and 1"
    );
}

#[test]
fn extreme_hyperparameters_give_numbers_or_an_error_but_never_nan() {
    for (labels, classes) in [([0, 1, 0, 1], 2), ([0, 1, 0, 2], 3)] {
        let training = TrainingSet::new(points(&[0.0, 0.0, 1.0, 1e-9]), &labels, classes).unwrap();
        extreme_hyperparameters(&training, &points(&[0.0, 0.5, 1e100]));
    }
}

fn extreme_hyperparameters(training: &TrainingSet, test: &Points) {
    let scales = [1e-300, 1.0, 1e9, 1e300];
    for lengthscale in scales {
        for outputscale in scales {
            for mean in [-1e300, 0.0, 1e6] {
                let own = Hyperparameters {
                    lengthscale,
                    outputscale,
                    mean,
                };
                let classic = Covariance::Classic;
                let all = vec![own; training.classes()];
                if let Ok(posterior) = GP.posterior(training, &classic, &all, test) {
                    let values = [posterior.mean().concat(), posterior.variance().concat()];
                    assert!(values.concat().iter().all(|v| v.is_finite()), "{own:?}");
                    assert!(
                        posterior
                            .probabilities()
                            .iter()
                            .all(|p| (0.0..=1.0).contains(p)),
                        "{own:?}"
                    );
                    let scores = posterior.confidence().unwrap();
                    assert!(scores.iter().all(|s| (0.0..=1.0).contains(s)), "{own:?}");
                }
                if let Ok(likelihoods) = GP.likelihood(training, &classic, &all) {
                    assert!(likelihoods.iter().all(|l| {
                        l.per_datum.is_finite() && l.gradient.lengthscale.is_finite()
                    }));
                }
            }
        }
    }
}

#[test]
fn extreme_points_give_a_fit() {
    for rows in [
        [0.0, 0.0, 0.0, 0.0],
        [-1e150, 1e150, 0.0, 1.0],
        [0.0, 1e-160, 2e-160, 1.0],
        [5e-324, 0.0, 1e-323, 0.0],
    ] {
        let training = TrainingSet::new(points(&rows), &[0, 1, 0, 1], 2).unwrap();
        for fit in GP
            .fit(&training, &Covariance::Classic, &FitConfig::default())
            .unwrap()
        {
            let own = fit.hyperparameters;
            for value in [own.lengthscale, own.outputscale, own.mean, fit.per_datum] {
                assert!(value.is_finite(), "{rows:?}: {fit:?}");
            }
        }
    }
}

#[test]
fn fits_that_cannot_start() {
    let fit = |config: FitConfig| GP.fit(&training(), &Covariance::Classic, &config);
    let subset = |subset: &[usize]| {
        fit(FitConfig {
            subset: Some(subset.to_vec()),
            ..FitConfig::default()
        })
    };
    assert_eq!(
        message(subset(&[0, 3])),
        "the subset names training point 3, but there are 3"
    );
    assert_eq!(
        message(subset(&[1, 2])),
        "class 0 has no training point; add one, or leave the class out"
    );
    assert_eq!(
        message(subset(&[])),
        "there are no training points; pass at least one point of each class"
    );
    assert_eq!(
        message(fit(FitConfig {
            start: Some(Start {
                lengthscale: -2.0,
                outputscale: 1.0
            }),
            ..FitConfig::default()
        })),
        "start.lengthscale is -2; it must be positive and finite"
    );
    assert_eq!(
        message(fit(FitConfig {
            gradient_tolerance: f64::NAN,
            ..FitConfig::default()
        })),
        "gradient_tolerance is NaN; it must be finite and not negative"
    );
}

#[test]
fn mismatched_spaces_and_classes() {
    let plane = Points::from_rows("test", &[0.0, 0.0], 2).unwrap();
    assert_eq!(
        message(GP.posterior(&training(), &Covariance::Classic, &[GOOD; 2], &plane)),
        "test points has dimension 2, but training points has 1; use one space for both"
    );
    assert_eq!(
        message(GP.posterior_covariance(
            &training(),
            &Covariance::Classic,
            &[GOOD; 2],
            2,
            &points(&[0.0])
        )),
        "class 2 does not exist; the classifier has 2"
    );
    let literal = |embeddings: &[f64], lengthscales: &[f64]| {
        let covariance = Covariance::MetricLiteral {
            embeddings: points(embeddings),
            coordinate_lengthscales: lengthscales.to_vec(),
        };
        GP.posterior(&training(), &covariance, &[GOOD; 2], &points(&[0.0]))
    };
    assert_eq!(
        message(literal(&[0.0; 2], &[1.0; 2])),
        "embeddings has 2 entries; it needs 3, one per training point"
    );
    assert_eq!(
        message(literal(&[0.0; 3], &[1.0])),
        "coordinate_lengthscales has 1 entries; it needs 2, one per class"
    );
    assert_eq!(
        message(literal(&[0.0; 3], &[1.0, 0.0])),
        "coordinate_lengthscale is 0; it must be positive and finite"
    );
}
