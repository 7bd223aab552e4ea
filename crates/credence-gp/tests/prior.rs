//! Prior means and joined features, against dense computations by hand.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use credence_gp::{
    Covariance, DirichletGp, Hyperparameters, Points, Prior, PriorMeans, Start, TrainingSet,
};
use faer::{Mat, Side, linalg::solvers::Solve as _};
use proptest::prelude::*;

const CLASSIC: Covariance = Covariance::Classic;
const ALPHA: f64 = 0.01;

fn points(rows: &[f64], dim: usize) -> Points {
    Points::from_rows("points", rows, dim).unwrap()
}

fn own(lengthscale: f64, outputscale: f64, mean: f64) -> Hyperparameters {
    Hyperparameters {
        lengthscale,
        outputscale,
        mean,
    }
}

/// Matern 5/2: s (1 + a + a^2 / 3) exp(-a), a = sqrt(5) r / l, of a squared distance.
fn matern(square: f64, lengthscale: f64, outputscale: f64) -> f64 {
    let a = (5.0 * square).sqrt() / lengthscale;
    outputscale * (1.0 + a + a * a / 3.0) * (-a).exp()
}

fn square(p: &[f64], q: &[f64]) -> f64 {
    p.iter().zip(q).map(|(p, q)| (p - q).powi(2)).sum()
}

fn target_and_noise(alpha: f64) -> (f64, f64) {
    let noise = (1.0 / alpha + 1.0).ln();
    (alpha.ln() - noise / 2.0, noise)
}

#[test]
fn a_prior_mean_is_the_target_of_that_share_of_an_observation() {
    let gp = DirichletGp::default();
    let prior = gp.prior_means(&[0.25, 0.75, 1.0, 0.0], 2).unwrap();
    for (class, shares) in [[0.25, 1.0], [0.75, 0.0]].iter().enumerate() {
        for (mean, share) in prior.means()[class].iter().zip(shares) {
            assert!((mean - target_and_noise(ALPHA + share).0).abs() < 1e-15);
        }
    }
    // A certain model says what a label would say.
    let training = TrainingSet::new(points(&[0.0, 1.0], 1), &[0, 1], 2).unwrap();
    let targets = gp.targets(&training).unwrap();
    let certain = gp.prior_means(&[1.0, 0.0, 0.0, 1.0], 2).unwrap();
    for (means, targets) in certain.means().iter().zip(targets) {
        assert_eq!(*means, targets.target);
    }
}

/// Five training and three test points in the plane, with two features each.
const X: [[f64; 2]; 8] = [
    [0.00, 0.00],
    [0.03, 0.01],
    [0.02, 0.05],
    [0.07, 0.02],
    [0.05, 0.06],
    [0.01, 0.01],
    [0.06, 0.04],
    [0.20, 0.30],
];
const E: [[f64; 2]; 8] = [
    [0.0, 0.1],
    [0.2, 0.9],
    [0.8, 0.3],
    [0.1, 0.0],
    [0.5, 0.5],
    [0.1, 0.2],
    [0.4, 0.6],
    [0.0, 0.0],
];
const LABELS: [usize; 5] = [0, 1, 1, 0, 1];
const P_OBJECT: [f64; 8] = [0.1, 0.8, 0.6, 0.3, 0.9, 0.2, 0.7, 0.5];
const TRAINED: usize = LABELS.len();

fn probabilities(of: &[f64]) -> Vec<f64> {
    of.iter().flat_map(|p| [1.0 - p, *p]).collect()
}

fn priors() -> [PriorMeans; 2] {
    let gp = DirichletGp::default();
    let (training, test) = P_OBJECT.split_at(TRAINED);
    [training, test].map(|of| gp.prior_means(&probabilities(of), 2).unwrap())
}

