//! Log marginal likelihood of one class and its gradient.

use faer::MatMut;
use rayon::prelude::*;

use crate::{
    GpError, Points,
    factor::{Factor, Storage, TILE},
    kernel::{Matern, WeightedSums, dot},
    targets::Targets,
};

/// Log marginal likelihood of one class, per training point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likelihood {
    /// ln p(y | X) / N.
    pub per_datum: f64,
    /// Its derivatives.
    pub gradient: Gradient,
}

/// Derivatives by the hyperparameters as they are, not by their logarithms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gradient {
    /// By the lengthscale.
    pub lengthscale: f64,
    /// By the outputscale.
    pub outputscale: f64,
    /// By the constant mean.
    pub mean: f64,
}

/// The constant mean at which a likelihood is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Mean {
    /// This one.
    Given(f64),
    /// The one that maximises the likelihood: m = 1' K^-1 y / 1' K^-1 1. The likelihood's
    /// derivatives by the other hyperparameters are the same with m held fixed, as its derivative
    /// by m is zero there.
    BestFit,
}

/// A likelihood, the mean and jitter it was computed with, and the memory it took.
#[derive(Debug)]
pub(crate) struct Evaluation {
    pub(crate) likelihood: Likelihood,
    pub(crate) mean: f64,
    pub(crate) jitter: f64,
    pub(crate) storage: Storage,
}

/// Evaluates ln p(y) = -1/2 (y-m)' K^-1 (y-m) - 1/2 ln det K - N/2 ln(2 pi), and with
/// a = K^-1 (y-m) the derivatives d/dt = 1/2 tr((a a' - K^-1) dK/dt) and d/dm = 1' a
/// (Rasmussen & Williams 2006, Eqs. 2.30 and 5.9).
///
/// The trace runs over the lower triangle in tile columns: each task computes its part of K^-1 and
/// reduces it at once against kernel values computed afresh, so neither K^-1 nor dK/dt is stored.
pub(crate) fn evaluate(
    storage: Storage,
    kernel: &Matern,
    points: &Points,
    targets: &Targets,
    mean: Mean,
    class: usize,
) -> Result<Evaluation, GpError> {
    let n = points.len();
    let Whitened {
        factor,
        mean,
        residuals: mut weights,
    } = Whitened::new(storage, kernel, points, targets, mean, class)?;
    let mahalanobis = dot(&weights, &weights);
    factor.solve_upper(MatMut::from_column_major_slice_mut(&mut weights, n, 1));

    let parts: Vec<WeightedSums> = (0..n.div_ceil(TILE))
        .into_par_iter()
        .with_max_len(1)
        .map(|tile| trace_part(&factor, kernel, points, &weights, tile * TILE))
        .collect();
    let trace = parts
        .iter()
        .fold(WeightedSums::default(), |sum, part| WeightedSums {
            value: sum.value + part.value,
            slope: sum.slope + part.slope,
        });

    let per = 1.0 / n as f64;
    Ok(Evaluation {
        likelihood: Likelihood {
            per_datum: per_datum(&factor, mahalanobis, n),
            gradient: Gradient {
                lengthscale: 0.5 * per * trace.slope / kernel.lengthscale,
                outputscale: 0.5 * per * trace.value / kernel.outputscale,
                mean: per * weights.iter().sum::<f64>(),
            },
        },
        mean,
        jitter: factor.jitter(),
        storage: factor.into_storage(),
    })
}

/// A factorised covariance L L' and the residuals L^-1 (y - m).
#[derive(Debug)]
pub(crate) struct Whitened {
    pub(crate) factor: Factor,
    pub(crate) mean: f64,
    pub(crate) residuals: Vec<f64>,
}

impl Whitened {
    pub(crate) fn new(
        storage: Storage,
        kernel: &Matern,
        points: &Points,
        targets: &Targets,
        mean: Mean,
        class: usize,
    ) -> Result<Self, GpError> {
        let n = points.len();
        let factor = Factor::new(storage, kernel, points, &targets.noise, class)?;
        let mut whitened = targets.target.clone();
        whitened.resize(2 * n, 1.0);
        factor.solve_lower(MatMut::from_column_major_slice_mut(&mut whitened, n, 2));
        let (target, one) = whitened.split_at(n);
        let mean = match mean {
            Mean::Given(mean) => mean,
            Mean::BestFit => dot(one, target) / dot(one, one),
        };
        let residuals = target
            .iter()
            .zip(one)
            .map(|(y, one)| y - mean * one)
            .collect();
        Ok(Self {
            factor,
            mean,
            residuals,
        })
    }

    /// ln p(y).
    pub(crate) fn log_density(&self) -> f64 {
        let n = self.residuals.len();
        let mahalanobis = dot(&self.residuals, &self.residuals);
        n as f64 * per_datum(&self.factor, mahalanobis, n)
    }
}

/// ln p(y) / n.
fn per_datum(factor: &Factor, mahalanobis: f64, n: usize) -> f64 {
    let log_two_pi = std::f64::consts::TAU.ln();
    let per = 1.0 / n as f64;
    -0.5 * (per * (mahalanobis + factor.log_determinant()) + log_two_pi)
}

/// The share of one tile of columns in tr((a a' - K^-1) K) and tr((a a' - K^-1) dK/d(ln l)).
fn trace_part(
    factor: &Factor,
    kernel: &Matern,
    points: &Points,
    weights: &[f64],
    start: usize,
) -> WeightedSums {
    let n = points.len();
    let width = TILE.min(n - start);
    let rows = n - start;
    let mut inverse = vec![0.0; rows * width];
    factor.inverse_columns(
        start,
        MatMut::from_column_major_slice_mut(&mut inverse, rows, width),
    );

    let mut squares = vec![0.0; rows];
    let mut sum = WeightedSums::default();
    for (offset, column) in inverse.chunks_exact_mut(rows).enumerate() {
        let j = start + offset;
        let coefficients = &mut column[offset..];
        for (entry, weight) in coefficients.iter_mut().zip(&weights[j..]) {
            *entry = 2.0 * (weight * weights[j] - *entry);
        }
        // An entry below the diagonal stands for two.
        coefficients[0] *= 0.5;
        let part = kernel.weighted_sums(points, j..n, j, coefficients, &mut squares[offset..]);
        sum.value += part.value;
        sum.slope += part.slope;
    }
    sum
}
