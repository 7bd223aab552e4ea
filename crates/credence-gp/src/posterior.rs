use rayon::prelude::*;

use crate::{GpError, confidence::confidence, softmax::expected_softmax};

/// What the classifier says of M test points, for C classes.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// Per class, per point.
    mean: Vec<Vec<f64>>,
    variance: Vec<Vec<f64>>,
    clamped: Vec<bool>,
    jitter: f64,
}

impl Posterior {
    /// Clamps negative variances to 0 and counts the points that have one.
    pub(crate) fn new(mean: Vec<Vec<f64>>, mut variance: Vec<Vec<f64>>, jitter: f64) -> Self {
        let points = mean.first().map_or(0, Vec::len);
        let clamped = (0..points)
            .map(|point| variance.iter().any(|class| class[point] < 0.0))
            .collect();
        for value in variance.iter_mut().flatten() {
            *value = value.max(0.0);
        }
        Self {
            mean,
            variance,
            clamped,
            jitter,
        }
    }

    /// Number of classes.
    pub fn classes(&self) -> usize {
        self.mean.len()
    }

    /// Number of test points.
    pub fn points(&self) -> usize {
        self.mean.first().map_or(0, Vec::len)
    }

    /// Latent mean per class (C) and point (M).
    pub fn mean(&self) -> &[Vec<f64>] {
        &self.mean
    }

    /// Latent variance per class (C) and point (M), without observation noise, at least 0.
    pub fn variance(&self) -> &[Vec<f64>] {
        &self.variance
    }

    /// Whether the variance of each point was below zero for some class and clamped: never with a
    /// sound covariance.
    pub fn clamped(&self) -> &[bool] {
        &self.clamped
    }

    /// Share of the points that are clamped; 0 if there are none.
    pub fn clamped_share(&self) -> f64 {
        let clamped = self.clamped.iter().filter(|clamped| **clamped).count();
        clamped as f64 / self.clamped.len().max(1) as f64
    }

    /// The most that was added to a class's covariance diagonal to factorise it; 0 as a rule.
    pub const fn jitter(&self) -> f64 {
        self.jitter
    }

    /// Predicted class per point: the one with the largest latent mean, the first of equals.
    pub fn class(&self) -> Vec<usize> {
        (0..self.points())
            .map(|point| {
                (1..self.classes()).fold(0, |best, class| {
                    if self.mean[class][point] > self.mean[best][point] {
                        class
                    } else {
                        best
                    }
                })
            })
            .collect()
    }

    /// Variance of the predicted class per point.
    pub fn predicted_variance(&self) -> Vec<f64> {
        self.class()
            .iter()
            .enumerate()
            .map(|(point, &class)| self.variance[class][point])
            .collect()
    }

    /// Confidence per point, 1 where the predicted class's variance is smallest: the seed paper's
    /// Eqs. 2 and 3, see [`confidence`]. Comparable within one posterior only.
    ///
    /// # Errors
    /// A variance that is not finite.
    pub fn confidence(&self) -> Result<Vec<f64>, GpError> {
        confidence(&self.predicted_variance())
    }

    /// E\[softmax(f)\] per point and class, row-major M x C; each row sums to 1.
    ///
    /// By deterministic sums, within 1e-9 as long as the latent standard deviations are at most 8,
    /// 1e-6 up to 30 and 1e-2 up to 200.
    pub fn probabilities(&self) -> Vec<f64> {
        (0..self.points())
            .into_par_iter()
            .flat_map_iter(|point| {
                let mean: Vec<f64> = self.mean.iter().map(|class| class[point]).collect();
                let variance: Vec<f64> = self.variance.iter().map(|class| class[point]).collect();
                expected_softmax(&mean, &variance)
            })
            .collect()
    }
}
