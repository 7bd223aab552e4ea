//! Class probabilities: the expectation of the softmax of independent Gaussians.
//!
//! Two classes: only the difference d of the latents counts, and E\[1 / (1 + exp(-d))\] under a
//! Gaussian is summed by the trapezoidal rule, which converges exponentially for it and whose step
//! can follow the variance (Crouch & Spiegelman 1990, "The evaluation of integrals of the form
//! int f(t) exp(-t^2) dt: application to logistic-normal models"). Gauss-Hermite nodes of a fixed
//! number cannot: 32 of them err by 2e-4 at a standard deviation of 4 and by 7e-3 at 8.
//!
//! More classes: with independent standard Gumbel variables g, `softmax_c(f)` is the probability
//! that `f_c + g_c` is the largest of the `f_j + g_j`. Those sums X are independent too, so
//!
//! ```text
//! E[softmax_c(f)] = P(X_c is the largest) = int p_c(x) prod_{j != c} F_j(x) dx
//! F_j(x) = P(X_j <= x) = E[exp(-exp(f_j - x))],   p_j = F_j'
//! ```
//!
//! is a single integral over functions that are themselves expectations over one Gaussian. Both are
//! summed by the trapezoidal rule: deterministic, and as exact as the number of nodes allows.
//!
//! Error of each probability, by the largest standard deviation of a latent: 1e-9 up to 8, 1e-6 up
//! to 30, 1e-2 up to 200; beyond, the sums lose their hold. Fits of this crate keep it below 100,
//! and as a rule below 4.

use crate::exp::exp_neg;

/// Gaussians and Gumbels are cut where their tails hold less than 1e-11 and 1e-10.
const GAUSSIAN_TAIL: f64 = 7.0;
const GUMBEL_LOWER_TAIL: f64 = 3.3;
const GUMBEL_UPPER_TAIL: f64 = 23.0;

/// Step of the outer sum: the integrand is analytic for |Im x| < pi/2, so the error is of the order
/// of exp(-2 pi (pi/2) / 0.4) = 2e-11. The same step, divided by the standard deviation, serves the
/// inner sums.
const STEP: f64 = 0.4;

/// Step at which a Gaussian alone is summed to 1e-11.
const GAUSSIAN_STEP: f64 = 0.6;

/// Intervals of each sum at most, so that a wild variance costs accuracy and not hours.
const MOST_LOGISTIC: usize = 4096;
const MOST_INNER: usize = 383;
const MOST_OUTER: usize = 8_192;

/// Standard deviation beyond which exponentials of latents leave the range of `f64`.
const WIDE: f64 = 90.0;

/// Standardised nodes and weights of the trapezoidal rule for a Gaussian; the weights sum to 1.
fn gaussian_nodes(step: f64, most: usize) -> (Vec<f64>, Vec<f64>) {
    let nodes = ((2.0 * GAUSSIAN_TAIL / step).ceil() as usize).clamp(2, most);
    let step = 2.0 * GAUSSIAN_TAIL / nodes as f64;
    let z: Vec<f64> = (0..=nodes)
        .map(|node| step * node as f64 - GAUSSIAN_TAIL)
        .collect();
    let weights: Vec<f64> = z.iter().map(|z| (-0.5 * z * z).exp()).collect();
    let total: f64 = weights.iter().sum();
    (z, weights.iter().map(|w| w / total).collect())
}

/// E\[softmax(f)\] for independent latents f with the given means and variances; sums to 1.
///
/// Where the latents are so far apart that the sums find nothing, the class with the largest mean
/// gets all.
pub(crate) fn expected_softmax(mean: &[f64], variance: &[f64]) -> Vec<f64> {
    let mut probabilities =
        if let ([first, second], [first_variance, second_variance]) = (mean, variance) {
            let deviation = (first_variance + second_variance).sqrt();
            [first - second, second - first]
                .map(|difference| expected_logistic(difference, deviation))
                .to_vec()
        } else {
            largest_of_gumbels(mean, variance)
        };
    let total: f64 = probabilities.iter().sum();
    if total > 0.0 && total.is_finite() {
        for probability in &mut probabilities {
            *probability /= total;
        }
    } else {
        let largest = (1..mean.len()).fold(0, |best, class| {
            if mean[class] > mean[best] {
                class
            } else {
                best
            }
        });
        probabilities.fill(0.0);
        probabilities[largest] = 1.0;
    }
    probabilities
}

/// E\[1 / (1 + exp(-d))\] for a Gaussian d. The logistic function's poles are pi from the real axis.
fn expected_logistic(mean: f64, deviation: f64) -> f64 {
    let (z, weights) = gaussian_nodes(GAUSSIAN_STEP.min(2.0 * STEP / deviation), MOST_LOGISTIC);
    z.iter()
        .zip(&weights)
        .map(|(z, weight)| weight / (1.0 + (-mean - deviation * z).exp()))
        .sum()
}