/// Posterior mean and variance at the test points and log evidence of one class, by the formulas
/// on dense matrices; `distance` is squared.
fn dense(
    class: usize,
    h: Hyperparameters,
    distance: impl Fn(usize, usize) -> f64,
) -> (Vec<f64>, Vec<f64>, f64) {
    let k = |i: usize, j: usize| matern(distance(i, j), h.lengthscale, h.outputscale);
    let seen = LABELS.map(|label| target_and_noise(ALPHA + f64::from(u8::from(label == class))));
    let prior = |i: usize| {
        let p = P_OBJECT[i];
        h.mean + target_and_noise(ALPHA + if class == 1 { p } else { 1.0 - p }).0
    };
    let gram = Mat::from_fn(TRAINED, TRAINED, |i, j| {
        k(i, j) + if i == j { seen[i].1 } else { 0.0 }
    });
    let residual = Mat::from_fn(TRAINED, 1, |i, _| seen[i].0 - prior(i));
    let solver = gram.partial_piv_lu();
    let weights = solver.solve(&residual);
    let (mut mean, mut variance) = (Vec::new(), Vec::new());
    for test in TRAINED..X.len() {
        let cross = Mat::from_fn(TRAINED, 1, |i, _| k(i, test));
        mean.push(prior(test) + (cross.transpose() * &weights)[(0, 0)]);
        let explained = (cross.transpose() * solver.solve(&cross))[(0, 0)];
        variance.push(h.outputscale - explained);
    }
    let fit = (residual.transpose() * &weights)[(0, 0)];
    let log_two_pi = std::f64::consts::TAU.ln();
    let evidence = -0.5 * (fit + gram.determinant().ln() + TRAINED as f64 * log_two_pi);
    (mean, variance, evidence)
}

fn assert_is_dense(training: &Points, test: &Points, distance: impl Fn(usize, usize) -> f64) {
    let hyperparameters = [own(0.04, 2.0, 0.0), own(0.06, 3.0, -0.5)];
    let training = TrainingSet::new(training.clone(), &LABELS, 2).unwrap();
    let gp = DirichletGp::default();
    let [at_training, at_test] = priors();
    let prior = Prior {
        training: &at_training,
        test: &at_test,
    };
    let posterior = gp
        .posterior_given(&training, &CLASSIC, &hyperparameters, prior, test)
        .unwrap();
    let evidence = gp
        .evidence(&training, &CLASSIC, &hyperparameters, &at_training)
        .unwrap();
    for (class, h) in hyperparameters.into_iter().enumerate() {
        let (mean, variance, log_density) = dense(class, h, &distance);
        for point in 0..mean.len() {
            assert!((posterior.mean()[class][point] - mean[point]).abs() < 1e-13);
            assert!((posterior.variance()[class][point] - variance[point]).abs() < 1e-13);
        }
        assert!((evidence[class] - log_density).abs() < 1e-12);
    }
    assert_eq!(posterior.clamped_share(), 0.0);
}

#[test]
fn posterior_and_evidence_under_prior_means_are_the_dense_formulas() {
    let (training, test) = X.split_at(TRAINED);
    let flat = |rows: &[[f64; 2]]| points(rows.as_flattened(), 2);
    assert_is_dense(&flat(training), &flat(test), |i, j| square(&X[i], &X[j]));
}

#[test]
fn joined_features_have_a_lengthscale_of_their_own() {
    let scale = 0.05;
    let joined = |from: usize, to: usize| {
        points(X[from..to].as_flattened(), 2)
            .joined(&points(E[from..to].as_flattened(), 2), scale)
            .unwrap()
    };
    let (training, test) = (joined(0, TRAINED), joined(TRAINED, X.len()));
    assert_eq!((training.len(), training.dim()), (TRAINED, 4));
    assert_is_dense(&training, &test, |i, j| {
        square(&X[i], &X[j]) + scale * scale * square(&E[i], &E[j])
    });
}

#[test]
fn without_evidence_nearby_the_prior_is_all() {
    let training = TrainingSet::new(points(&[0.0, 1.0], 1), &[0, 1], 2).unwrap();
    let gp = DirichletGp::default();
    let at_training = gp.prior_means(&probabilities(&[0.5, 0.5]), 2).unwrap();
    let at_test = gp.prior_means(&probabilities(&[0.9]), 2).unwrap();
    let posterior = gp
        .posterior_given(
            &training,
            &CLASSIC,
            &[own(0.1, 2.0, 0.0); 2],
            Prior {
                training: &at_training,
                test: &at_test,
            },
            &points(&[1e6], 1),
        )
        .unwrap();
    assert_eq!(posterior.mean(), at_test.means());
    assert_eq!(posterior.variance(), [[2.0], [2.0]]);
}

