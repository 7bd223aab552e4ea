//! The metrics together: what is undefined, what is refused, and laws that hold on any input.

use credence_score::{BinaryMetrics, RiskCoverage};
use proptest::prelude::*;

const UNSCORED: [fn(&BinaryMetrics) -> Option<f64>; 13] = [
    |m| m.auroc,
    |m| m.average_precision,
    |m| m.ece,
    |m| m.ece_equal_mass,
    |m| m.brier,
    |m| m.nll,
    |m| m.aurc,
    |m| m.excess_aurc,
    |m| m.random_aurc,
    |m| m.risk_at_50,
    |m| m.risk_at_80,
    |m| m.precision_at_50,
    |m| m.precision_at_80,
];

#[test]
fn everything_at_once_by_hand() {
    let predicted = [true, true, false, false];
    let truth = [true, false, false, true];
    let probability = [0.9, 0.6, 0.2, 0.4];
    // Confidence in the decision: how far the probability lies from a coin's.
    let confidence = [0.4, 0.1, 0.3, 0.1];
    let metrics =
        BinaryMetrics::evaluate(&predicted, &truth, Some(&probability), Some(&confidence)).unwrap();
    assert_eq!(metrics.confusion.fractions(), Some([0.25; 4]));
    assert_eq!(metrics.auroc, Some(0.75));
    // .9 true (1), .6 false, .4 true (2/3).
    assert!((metrics.average_precision.unwrap() - 5.0 / 6.0).abs() < 1e-15);
    // Every point is alone in its bin, so both errors are the mean of |truth - p|.
    for error in [metrics.ece, metrics.ece_equal_mass] {
        assert!((error.unwrap() - 0.375).abs() < 1e-15);
    }
    assert!((metrics.brier.unwrap() - (0.01 + 0.36 + 0.04 + 0.36) / 4.0).abs() < 1e-15);
    // Both wrong decisions come last: 0, 0, 1/3, 1/2.
    assert!((metrics.aurc.unwrap() - 5.0 / 24.0).abs() < 1e-15);
    assert_eq!(metrics.excess_aurc, Some(0.0));
    assert_eq!(metrics.random_aurc, Some(0.5));
    assert_eq!(metrics.risk_at_50, Some(0.0));
    assert_eq!(metrics.risk_at_80, Some(0.5));
    assert_eq!(metrics.precision_at_50, Some(1.0));
    assert_eq!(metrics.precision_at_80, Some(0.5));
}

#[test]
fn what_is_undefined_or_not_given_is_none() {
    let bare = BinaryMetrics::evaluate(&[true], &[true], None, None).unwrap();
    let empty = BinaryMetrics::evaluate(&[], &[], Some(&[]), Some(&[])).unwrap();
    for metric in UNSCORED {
        assert_eq!(metric(&bare), None);
        assert_eq!(metric(&empty), None);
    }
    // Only free points, none predicted otherwise: no ranking, no precision, but calibration.
    let free = BinaryMetrics::evaluate(
        &[false; 2],
        &[false; 2],
        Some(&[0.1, 0.3]),
        Some(&[0.9, 0.7]),
    )
    .unwrap();
    assert_eq!(free.auroc, None);
    assert_eq!(free.average_precision, None);
    assert_eq!(free.precision_at_50, None);
    assert!((free.ece.unwrap() - 0.2).abs() < 1e-15);
    assert_eq!(free.aurc, Some(0.0));
}

#[test]
fn arrays_of_different_lengths_are_refused_by_name() {
    let message = |predicted: &[bool], probability: &[f64], confidence: &[f64]| {
        BinaryMetrics::evaluate(
            predicted,
            &[true, false],
            Some(probability),
            Some(confidence),
        )
        .unwrap_err()
        .to_string()
    };
    let (two, one) = ([0.5; 2], [0.5; 1]);
    assert!(message(&[true], &two, &two).starts_with("predicted holds 1"));
    assert!(message(&[true; 2], &one, &two).starts_with("probability holds 1"));
    assert!(message(&[true; 2], &two, &one).starts_with("decision_confidence holds 1"));
    assert!(message(&[true; 2], &[0.5, 1.5], &two).contains("probability[1] is 1.5"));
}