/// P(`f_c` plus a Gumbel variable is the largest), per class, up to a common factor close to 1.
fn largest_of_gumbels(mean: &[f64], variance: &[f64]) -> Vec<f64> {
    let deviation: Vec<f64> = variance.iter().map(|v| v.sqrt()).collect();
    let reach = |sign: f64| {
        mean.iter()
            .zip(&deviation)
            .map(|(m, s)| m + sign * GAUSSIAN_TAIL * s)
            .fold(f64::NEG_INFINITY, f64::max)
    };
    // Below the largest lower end the product of the distribution functions is 0.
    let low = reach(-1.0) - GUMBEL_LOWER_TAIL;
    let high = reach(1.0) + GUMBEL_UPPER_TAIL;
    let nodes = (((high - low) / STEP).ceil() as usize).clamp(2, MOST_OUTER);
    let step = (high - low) / nodes as f64;

    let gumbels: Vec<SmoothedGumbel> = mean
        .iter()
        .zip(&deviation)
        .map(|(&mean, &deviation)| SmoothedGumbel::new(mean, deviation, low, step, nodes))
        .collect();
    (0..mean.len())
        .map(|class| {
            let mut integrand = gumbels[class].density.clone();
            for (other, gumbel) in gumbels.iter().enumerate() {
                if other != class {
                    for (value, below) in integrand.iter_mut().zip(&gumbel.distribution) {
                        *value *= below;
                    }
                }
            }
            step * integrand.iter().sum::<f64>()
        })
        .collect()
}

/// Distribution function and density of a Gaussian plus a standard Gumbel variable on a grid.
struct SmoothedGumbel {
    distribution: Vec<f64>,
    density: Vec<f64>,
}

impl SmoothedGumbel {
    fn new(mean: f64, deviation: f64, low: f64, step: f64, nodes: usize) -> Self {
        let (z, weights) = gaussian_nodes(GAUSSIAN_STEP.min(STEP / deviation), MOST_INNER);
        let x: Vec<f64> = (0..=nodes).map(|node| low + step * node as f64).collect();
        let grid: Vec<f64> = x.iter().map(|x| bounded_exp(mean - x)).collect();
        let mut rates = vec![0.0; nodes + 1];
        let mut distribution = vec![0.0; nodes + 1];
        let mut density = vec![0.0; nodes + 1];
        for (z, weight) in z.iter().zip(&weights) {
            if deviation < WIDE {
                // exp(f - x) = exp(f - mean) exp(mean - x): small tables instead of one large.
                let factor = bounded_exp(deviation * z);
                for (rate, grid) in rates.iter_mut().zip(&grid) {
                    *rate = factor * grid;
                }
            } else {
                for (rate, x) in rates.iter_mut().zip(&x) {
                    *rate = bounded_exp(mean + deviation * z - x);
                }
            }
            pulp::Arch::new().dispatch(Accumulate {
                rates: &rates,
                weight: *weight,
                distribution: &mut distribution,
                density: &mut density,
            });
        }
        Self {
            distribution,
            density,
        }
    }
}

fn bounded_exp(x: f64) -> f64 {
    x.clamp(-700.0, 700.0).exp()
}

/// Adds weight exp(-rate) and its derivative by x, rate weight exp(-rate), for rate = exp(f - x).
struct Accumulate<'a> {
    rates: &'a [f64],
    weight: f64,
    distribution: &'a mut [f64],
    density: &'a mut [f64],
}

