use super::ranking::{TieGroup, tie_groups, totals};
use crate::ScoreError;

/// Number of bins of the calibration errors in reports.
pub const DEFAULT_BINS: usize = 15;

/// Distance from 0 and 1 at which the likelihood clips a probability: f64's epsilon, as
/// scikit-learn's `log_loss`. One wrong point said to be certain costs 36 nats, not infinitely many.
const LIKELIHOOD_CLIP: f64 = f64::EPSILON;

/// How probabilities are sorted into bins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Binning {
    /// Bin b of B holds \[b/B, (b+1)/B), the last one 1 as well.
    EqualWidth,
    /// Bins hold equally many points, up to one. Tied points share the bin that the middle of the
    /// tie falls into, so that the result does not depend on the order of the points.
    EqualMass,
}

/// A bin of a reliability diagram that holds at least one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReliabilityBin {
    /// Number of points.
    pub count: usize,
    /// Their mean probability of lying on the object.
    pub mean_probability: f64,
    /// The share of them that does.
    pub frequency: f64,
}

/// The reliability diagram of P(the point lies on the object): its bins that hold points, by
/// rising probability.
///
/// # Errors
/// No bins, arrays of different lengths, a probability outside \[0, 1\].
pub fn reliability(
    probability: &[f64],
    truth: &[bool],
    binning: Binning,
    bins: usize,
) -> Result<Vec<ReliabilityBin>, ScoreError> {
    if bins == 0 {
        return Err(ScoreError::Bins);
    }
    Ok(reliability_of(
        &tie_groups(probability, truth)?,
        binning,
        bins,
    ))
}

/// Expected calibration error: the mean over the points of |frequency - mean probability| of the
/// bin they are in (Naeini et al. 2015). `None` without points.
///
/// # Errors
/// As [`reliability`].
pub fn expected_calibration_error(
    probability: &[f64],
    truth: &[bool],
    binning: Binning,
    bins: usize,
) -> Result<Option<f64>, ScoreError> {
    Ok(calibration_error_of(&reliability(
        probability,
        truth,
        binning,
        bins,
    )?))
}

/// Brier score: the mean squared difference of probability and truth. `None` without points.
///
/// # Errors
/// Arrays of different lengths, a probability outside \[0, 1\].
pub fn brier_score(probability: &[f64], truth: &[bool]) -> Result<Option<f64>, ScoreError> {
    Ok(brier_of(&tie_groups(probability, truth)?))
}

/// Mean negative log-likelihood of the truth, nats, with probabilities clipped to within f64's
/// epsilon of 0 and 1. `None` without points.
///
/// # Errors
/// Arrays of different lengths, a probability outside \[0, 1\].
pub fn negative_log_likelihood(
    probability: &[f64],
    truth: &[bool],
) -> Result<Option<f64>, ScoreError> {
    Ok(negative_log_likelihood_of(&tie_groups(probability, truth)?))
}

pub(super) fn reliability_of(
    groups: &[TieGroup],
    binning: Binning,
    bins: usize,
) -> Vec<ReliabilityBin> {
    let (positives, negatives) = totals(groups);
    let total = (positives + negatives) as u128;
    let mut below = 0;
    let mut filled: Vec<(usize, ReliabilityBin)> = Vec::new();
    for group in groups {
        let bin = match binning {
            Binning::EqualWidth => ((group.probability * bins as f64) as usize).min(bins - 1),
            Binning::EqualMass => {
                let doubled_middle = (2 * below + group.size()) as u128;
                (doubled_middle * bins as u128 / (2 * total)) as usize
            }
        };
        below += group.size();
        if filled.last().is_none_or(|(last, _)| *last != bin) {
            let empty = ReliabilityBin {
                count: 0,
                mean_probability: 0.0,
                frequency: 0.0,
            };
            filled.push((bin, empty));
        }
        // The two means hold sums until all groups are in.
        if let Some((_, bin)) = filled.last_mut() {
            bin.count += group.size();
            bin.mean_probability += group.probability * group.size() as f64;
            bin.frequency += group.positives as f64;
        }
    }
    filled
        .into_iter()
        .map(|(_, sums)| ReliabilityBin {
            count: sums.count,
            mean_probability: sums.mean_probability / sums.count as f64,
            frequency: sums.frequency / sums.count as f64,
        })
        .collect()
}

