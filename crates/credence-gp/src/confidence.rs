//! From variances to scores between 0 and 1.

use crate::GpError;

/// Confidence of each test point among its peers, from the variance of its predicted class.
///
/// The seed paper scales its variance sigma to s by Eq. 2, and then takes s from its minimum to its
/// maximum by Eq. 3. While `sigma_min` < 1 the two steps are one, which is what this computes:
///
/// ```text
/// s = (1 - sigma) / (1 - sigma_min)                                 (Eq. 2)
/// (s - s_min) / (s_max - s_min)                                     (Eq. 3)
///     = (sigma_max - sigma) / (sigma_max - sigma_min)
/// ```
///
/// Once `sigma_min` > 1 the two steps flip the order of the points, and at `sigma_min` = 1 they
/// divide by zero; the last line does neither.
///
/// Points that all have the same variance are each as certain as the most certain one: 1. No
/// points give no scores.
///
/// # Arguments
///
/// * `variance`: variance per test point, finite.
///
/// # Errors
/// A variance that is not finite.
pub fn confidence(variance: &[f64]) -> Result<Vec<f64>, GpError> {
    if let Some(index) = variance.iter().position(|v| !v.is_finite()) {
        return Err(GpError::Variance {
            index,
            value: variance[index],
        });
    }
    let (low, high) = variance
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
            (low.min(v), high.max(v))
        });
    Ok(variance
        .iter()
        // Halved, as the range of two finite numbers may not be finite.
        .map(|&v| {
            let range = high / 2.0 - low / 2.0;
            if range > 0.0 {
                (high / 2.0 - v / 2.0) / range
            } else {
                1.0
            }
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eqs. 2 and 3 of the seed paper, step by step.
    fn two_steps(variance: &[f64]) -> Vec<f64> {
        let lowest = variance.iter().copied().fold(f64::INFINITY, f64::min);
        let s: Vec<f64> = variance
            .iter()
            .map(|v| (1.0 - v) / (1.0 - lowest))
            .collect();
        let low = s.iter().copied().fold(f64::INFINITY, f64::min);
        let high = s.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        s.iter().map(|s| (s - low) / (high - low)).collect()
    }

    #[test]
    fn smallest_variance_scores_1_and_largest_0() {
        assert_eq!(
            confidence(&[0.5, 0.25, 0.75, 0.375]).unwrap(),
            [0.5, 1.0, 0.0, 0.75]
        );
    }

    #[test]
    fn equals_the_two_steps_while_all_variances_are_below_1() {
        let variance = [0.1, 0.9, 0.4, 0.7];
        for (ours, theirs) in confidence(&variance)
            .unwrap()
            .iter()
            .zip(two_steps(&variance))
        {
            assert!((ours - theirs).abs() < 1e-15);
        }
    }

    #[test]
    fn two_steps_flip_once_the_smallest_variance_exceeds_1_and_this_does_not() {
        let variance = [1.5, 2.0, 3.5];
        assert_eq!(confidence(&variance).unwrap(), [1.0, 0.75, 0.0]);
        assert_eq!(two_steps(&variance), [0.0, 0.25, 1.0]);
    }

    #[test]
    fn smallest_variance_of_1_is_defined() {
        assert_eq!(confidence(&[1.0, 2.0]).unwrap(), [1.0, 0.0]);
        assert!(two_steps(&[1.0, 2.0]).iter().any(|s| s.is_nan()));
    }

    #[test]
    fn equal_variances_and_a_single_point_score_1_and_none_score_nothing() {
        assert_eq!(confidence(&[2.0, 2.0]).unwrap(), [1.0, 1.0]);
        assert_eq!(confidence(&[7.0]).unwrap(), [1.0]);
        assert_eq!(confidence(&[]).unwrap(), [0.0; 0]);
    }

    #[test]
    fn extreme_variances_stay_in_range() {
        assert_eq!(
            confidence(&[f64::MAX, -f64::MAX, 0.0]).unwrap(),
            [0.0, 1.0, 0.5]
        );
    }

    #[test]
    fn a_variance_that_is_not_finite_is_named() {
        assert_eq!(
            confidence(&[1.0, f64::NAN]).unwrap_err().to_string(),
            "variance 1 is NaN; variances must be finite"
        );
    }
}
