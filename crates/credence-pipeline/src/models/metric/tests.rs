//! The correction of a network whose answers the tests choose.

use super::*;
use crate::{
    ModelChoice,
    models::tests::{ask, config, test_points, wall},
};

/// A network that gives these probabilities of the mug, whose embeddings all lie in one place.
fn belief(of_training: impl Fn(usize) -> f64, of_test: &[f64], question: &Question<'_>) -> Belief {
    let embedded = |p: Vec<f64>| Embedded {
        embeddings: vec![[0.1, 0.2, 0.3]; p.len()],
        probabilities: p.into_iter().flat_map(|p| [1.0 - p, p]).collect(),
    };
    Belief {
        training: embedded(question.labels.iter().map(|l| of_training(*l)).collect()),
        test: embedded(of_test.to_vec()),
    }
}

fn metric(
    config: &Config,
    of_training: impl Fn(usize) -> f64,
    of_test: &[f64],
) -> (Answer, Vec<f64>) {
    let (training, test) = (wall(), test_points());
    let question = ask(&training, &test, ModelChoice::Metric);
    let belief = belief(of_training, of_test, &question);
    let answer = correct(&question, config, belief, &mut Stopwatch::default()).unwrap();
    let of_mug = answer.probabilities.iter().skip(1).step_by(2).copied();
    let of_mug = of_mug.collect();
    (answer, of_mug)
}

/// Scales at which the tests' few points reach each other.
const WIDE: &str = r#"{"lengthscale_m": 0.01, "outputscale": 2}"#;

fn agreeing(label: usize) -> f64 {
    if label == 1 { 0.9 } else { 0.1 }
}

#[test]
fn the_scene_corrects_the_network_where_it_has_points_and_only_there() {
    // The network is wrong about both places that were seen, and alone about the third.
    let (answer, p) = metric(&config(WIDE), agreeing, &[0.3, 0.7, 0.8]);
    assert!(p[0] > 0.5 && p[1] < 0.5, "{p:?}");
    assert_eq!(answer.class, [1, 0, 1]);
    let process = answer.process.unwrap();
    // Where nothing was seen, the latent difference has its prior variance, twice the outputscale.
    assert!((process.difference_variance[2] - 4.0).abs() < 1e-12);
    assert!(process.difference_variance[0] < 2.0);
    assert_eq!(process.clamped_share, 0.0);
    assert!(process.fits.is_empty());
    assert_eq!(answer.gate, None);
    let network = answer.network.unwrap();
    assert_eq!(network.probability, [0.3, 0.7, 0.8]);
    assert_eq!(network.embedding, [[0.1, 0.2, 0.3]; 3]);
    // Every training point has the probability 0.9 of its label.
    assert!((network.ood + 0.9_f64.ln()).abs() < 1e-12);
}

#[test]
fn equal_embeddings_leave_the_kernel_as_it_is_and_unequal_ones_part_points() {
    let joined = r#"{"lengthscale_m": 0.01, "outputscale": 2, "kernel_input": "xyz_embedding"}"#;
    let (_, xyz) = metric(&config(WIDE), agreeing, &[0.3, 0.7, 0.8]);
    let (_, same) = metric(&config(joined), agreeing, &[0.3, 0.7, 0.8]);
    for (a, b) in xyz.iter().zip(&same) {
        assert!((a - b).abs() < 1e-12);
    }
    let (training, test) = (wall(), test_points());
    let question = ask(&training, &test, ModelChoice::Metric);
    let mut apart = belief(agreeing, &[0.3, 0.7, 0.8], &question);
    apart.test.embeddings.fill([-9.0, -9.0, -9.0]);
    let answer = correct(&question, &config(joined), apart, &mut Stopwatch::default()).unwrap();
    // No training point is near any more.
    for variance in answer.process.unwrap().difference_variance {
        assert!((variance - 4.0).abs() < 1e-9);
    }
}