pub(super) fn calibration_error_of(bins: &[ReliabilityBin]) -> Option<f64> {
    let total: usize = bins.iter().map(|bin| bin.count).sum();
    let gaps = bins
        .iter()
        .map(|bin| bin.count as f64 * (bin.frequency - bin.mean_probability).abs());
    (total > 0).then(|| gaps.sum::<f64>() / total as f64)
}

pub(super) fn brier_of(groups: &[TieGroup]) -> Option<f64> {
    mean(groups, |group| {
        let p = group.probability;
        group.positives as f64 * (1.0 - p).powi(2) + group.negatives as f64 * p.powi(2)
    })
}

pub(super) fn negative_log_likelihood_of(groups: &[TieGroup]) -> Option<f64> {
    mean(groups, |group| {
        let p = group
            .probability
            .clamp(LIKELIHOOD_CLIP, 1.0 - LIKELIHOOD_CLIP);
        -(group.positives as f64 * p.ln() + group.negatives as f64 * (-p).ln_1p())
    })
}

/// Sum over the groups divided by the number of points; `None` without points.
fn mean(groups: &[TieGroup], term: impl Fn(&TieGroup) -> f64) -> Option<f64> {
    let (positives, negatives) = totals(groups);
    let total = positives + negatives;
    (total > 0).then(|| groups.iter().map(term).sum::<f64>() / total as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_of_equal_width_are_closed_below() {
        let probability = [0.0, 0.4, 0.5, 0.9, 1.0];
        let truth = [false, true, false, true, true];
        let bins = reliability(&probability, &truth, Binning::EqualWidth, 2).unwrap();
        let found: Vec<(usize, f64)> = bins.iter().map(|bin| (bin.count, bin.frequency)).collect();
        assert_eq!(found, [(2, 0.5), (3, 2.0 / 3.0)]);
        assert!((bins[0].mean_probability - 0.2).abs() < 1e-15);
        assert!((bins[1].mean_probability - 0.8).abs() < 1e-15);
        // (2 * .3 + 3 * (.8 - 2/3)) / 5
        let error = expected_calibration_error(&probability, &truth, Binning::EqualWidth, 2);
        assert!((error.unwrap().unwrap() - 0.2).abs() < 1e-15);
    }

    #[test]
    fn bins_of_equal_mass_hold_equally_many() {
        let probability: Vec<f64> = (0..10).map(|i| f64::from(i).powi(2) / 100.0).collect();
        let bins = reliability(&probability, &[true; 10], Binning::EqualMass, 3).unwrap();
        let counts: Vec<usize> = bins.iter().map(|bin| bin.count).collect();
        assert_eq!(counts, [3, 4, 3]);
        // More bins than points: each point its own bin.
        let bins = reliability(&[0.2, 0.7], &[true; 2], Binning::EqualMass, 15).unwrap();
        assert_eq!(bins.len(), 2);
    }

    #[test]
    fn tied_points_share_a_bin_whatever_their_order() {
        let probability = [0.3, 0.3, 0.3, 0.9];
        let errors = [[true, true, false, true], [false, true, true, true]].map(|truth| {
            expected_calibration_error(&probability, &truth, Binning::EqualMass, 2).unwrap()
        });
        // (3 * |2/3 - .3| + .1) / 4
        assert!((errors[0].unwrap() - 0.3).abs() < 1e-15);
        assert_eq!(errors[0], errors[1]);
    }

    #[test]
    fn brier_and_likelihood_by_hand() {
        let (probability, truth) = ([0.8, 0.4], [true, false]);
        let brier = brier_score(&probability, &truth).unwrap().unwrap();
        assert!((brier - 0.1).abs() < 1e-15);
        let nll = negative_log_likelihood(&probability, &truth);
        let expected = -(0.8_f64.ln() + 0.6_f64.ln()) / 2.0;
        assert!((nll.unwrap().unwrap() - expected).abs() < 1e-15);
        let certain_and_wrong = negative_log_likelihood(&[1.0], &[false]);
        assert!((certain_and_wrong.unwrap().unwrap() - 36.04).abs() < 0.01);
    }

    #[test]
    fn nothing_to_judge_has_no_value() {
        for binning in [Binning::EqualWidth, Binning::EqualMass] {
            assert_eq!(expected_calibration_error(&[], &[], binning, 15), Ok(None));
            let message = reliability(&[], &[], binning, 0).unwrap_err().to_string();
            assert!(message.contains("bins is 0"));
        }
        assert_eq!(brier_score(&[], &[]), Ok(None));
        assert_eq!(negative_log_likelihood(&[], &[]), Ok(None));
    }
}
