/// A completed point is right this near to the true surface, metres: the tolerance of the
/// benchmark's truth.
const TOLERANCE_M: f64 = 0.005;

/// Probability that a point lies within 5 mm of the true surface, from its expected distance,
/// metres: 1 - exp(-0.005 / spread), for errors of Laplace's distribution.
pub fn within_tolerance(spread_m: f64) -> f64 {
    1.0 - (-TOLERANCE_M / spread_m).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        assert_eq!(within_tolerance(0.0), 1.0);
        assert_eq!(within_tolerance(f64::INFINITY), 0.0);
        let median_m = TOLERANCE_M / 2_f64.ln();
        assert!((within_tolerance(median_m) - 0.5).abs() < 1e-15);
    }
}
