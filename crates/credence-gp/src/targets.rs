//! Classification as regression: the Dirichlet likelihood's targets and noise.

use crate::GpError;

/// Regression targets of one class and the variance of each.
#[derive(Debug, Clone, PartialEq)]
pub struct Targets {
    /// Target per training point.
    pub target: Vec<f64>,
    /// Noise variance per training point.
    pub noise: Vec<f64>,
}

impl Targets {
    /// Log-normal approximation of the Gamma variables that a Dirichlet is made of.
    ///
    /// With a = `alpha_epsilon`, plus 1 where the point's label is `class`: noise variance
    /// s2 = ln(1/a + 1), target y = ln a - s2/2 (Milios et al. 2018, "Dirichlet-based Gaussian
    /// Processes for Large-scale Calibrated Classification", Eqs. 6 and 7).
    pub(crate) fn of_class(labels: &[usize], class: usize, alpha_epsilon: f64) -> Self {
        let [other, own] = [alpha_epsilon, 1.0 + alpha_epsilon].map(|a| (target(a), noise(a)));
        let (target, noise) = labels
            .iter()
            .map(|&label| if label == class { own } else { other })
            .unzip();
        Self { target, noise }
    }
}

/// s2 = ln(1/a + 1).
fn noise(alpha: f64) -> f64 {
    alpha.recip().ln_1p()
}

/// y = ln a - s2/2: mean of the logarithm of a Gamma variable of concentration a, approximated as
/// normal.
pub(crate) fn target(alpha: f64) -> f64 {
    alpha.ln() - noise(alpha) / 2.0
}

/// Range of `alpha_epsilon` in which targets and noise keep their precision.
pub(crate) fn check_alpha_epsilon(value: f64) -> Result<(), GpError> {
    if (1e-12..=1.0).contains(&value) {
        Ok(())
    } else {
        Err(GpError::Setting {
            name: "alpha_epsilon",
            value,
            range: "between 1e-12 and 1",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_and_noise_are_the_published_constants() {
        let targets = Targets::of_class(&[0, 1], 0, 0.01);
        let rounded = |v: f64| (v * 1e4).round() / 1e4;
        assert_eq!(
            targets
                .target
                .iter()
                .copied()
                .map(rounded)
                .collect::<Vec<_>>(),
            [-0.3341, -6.9127]
        );
        assert_eq!(
            targets
                .noise
                .iter()
                .copied()
                .map(rounded)
                .collect::<Vec<_>>(),
            [0.6882, 4.6151]
        );
    }

    #[test]
    fn alpha_epsilon_outside_its_range_is_named() {
        for value in [0.0, -1.0, f64::NAN, 2.0] {
            let message = check_alpha_epsilon(value).unwrap_err().to_string();
            assert_eq!(
                message,
                format!("alpha_epsilon is {value}; it must be between 1e-12 and 1")
            );
        }
    }
}
