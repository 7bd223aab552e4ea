use crate::{ScoreError, error::same_length};

/// Points of equal probability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TieGroup {
    /// Their probability of lying on the object.
    pub(super) probability: f64,
    /// How many of them do.
    pub(super) positives: usize,
    /// How many of them do not.
    pub(super) negatives: usize,
}

impl TieGroup {
    /// Number of points.
    pub(super) const fn size(&self) -> usize {
        self.positives + self.negatives
    }
}

/// Groups points by probability, rising. Whatever is computed from the groups does not depend on
/// the order of the points, to the last bit.
///
/// # Errors
/// Arrays of different lengths, a probability outside \[0, 1\].
pub(super) fn tie_groups(probability: &[f64], truth: &[bool]) -> Result<Vec<TieGroup>, ScoreError> {
    same_length(("probability", probability.len()), ("truth", truth.len()))?;
    let outside = |value: &f64| !(0.0..=1.0).contains(value);
    if let Some(index) = probability.iter().position(outside) {
        return Err(ScoreError::Probability {
            index,
            value: probability[index],
        });
    }
    let mut points: Vec<(f64, bool)> = probability
        .iter()
        // Adding 0 turns -0 into 0, so that both fall into one group.
        .map(|p| p + 0.0)
        .zip(truth.iter().copied())
        .collect();
    points.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    Ok(points
        .chunk_by(|a, b| a.0 == b.0)
        .map(|tied| {
            let positives = tied.iter().filter(|(_, truth)| *truth).count();
            TieGroup {
                probability: tied[0].0,
                positives,
                negatives: tied.len() - positives,
            }
        })
        .collect())
}

/// Numbers of positive and of negative points.
pub(super) fn totals(groups: &[TieGroup]) -> (usize, usize) {
    groups.iter().fold((0, 0), |(positives, negatives), group| {
        (positives + group.positives, negatives + group.negatives)
    })
}

/// Area under the ROC curve: the chance that a random positive point is given a higher probability
/// than a random negative one, ties counting half (midranks).
///
/// `None` where positives or negatives are missing.
///
/// # Errors
/// Arrays of different lengths, a probability outside \[0, 1\].
pub fn auroc(probability: &[f64], truth: &[bool]) -> Result<Option<f64>, ScoreError> {
    Ok(auroc_of(&tie_groups(probability, truth)?))
}

/// Average precision: the sum over falling thresholds of the gain in recall times the precision
/// reached, AP = sum (`R_n` - `R_(n-1)`) `P_n`, without interpolation. Tied points enter together.
///
/// `None` where positives are missing.
///
/// # Errors
/// Arrays of different lengths, a probability outside \[0, 1\].
pub fn average_precision(probability: &[f64], truth: &[bool]) -> Result<Option<f64>, ScoreError> {
    Ok(average_precision_of(&tie_groups(probability, truth)?))
}

pub(super) fn auroc_of(groups: &[TieGroup]) -> Option<f64> {
    let (positives, negatives) = totals(groups);
    if positives == 0 || negatives == 0 {
        return None;
    }
    // Mann-Whitney's U, twice: an integer, hence exact.
    let mut doubled = 0_u128;
    let mut negatives_below = 0_u128;
    for group in groups {
        doubled += group.positives as u128 * (2 * negatives_below + group.negatives as u128);
        negatives_below += group.negatives as u128;
    }
    Some(doubled as f64 / (2.0 * positives as f64 * negatives as f64))
}

pub(super) fn average_precision_of(groups: &[TieGroup]) -> Option<f64> {
    let (positives, _) = totals(groups);
    if positives == 0 {
        return None;
    }
    let mut kept = 0;
    let mut found = 0;
    let mut sum = 0.0;
    for group in groups.iter().rev() {
        kept += group.size();
        found += group.positives;
        sum += group.positives as f64 * (found as f64 / kept as f64);
    }
    Some(sum / positives as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auroc_counts_ordered_pairs() {
        // Pairs (positive, negative): (.8, .4) and (.8, .1) right, (.35, .1) right, (.35, .4) wrong.
        let truth = [false, false, true, true];
        assert_eq!(auroc(&[0.1, 0.4, 0.35, 0.8], &truth), Ok(Some(0.75)));
        // A tie across the classes counts half: (1 + 1 + .5 + 1) / 4.
        assert_eq!(auroc(&[0.1, 0.4, 0.4, 0.8], &truth), Ok(Some(0.875)));
        assert_eq!(auroc(&[0.5; 4], &truth), Ok(Some(0.5)));
        assert_eq!(auroc(&[0.0, -0.0, 0.0, 0.0], &truth), Ok(Some(0.5)));
    }

    #[test]
    fn average_precision_steps_through_the_positives() {
        // Falling: .8 true (P 1), .4 false, .35 true (P 2/3): (1 + 2/3) / 2.
        let truth = [false, false, true, true];
        let found = average_precision(&[0.1, 0.4, 0.35, 0.8], &truth);
        assert!((found.unwrap().unwrap() - 5.0 / 6.0).abs() < 1e-15);
        // All tied: one step with the base rate.
        assert_eq!(average_precision(&[0.5; 4], &truth), Ok(Some(0.5)));
    }

    #[test]
    fn one_class_has_no_ranking() {
        assert_eq!(auroc(&[0.1, 0.9], &[true; 2]), Ok(None));
        assert_eq!(auroc(&[0.1, 0.9], &[false; 2]), Ok(None));
        assert_eq!(auroc(&[], &[]), Ok(None));
        assert_eq!(average_precision(&[0.1, 0.9], &[false; 2]), Ok(None));
        assert_eq!(average_precision(&[0.1, 0.9], &[true; 2]), Ok(Some(1.0)));
    }

    #[test]
    fn refuses_what_is_no_probability() {
        for value in [-0.01, 1.01, f64::NAN] {
            let message = auroc(&[0.5, value], &[true, false]).unwrap_err();
            assert!(message.to_string().contains("probability[1] is"));
            assert!(message.to_string().contains("[0, 1]"));
        }
        let message = auroc(&[0.5], &[]).unwrap_err().to_string();
        assert!(message.contains("probability holds 1 values and truth 0"));
    }
}