fn classic() -> Vec<f64> {
    let (training, test) = (wall(), test_points());
    let question = ask(&training, &test, ModelChoice::Classic);
    let gp = config("{}").gp;
    classic::fitted(&question, &gp, &mut Stopwatch::default())
        .unwrap()
        .probabilities
}

#[test]
fn the_gate_trusts_a_network_that_the_scene_confirms() {
    // With a small outputscale, the process claims that the network leaves little to explain.
    let sure = |label| if label == 1 { 0.999 } else { 0.001 };
    let of_test = [0.99, 0.01, 0.8];
    let settings = r#"{"gate": true, "outputscale": 0.05}"#;
    let (answer, gated) = metric(&config(settings), sure, &of_test);
    assert!(answer.gate.unwrap() > 0.999, "{:?}", answer.gate);
    let (_, open) = metric(&config(r#"{"outputscale": 0.05}"#), sure, &of_test);
    for (a, b) in gated.iter().zip(open) {
        assert!((a - b).abs() < 1e-3);
    }
}

#[test]
fn the_gate_falls_back_to_classic_where_the_scene_contradicts() {
    let wrong = |label| 1.0 - agreeing(label);
    let (answer, _) = metric(&config(r#"{"gate": true}"#), wrong, &[0.1, 0.9, 0.8]);
    assert!(answer.gate.unwrap() < 1e-6, "{:?}", answer.gate);
    for (a, b) in answer.probabilities.iter().zip(classic()) {
        assert!((a - b).abs() < 1e-6);
    }
    // It is the classic process whose variances are told, not that of the prior it refused.
    let process = answer.process.unwrap();
    assert_eq!(process.fits.len(), 2);
    for (own, fit) in process.hyperparameters.iter().zip(&process.fits) {
        assert_eq!(*own, fit.hyperparameters);
    }
}

#[test]
fn the_gate_is_the_sigmoid_of_the_log_evidence_ratio_over_its_temperature() {
    let wrong = |label| 1.0 - agreeing(label);
    let logit = |temperature: f64| {
        let settings = format!(r#"{{"gate": true, "gate_temperature": {temperature}}}"#);
        let gate = metric(&config(&settings), wrong, &[0.1; 3]).0.gate.unwrap();
        (gate / (1.0 - gate)).ln()
    };
    let (cool, warm) = (logit(100.0), logit(200.0));
    assert!((cool - 2.0 * warm).abs() < 1e-9, "{cool} {warm}");

    // The ratio by hand: the evidence of the labels under the network's expectations, less that
    // under the fitted classic process.
    let (training, test) = (wall(), test_points());
    let question = ask(&training, &test, ModelChoice::Metric);
    let belief = belief(wrong, &[0.1; 3], &question);
    let config = config("{}");
    let setting = Setting::new(&question, &config.gp).unwrap();
    let chosen = setting.set.select(&setting.fit_points).unwrap();
    let expected: Vec<f64> = setting
        .fit_points
        .iter()
        .flat_map(|i| [2 * i, 2 * i + 1].map(|i| belief.training.probabilities[i]))
        .collect();
    let shared = Hyperparameters {
        lengthscale: config.metric.lengthscale_m,
        outputscale: config.metric.outputscale,
        mean: 0.0,
    };
    let (gp, space) = (setting.gp, Covariance::Classic);
    let prior = gp.prior_means(&expected, 2).unwrap();
    let metric = gp.evidence(&chosen, &space, &[shared; 2], &prior).unwrap();
    let fits = setting.fit(&space, &config.gp).unwrap();
    let own: Vec<_> = fits.iter().map(|fit| fit.hyperparameters).collect();
    let classic = gp.likelihood(&chosen, &space, &own).unwrap();
    let ratio = metric.iter().sum::<f64>()
        - classic.iter().map(|l| l.per_datum).sum::<f64>() * chosen.len() as f64;
    assert!((cool - ratio / 100.0).abs() < 1e-6, "{cool} {ratio}");
}