impl pulp::NullaryFnOnce for Accumulate<'_> {
    type Output = ();

    #[expect(
        clippy::inline_always,
        reason = "a helper that is not inlined keeps the baseline's narrow vectors"
    )]
    #[inline(always)]
    fn call(self) {
        for ((&rate, distribution), density) in
            self.rates.iter().zip(self.distribution).zip(self.density)
        {
            let rate = if rate < 700.0 { rate } else { 700.0 };
            let value = self.weight * exp_neg(rate);
            *distribution += value;
            *density += rate * value;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A fine trapezoidal rule, far beyond the steps of the code under test.
    fn logistic_brute_force(mean: f64, deviation: f64) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for node in -20_000..=20_000 {
            let z = f64::from(node) * 5e-4;
            let weight = (-0.5 * z * z).exp();
            sum += weight / (1.0 + (-mean - deviation * z).exp());
            total += weight;
        }
        sum / total
    }

    fn softmax(f: [f64; 3]) -> [f64; 3] {
        let e = f.map(f64::exp);
        e.map(|v| v / e.iter().sum::<f64>())
    }

    /// Trapezoidal rule over the three Gaussians at once.
    fn softmax_brute_force(mean: [f64; 3], variance: [f64; 3]) -> [f64; 3] {
        let (z, weights) = gaussian_nodes(0.15, MOST_INNER);
        let mut sums = [0.0; 3];
        let at = |class: usize, node: usize| mean[class] + variance[class].sqrt() * z[node];
        for i in 0..z.len() {
            for j in 0..z.len() {
                for k in 0..z.len() {
                    let weight = weights[i] * weights[j] * weights[k];
                    let values = softmax([at(0, i), at(1, j), at(2, k)]);
                    for (sum, value) in sums.iter_mut().zip(values) {
                        *sum += weight * value;
                    }
                }
            }
        }
        sums
    }

    fn worst(ours: &[f64], theirs: &[f64]) -> f64 {
        assert_eq!(ours.len(), theirs.len());
        ours.iter()
            .zip(theirs)
            .fold(0.0, |worst, (a, b)| worst.max((a - b).abs()))
    }

    #[test]
    fn two_classes_agree_with_brute_force() {
        for deviation in [0.0, 0.1, 1.0, 3.0, 8.0, 30.0] {
            for mean in [-20.0, -1.5, 0.0, 0.3, 6.0] {
                // Split unevenly: only the sum of the variances counts.
                let variance = [0.25 * deviation * deviation, 0.75 * deviation * deviation];
                let ours = expected_softmax(&[1.0, 1.0 + mean], &variance);
                let second = logistic_brute_force(mean, deviation);
                assert!(
                    worst(&ours, &[1.0 - second, second]) < 1e-9,
                    "{mean} {deviation} {ours:?} {second}"
                );
            }
        }
    }

    #[test]
    fn general_method_agrees_with_that_of_two_classes_to_the_stated_accuracy() {
        for (deviations, tolerance) in [
            ([0.0, 0.0], 1e-9),
            ([0.3, 2.0], 1e-9),
            ([8.0, 0.1], 1e-9),
            ([8.0, 8.0], 1e-9),
            ([30.0, 0.5], 1e-6),
            ([30.0, 30.0], 1e-6),
            ([100.0, 0.5], 1e-2),
            ([200.0, 200.0], 1e-2),
        ] {
            let variance = deviations.map(|d| d * d);
            for mean in [[0.0, 0.0], [-7.0, -0.3], [40.0, 45.0], [5.0, -900.0]] {
                let general = largest_of_gumbels(&mean, &variance);
                let two = expected_softmax(&mean, &variance);
                let worst = worst(&general, &two);
                assert!(worst < tolerance, "{deviations:?} {mean:?}: {worst:e}");
            }
        }
    }

    #[test]
    fn three_classes_agree_with_brute_force() {
        for (mean, variance) in [
            ([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
            ([-7.0, -0.5, -3.0], [0.2, 4.0, 1.5]),
            ([1.0, 0.5, -6.0], [0.01, 2.0, 6.0]),
        ] {
            let worst = worst(
                &expected_softmax(&mean, &variance),
                &softmax_brute_force(mean, variance),
            );
            assert!(worst < 1e-9, "{mean:?} {variance:?}: {worst:e}");
        }
    }

    #[test]
    fn without_variance_it_is_the_softmax() {
        let mean = [-0.3, -6.9, 0.4];
        assert!(worst(&expected_softmax(&mean, &[0.0; 3]), &softmax(mean)) < 1e-9);
    }

    #[test]
    fn equal_classes_are_equally_likely() {
        let ours = expected_softmax(&[-5.0; 7], &[3.0; 7]);
        assert!(worst(&ours, &[1.0 / 7.0; 7]) < 1e-14);
    }

    #[test]
    fn latents_beyond_every_sum_give_the_largest_mean_all() {
        let ours = expected_softmax(&[0.0, 1e300, -1e300], &[1e300, 1.0, 0.0]);
        assert_eq!(ours, [0.0, 1.0, 0.0]);
        let ours = expected_softmax(&[0.0, f64::MAX, -f64::MAX], &[0.0; 3]);
        assert_eq!(ours, [0.0, 1.0, 0.0]);
        let ours = expected_softmax(&[-f64::MAX, f64::MAX], &[f64::MAX; 2]);
        assert_eq!(ours, [0.0, 1.0]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn rows_are_distributions_and_only_differences_of_means_count(
            latents in prop::collection::vec((-9.0..9.0, 0.0..50.0), 2..8),
            shift in -100.0..100.0,
        ) {
            let (mean, variance): (Vec<f64>, Vec<f64>) = latents.into_iter().unzip();
            let ours = expected_softmax(&mean, &variance);
            prop_assert!(ours.iter().all(|p| (0.0..=1.0).contains(p)));
            prop_assert!((ours.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            let shifted: Vec<f64> = mean.iter().map(|m| m + shift).collect();
            prop_assert!(worst(&ours, &expected_softmax(&shifted, &variance)) < 1e-9);
        }
    }
}
