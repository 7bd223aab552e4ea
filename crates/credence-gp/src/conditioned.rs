//! One class's process conditioned on its training points.

use faer::{Accum, MatMut, MatRef, Par, linalg::matmul::matmul};
use rayon::prelude::*;

use crate::{
    Points,
    factor::Factor,
    kernel::{Matern, dot},
};

/// Test points per task: enough columns to keep the triangular solve in matrix products, few
/// enough tasks' worth of memory (N x 64 numbers each).
const CHUNK: usize = 64;

/// A factorised training covariance and the residuals it explains.
///
/// It knows nothing of the prior mean: the caller takes it off the targets and adds it to the
/// correction, so it may be a constant or differ from point to point.
#[derive(Debug)]
pub(crate) struct Conditioned {
    factor: Factor,
    /// K^-1 (y - m).
    weights: Vec<f64>,
}

/// What the training points say of test points.
#[derive(Debug)]
pub(crate) struct Correction {
    /// K(X*,X) K^-1 (y - m) per test point, to be added to the prior mean.
    pub(crate) mean: Vec<f64>,
    /// k(x*,x*) - K(x*,X) K^-1 K(X,x*) per test point, as computed.
    pub(crate) variance: Vec<f64>,
}

impl Conditioned {
    pub(crate) fn new(factor: Factor, mut residuals: Vec<f64>) -> Self {
        let n = residuals.len();
        let mut column = MatMut::from_column_major_slice_mut(&mut residuals, n, 1);
        factor.solve_lower(column.as_mut());
        factor.solve_upper(column);
        Self {
            factor,
            weights: residuals,
        }
    }

    pub(crate) fn into_factor(self) -> Factor {
        self.factor
    }

    /// Mean correction and variance at `test`, with K(X,X*) and K(X*,X*) under `cross` between
    /// `training` and `test`. The variance is k(x*,x*) less the squared norm of L^-1 K(X,x*).
    pub(crate) fn predict(&self, cross: &Matern, training: &Points, test: &Points) -> Correction {
        let n = training.len();
        let parts: Vec<(f64, f64)> = (0..test.len().div_ceil(CHUNK))
            .into_par_iter()
            .with_max_len(1)
            .flat_map_iter(|chunk| {
                let range = chunk * CHUNK..((chunk + 1) * CHUNK).min(test.len());
                let mut columns = vec![0.0; n * range.len()];
                let means: Vec<f64> = range
                    .clone()
                    .zip(columns.chunks_exact_mut(n))
                    .map(|(index, column)| {
                        cross.column(training, 0..n, test, index, column);
                        dot(column, &self.weights)
                    })
                    .collect();
                self.factor.solve_lower(MatMut::from_column_major_slice_mut(
                    &mut columns,
                    n,
                    range.len(),
                ));
                let variances: Vec<f64> = columns
                    .chunks_exact(n)
                    .map(|column| cross.outputscale - dot(column, column))
                    .collect();
                means.into_iter().zip(variances)
            })
            .collect();
        let (mean, variance) = parts.into_iter().unzip();
        Correction { mean, variance }
    }

    /// K(X*,X*) - K(X*,X) K^-1 K(X,X*), M x M. Takes N x M and M x M numbers of memory.
    pub(crate) fn covariance(&self, cross: &Matern, training: &Points, test: &Points) -> Vec<f64> {
        let (n, m) = (training.len(), test.len());
        let mut whitened = vec![0.0; n * m];
        let mut covariance = vec![0.0; m * m];
        for (index, (to_training, to_test)) in whitened
            .chunks_exact_mut(n)
            .zip(covariance.chunks_exact_mut(m.max(1)))
            .enumerate()
        {
            cross.column(training, 0..n, test, index, to_training);
            cross.column(test, 0..m, test, index, to_test);
        }
        self.factor
            .solve_lower(MatMut::from_column_major_slice_mut(&mut whitened, n, m));
        let whitened = MatRef::from_column_major_slice(&whitened, n, m);
        matmul(
            MatMut::from_column_major_slice_mut(&mut covariance, m, m),
            Accum::Add,
            whitened.transpose(),
            whitened,
            -1.0,
            Par::Seq,
        );
        covariance
    }
}
