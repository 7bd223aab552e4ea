#![expect(
    clippy::inline_always,
    reason = "a helper that is not inlined keeps the baseline's narrow vectors"
)]

use std::ops::Range;

use crate::{GpError, covariance::check_length, hyperparameters::check_scale};

/// Coordinates beyond this have squares near the end of the range of `f64`.
const LARGEST_COORDINATE: f64 = 1e150;

/// Points of one space, checked finite.
///
/// Stored one axis after the other, so that distances from one point to a run of others are
/// straight vector loops.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    axes: Vec<f64>,
    len: usize,
    dim: usize,
}

impl Points {
    /// Reads points from row-major coordinates.
    ///
    /// # Arguments
    ///
    /// * `name`: what the array is called in error messages.
    /// * `rows`: `len x dim` coordinates, row-major. No rows is allowed.
    /// * `dim`: coordinates per point.
    ///
    /// # Errors
    /// No dimension, values that are no whole number of rows, a coordinate that is not finite or
    /// beyond 1e150.
    pub fn from_rows(name: &'static str, rows: &[f64], dim: usize) -> Result<Self, GpError> {
        if dim == 0 {
            return Err(GpError::NoDimension { name });
        }
        if !rows.len().is_multiple_of(dim) {
            return Err(GpError::RaggedPoints {
                name,
                values: rows.len(),
                dim,
            });
        }
        let len = rows.len() / dim;
        let mut axes = vec![0.0; rows.len()];
        for (index, row) in rows.chunks_exact(dim).enumerate() {
            for (axis, &value) in row.iter().enumerate() {
                if !value.is_finite() || value.abs() > LARGEST_COORDINATE {
                    return Err(GpError::Coordinate { name, index, value });
                }
                axes[axis * len + index] = value;
            }
        }
        Ok(Self { axes, len, dim })
    }

    /// Number of points.
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no points.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Coordinates per point.
    pub const fn dim(&self) -> usize {
        self.dim
    }

    /// These points with further coordinates, `scale` times those of `features`, so that squared
    /// distances are |dx|^2 + `scale`^2 |de|^2: an isotropic kernel of lengthscale l on them has
    /// the lengthscale l / `scale` in the features.
    ///
    /// # Errors
    /// Features of another number of points, a scale that is not positive and finite, a scaled
    /// feature beyond 1e150.
    pub fn joined(&self, features: &Self, scale: f64) -> Result<Self, GpError> {
        check_length("features", features.len, self.len, "point")?;
        check_scale("the features' scale", scale)?;
        let scaled: Vec<f64> = features.axes.iter().map(|value| scale * value).collect();
        if let Some(place) = scaled.iter().position(|v| v.abs() > LARGEST_COORDINATE) {
            return Err(GpError::Coordinate {
                name: "features",
                index: place % self.len,
                value: scaled[place],
            });
        }
        Ok(Self {
            axes: [self.axes.as_slice(), &scaled].concat(),
            len: self.len,
            dim: self.dim + features.dim,
        })
    }

    /// The points at `indices`, which must exist, in that order.
    pub(crate) fn select(&self, indices: &[usize]) -> Self {
        let axes = (0..self.dim)
            .flat_map(|axis| indices.iter().map(move |&index| self.at(axis, index)))
            .collect();
        Self {
            axes,
            len: indices.len(),
            dim: self.dim,
        }
    }

    /// Length of the diagonal of the points' bounding box.
    pub(crate) fn extent(&self) -> f64 {
        (0..self.dim)
            .map(|axis| {
                let run = self.run(axis, 0..self.len);
                let (low, high) = run
                    .iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| {
                        (low.min(x), high.max(x))
                    });
                if high > low {
                    (high - low).powi(2)
                } else {
                    0.0
                }
            })
            .sum::<f64>()
            .sqrt()
    }

    /// Squared distances from point `index` of `of` to the points `to` of `self`, into `out`.
    ///
    /// Inlined into callers that run it with the machine's widest vectors.
    #[inline(always)]
    pub(crate) fn squared_distances(
        &self,
        to: Range<usize>,
        of: &Self,
        index: usize,
        out: &mut [f64],
    ) {
        out.fill(0.0);
        for axis in 0..self.dim {
            let origin = of.at(axis, index);
            for (square, &x) in out.iter_mut().zip(self.run(axis, to.clone())) {
                let difference = x - origin;
                *square += difference * difference;
            }
        }
    }

    #[inline(always)]
    fn at(&self, axis: usize, index: usize) -> f64 {
        self.axes[axis * self.len + index]
    }

    #[inline(always)]
    fn run(&self, axis: usize, range: Range<usize>) -> &[f64] {
        &self.axes[axis * self.len + range.start..axis * self.len + range.end]
    }
}