/// Points with probabilities and confidences on a coarse grid, so that many are tied.
fn points() -> impl Strategy<Value = Vec<(bool, bool, f64, f64)>> {
    let grid = || (0..=8_i32).prop_map(|step| f64::from(step) / 8.0);
    let point = (any::<bool>(), any::<bool>(), grid(), grid());
    prop::collection::vec(point, 0..60)
}

fn evaluate(points: &[(bool, bool, f64, f64)]) -> BinaryMetrics {
    let predicted: Vec<bool> = points.iter().map(|p| p.0).collect();
    let truth: Vec<bool> = points.iter().map(|p| p.1).collect();
    let probability: Vec<f64> = points.iter().map(|p| p.2).collect();
    let confidence: Vec<f64> = points.iter().map(|p| p.3).collect();
    BinaryMetrics::evaluate(&predicted, &truth, Some(&probability), Some(&confidence))
        .expect("the test's points are valid")
}

proptest! {
    #[test]
    fn the_order_of_the_points_never_matters(
        (points, shuffled) in points().prop_flat_map(|p| (Just(p.clone()), Just(p).prop_shuffle())),
    ) {
        prop_assert_eq!(evaluate(&points), evaluate(&shuffled));
    }

    #[test]
    fn values_keep_their_ranges(points in points()) {
        let metrics = evaluate(&points);
        for metric in UNSCORED {
            if let Some(value) = metric(&metrics) {
                prop_assert!(value.is_finite() && value >= 0.0);
            }
        }
        for value in [metrics.auroc, metrics.average_precision, metrics.ece, metrics.aurc] {
            prop_assert!(value.unwrap_or(0.0) <= 1.0 + 1e-12);
        }
        prop_assert!(metrics.confusion.mcc().unwrap_or(0.0).abs() <= 1.0);
    }

    #[test]
    fn a_ranking_and_its_reverse_mirror_each_other(points in points()) {
        let mirrored: Vec<_> = points.iter().map(|&(p, t, q, c)| (p, t, 1.0 - q, c)).collect();
        let (found, mirrored) = (evaluate(&points).auroc, evaluate(&mirrored).auroc);
        prop_assert_eq!(found.is_some(), mirrored.is_some());
        if let (Some(found), Some(mirrored)) = (found, mirrored) {
            prop_assert!((found + mirrored - 1.0).abs() < 1e-12);
        }
    }

    // The expected curve under ties is the average over all orders of the tied points.
    #[test]
    fn tied_risk_is_the_mean_over_orders(correct in prop::collection::vec(any::<bool>(), 1..7)) {
        let tied = RiskCoverage::new(&vec![0.5; correct.len()], &correct).unwrap();
        let mut sum = 0.0;
        let mut orders = 0.0;
        let mut order: Vec<usize> = (0..correct.len()).collect();
        permute(&mut order, 0, &mut |order| {
            let confidence: Vec<f64> = order.iter().map(|&rank| rank as f64).collect();
            let ranked = RiskCoverage::new(&confidence, &correct).expect("valid");
            sum += ranked.aurc().expect("points are given");
            orders += 1.0;
        });
        prop_assert!((tied.aurc().unwrap() - sum / orders).abs() < 1e-12);
        prop_assert!((tied.random_aurc().unwrap() - sum / orders).abs() < 1e-12);
    }
}

fn permute(order: &mut Vec<usize>, from: usize, visit: &mut impl FnMut(&[usize])) {
    if from == order.len() {
        visit(order);
    }
    for i in from..order.len() {
        order.swap(from, i);
        permute(order, from + 1, visit);
        order.swap(from, i);
    }
}