#[test]
fn a_prior_that_agrees_with_the_labels_has_the_higher_evidence() {
    let training = TrainingSet::new(points(&X[..5].concat(), 2), &LABELS, 2).unwrap();
    let gp = DirichletGp::default();
    let evidence = |object: [f64; 5]| -> f64 {
        let prior = gp.prior_means(&probabilities(&object), 2).unwrap();
        gp.evidence(&training, &CLASSIC, &[own(0.02, 2.0, 0.0); 2], &prior)
            .unwrap()
            .iter()
            .sum()
    };
    let right = LABELS.map(|label| if label == 1 { 0.9 } else { 0.1 });
    let [right, wrong] = [right, right.map(|p| 1.0 - p)].map(evidence);
    assert!(right > wrong + 5.0, "{right} {wrong}");
}

#[test]
fn evidence_without_expectations_is_the_likelihood() {
    // All probabilities one half: one constant mean, as a hyperparameter would give it.
    let training = TrainingSet::new(points(&X[..5].concat(), 2), &LABELS, 2).unwrap();
    let gp = DirichletGp::default();
    let even = gp.prior_means(&probabilities(&[0.5; 5]), 2).unwrap();
    let constant = target_and_noise(ALPHA + 0.5).0;
    let evidence = gp
        .evidence(&training, &CLASSIC, &[own(0.02, 2.0, 0.0); 2], &even)
        .unwrap();
    let likelihoods = gp
        .likelihood(&training, &CLASSIC, &[own(0.02, 2.0, constant); 2])
        .unwrap();
    for (evidence, likelihood) in evidence.iter().zip(likelihoods) {
        assert!((evidence - 5.0 * likelihood.per_datum).abs() < 1e-12);
    }
}

#[test]
fn the_best_mean_has_no_gradient() {
    let training = TrainingSet::new(points(&X[..5].concat(), 2), &LABELS, 2).unwrap();
    let gp = DirichletGp::default();
    let scales = [(0.02, 3.0), (0.05, 1.0)].map(|(lengthscale, outputscale)| Start {
        lengthscale,
        outputscale,
    });
    let best = gp.best_means(&training, &CLASSIC, &scales).unwrap();
    let likelihoods = gp.likelihood(&training, &CLASSIC, &best).unwrap();
    for ((best, scales), likelihood) in best.iter().zip(scales).zip(likelihoods) {
        assert_eq!(best.lengthscale, scales.lengthscale);
        assert_eq!(best.outputscale, scales.outputscale);
        assert!(likelihood.gradient.mean.abs() < 1e-14);
    }
}

/// Smallest eigenvalue of a symmetric matrix.
fn smallest_eigenvalue(n: usize, entry: impl Fn(usize, usize) -> f64) -> f64 {
    let matrix = Mat::from_fn(n, n, entry);
    let values = matrix.self_adjoint_eigenvalues(Side::Lower).unwrap();
    values.into_iter().fold(f64::INFINITY, f64::min)
}

/// Coordinates (metres) and features of training and test points, features in the unit ball.
fn scene() -> impl Strategy<Value = (Vec<[f64; 3]>, Vec<[f64; 3]>)> {
    let coordinate = -0.1..0.1_f64;
    let feature = -0.57..0.57_f64;
    (
        prop::collection::vec([coordinate.clone(), coordinate.clone(), coordinate], 40),
        prop::collection::vec([feature.clone(), feature.clone(), feature], 40),
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// Whatever the embeddings, the kernel on (x, e) is one covariance over training and test
    /// points together, and no variance is clamped; the prior mean does not enter it.
    #[test]
    fn the_joint_covariance_is_positive_semidefinite_and_nothing_is_clamped(
        (x, e) in scene(),
        lengthscale in 0.005..0.1_f64,
        scale in 0.001..0.5_f64,
        object in prop::collection::vec(0.0..1.0_f64, 40),
    ) {
        let joint = points(x.as_flattened(), 3)
            .joined(&points(e.as_flattened(), 3), scale)
            .unwrap();
        let distance = |i: usize, j: usize| square(&x[i], &x[j]) + scale * scale * square(&e[i], &e[j]);
        let least = smallest_eigenvalue(40, |i, j| matern(distance(i, j), lengthscale, 2.0));
        prop_assert!(least > -1e-12, "{least}");

        let half = |from: usize| {
            points(x[from..from + 20].as_flattened(), 3)
                .joined(&points(e[from..from + 20].as_flattened(), 3), scale)
                .unwrap()
        };
        prop_assert_eq!(joint.dim(), half(0).dim());
        let labels: Vec<usize> = (0..20).map(|i| i % 2).collect();
        let training = TrainingSet::new(half(0), &labels, 2).unwrap();
        let gp = DirichletGp::default();
        let [at_training, at_test] = [&object[..20], &object[20..]]
            .map(|of| gp.prior_means(&probabilities(of), 2).unwrap());
        let prior = Prior { training: &at_training, test: &at_test };
        let posterior = gp
            .posterior_given(&training, &CLASSIC, &[own(lengthscale, 2.0, 0.0); 2], prior, &half(20))
            .unwrap();
        prop_assert_eq!(posterior.clamped_share(), 0.0);
        prop_assert!(posterior.probabilities().iter().all(|p| (0.0..=1.0).contains(p)));
    }
}

#[test]
fn the_literal_model_has_no_joint_covariance() {
    // K(X,X) on embeddings that tell the points apart, the rest on coordinates that do not.
    let embeddings = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let coordinates: [f64; 4] = [0.0, 0.001, 0.002, 0.001];
    let least = smallest_eigenvalue(4, |i, j| {
        let square = if i < 3 && j < 3 {
            square(&embeddings[i], &embeddings[j])
        } else {
            (coordinates[i] - coordinates[j]).powi(2) * 1e4
        };
        matern(square, 0.1, 1.0)
    });
    assert!(least < -0.1, "{least}");
}

#[test]
fn misfits_are_named() {
    let gp = DirichletGp::default();
    let message = |probabilities: &[f64], classes| {
        gp.prior_means(probabilities, classes)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message(&[0.5; 3], 2),
        "probabilities holds 3 values, which is not a multiple of the dimension 2"
    );
    assert_eq!(
        message(&[0.5, 1.5], 2),
        "a prior probability is 1.5; it must be between 0 and 1"
    );
    assert!(message(&[0.5, f64::NAN], 2).contains("is NaN"));
    assert!(message(&[0.5], 1).contains("at least 2 classes"));

    let training = TrainingSet::new(points(&[0.0, 1.0], 1), &[0, 1], 2).unwrap();
    let [one, two] = [1, 2].map(|n| gp.prior_means(&probabilities(&vec![0.5; n]), 2).unwrap());
    let three = gp.prior_means(&[0.2; 6], 3).unwrap();
    let test = points(&[0.5], 1);
    let ask = |training_means, test_means| {
        let prior = Prior {
            training: training_means,
            test: test_means,
        };
        gp.posterior_given(&training, &CLASSIC, &[own(1.0, 1.0, 0.0); 2], prior, &test)
            .map_err(|err| err.to_string())
    };
    assert!(ask(&two, &one).is_ok());
    assert_eq!(
        ask(&one, &one).unwrap_err(),
        "prior means at training points has 1 entries; it needs 2, one per point"
    );
    assert_eq!(
        ask(&two, &two).unwrap_err(),
        "prior means at test points has 2 entries; it needs 1, one per point"
    );
    assert_eq!(
        ask(&three, &one).unwrap_err(),
        "prior means at training points has 3 entries; it needs 2, one per class"
    );
    let features = points(&[0.5, 0.5], 1);
    assert_eq!(
        test.joined(&features, 1.0).unwrap_err().to_string(),
        "features has 2 entries; it needs 1, one per point"
    );
    assert!(test.joined(&test, 0.0).is_err());
    assert!(
        points(&[1e149], 1)
            .joined(&points(&[1e149], 1), 1e3)
            .is_err()
    );
}
