//! Matérn kernels, evaluated a column at a time by loops that the compiler vectorises.
//!
//! [`pulp`] picks the machine's widest vectors at run time. The loops use separate multiplications
//! and additions, never fused ones, so a column has the same bits on every instruction set.

#![expect(
    clippy::inline_always,
    reason = "a helper that is not inlined keeps the baseline's narrow vectors"
)]

use std::ops::Range;

use pulp::{Arch, NullaryFnOnce};

use crate::{Points, exp::exp_neg};

/// Partial sums per reduction: fixed, so that a sum does not depend on the vector width.
const LANES: usize = 8;

/// Smoothness nu of the Matérn kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Smoothness {
    /// nu = 1/2: continuous functions.
    Half,
    /// nu = 3/2: once differentiable functions.
    ThreeHalves,
    /// nu = 5/2: twice differentiable functions.
    #[default]
    FiveHalves,
}

/// A Matérn kernel with its hyperparameters:
/// k(r) = outputscale p(a) exp(-a), a = sqrt(2 nu) r / lengthscale, where p is 1, 1 + a or
/// 1 + a + a^2/3 (Rasmussen & Williams 2006, Eq. 4.17).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Matern {
    pub(crate) smoothness: Smoothness,
    pub(crate) lengthscale: f64,
    pub(crate) outputscale: f64,
}

/// Sums over the entries of a kernel column, see [`Matern::weighted_sums`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct WeightedSums {
    /// Sum of w k.
    pub(crate) value: f64,
    /// Sum of w dk/d(ln lengthscale).
    pub(crate) slope: f64,
}

impl Matern {
    /// Kernel values between point `index` of `of` and the points `to` of `points`, into `out`.
    pub(crate) fn column(
        &self,
        points: &Points,
        to: Range<usize>,
        of: &Points,
        index: usize,
        out: &mut [f64],
    ) {
        Arch::new().dispatch(Column {
            kernel: *self,
            points,
            to,
            of,
            index,
            out,
        });
    }

    /// Sums of w k and of w dk/d(ln lengthscale) over a column, with w in `weights`.
    ///
    /// `squares` is working memory as long as `weights`.
    pub(crate) fn weighted_sums(
        &self,
        points: &Points,
        to: Range<usize>,
        index: usize,
        weights: &[f64],
        squares: &mut [f64],
    ) -> WeightedSums {
        Arch::new().dispatch(Sums {
            kernel: *self,
            points,
            to,
            index,
            weights,
            squares,
        })
    }

    /// sqrt(2 nu) / lengthscale: what turns a distance into a.
    #[inline(always)]
    fn scale(&self) -> f64 {
        let two_nu: f64 = match self.smoothness {
            Smoothness::Half => 1.0,
            Smoothness::ThreeHalves => 3.0,
            Smoothness::FiveHalves => 5.0,
        };
        two_nu.sqrt() / self.lengthscale
    }
}

/// a from a squared distance, kept where exp(-a) is still a normal number: beyond, k is 0 for
/// every purpose, and p(a) exp(-a) would be infinity times zero.
#[inline(always)]
fn scaled_distance(square: f64, scale: f64) -> f64 {
    let a = square.sqrt() * scale;
    if a < 700.0 { a } else { 700.0 }
}

/// k / outputscale.
#[inline(always)]
fn half(a: f64) -> f64 {
    exp_neg(a)
}

#[inline(always)]
fn three_halves(a: f64) -> f64 {
    (1.0 + a) * exp_neg(a)
}

#[inline(always)]
fn five_halves(a: f64) -> f64 {
    (1.0 + a + a * a / 3.0) * exp_neg(a)
}

struct Column<'a> {
    kernel: Matern,
    points: &'a Points,
    to: Range<usize>,
    of: &'a Points,
    index: usize,
    out: &'a mut [f64],
}

impl NullaryFnOnce for Column<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.points
            .squared_distances(self.to, self.of, self.index, self.out);
        let (scale, outputscale) = (self.kernel.scale(), self.kernel.outputscale);
        match self.kernel.smoothness {
            Smoothness::Half => map(self.out, scale, outputscale, half),
            Smoothness::ThreeHalves => map(self.out, scale, outputscale, three_halves),
            Smoothness::FiveHalves => map(self.out, scale, outputscale, five_halves),
        }
    }
}

#[inline(always)]
fn map(out: &mut [f64], scale: f64, outputscale: f64, shape: impl Fn(f64) -> f64) {
    for entry in out {
        *entry = outputscale * shape(scaled_distance(*entry, scale));
    }
}

struct Sums<'a> {
    kernel: Matern,
    points: &'a Points,
    to: Range<usize>,
    index: usize,
    weights: &'a [f64],
    squares: &'a mut [f64],
}

impl NullaryFnOnce for Sums<'_> {
    type Output = WeightedSums;

    #[inline(always)]
    fn call(self) -> WeightedSums {
        self.points
            .squared_distances(self.to, self.points, self.index, self.squares);
        let scale = self.kernel.scale();
        // With k = s g(a) and da/d(ln l) = -a, the slope is -s a g'(a).
        let sums = match self.kernel.smoothness {
            Smoothness::Half => reduce(self.squares, self.weights, scale, |a| {
                let e = exp_neg(a);
                (e, a * e)
            }),
            Smoothness::ThreeHalves => reduce(self.squares, self.weights, scale, |a| {
                let e = exp_neg(a);
                ((1.0 + a) * e, a * a * e)
            }),
            Smoothness::FiveHalves => reduce(self.squares, self.weights, scale, |a| {
                let e = exp_neg(a);
                let third = a * a / 3.0;
                ((1.0 + a + third) * e, third * (1.0 + a) * e)
            }),
        };
        WeightedSums {
            value: self.kernel.outputscale * sums.value,
            slope: self.kernel.outputscale * sums.slope,
        }
    }
}

#[inline(always)]
fn reduce(
    squares: &[f64],
    weights: &[f64],
    scale: f64,
    shape: impl Fn(f64) -> (f64, f64),
) -> WeightedSums {
    let mut values = [0.0; LANES];
    let mut slopes = [0.0; LANES];
    let (square_lanes, square_rest) = squares.as_chunks::<LANES>();
    let (weight_lanes, weight_rest) = weights.as_chunks::<LANES>();
    for (squares, weights) in square_lanes.iter().zip(weight_lanes) {
        for lane in 0..LANES {
            let (value, slope) = shape(scaled_distance(squares[lane], scale));
            values[lane] += weights[lane] * value;
            slopes[lane] += weights[lane] * slope;
        }
    }
    for (lane, (&square, &weight)) in square_rest.iter().zip(weight_rest).enumerate() {
        let (value, slope) = shape(scaled_distance(square, scale));
        values[lane] += weight * value;
        slopes[lane] += weight * slope;
    }
    WeightedSums {
        value: values.iter().sum(),
        slope: slopes.iter().sum(),
    }
}

/// Sum of the products, in [`LANES`] partial sums.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (a_lanes, a_rest) = a.as_chunks::<LANES>();
    let (b_lanes, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    for (lane, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        sums[lane] += a * b;
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Smoothness; 3] = [
        Smoothness::Half,
        Smoothness::ThreeHalves,
        Smoothness::FiveHalves,
    ];

    fn kernel(smoothness: Smoothness, lengthscale: f64) -> Matern {
        Matern {
            smoothness,
            lengthscale,
            outputscale: 2.0,
        }
    }

    fn points(rows: &[f64], dim: usize) -> Points {
        Points::from_rows("points", rows, dim).unwrap()
    }

    #[test]
    fn values_at_distance_5_are_those_of_the_formula() {
        // (3, 4) is 5 from the origin.
        let points = points(&[0.0, 0.0, 3.0, 4.0], 2);
        for (smoothness, expected) in [
            (Smoothness::Half, 2.0 * (-0.5_f64).exp()),
            (
                Smoothness::ThreeHalves,
                2.0 * (1.0 + 0.75_f64.sqrt()) * (-(0.75_f64.sqrt())).exp(),
            ),
            (
                Smoothness::FiveHalves,
                2.0 * (1.0 + 1.25_f64.sqrt() + 1.25 / 3.0) * (-(1.25_f64.sqrt())).exp(),
            ),
        ] {
            let mut out = [0.0; 2];
            kernel(smoothness, 10.0).column(&points, 0..2, &points, 0, &mut out);
            assert_eq!(out[0], 2.0);
            assert!((out[1] - expected).abs() < 1e-15, "{smoothness:?}");
        }
    }

    #[test]
    fn extreme_distances_stay_finite() {
        let points = points(&[0.0, 1e-150, 1e150], 1);
        for smoothness in ALL {
            for lengthscale in [1e-12, 1.0, 1e12] {
                let mut out = [0.0; 3];
                kernel(smoothness, lengthscale).column(&points, 0..3, &points, 0, &mut out);
                assert_eq!(out[..2], [2.0, 2.0]);
                assert!((0.0..1e-290).contains(&out[2]));
            }
        }
    }

    #[test]
    fn slope_is_the_derivative_by_log_lengthscale() {
        // 19 points: two full lanes and a rest.
        let rows: Vec<f64> = (0..19).map(|i| f64::from(i) * 0.1).collect();
        let weights: Vec<f64> = (0..19).map(|i| 1.0 - f64::from(i) * 0.07).collect();
        let points = points(&rows, 1);
        let mut squares = [0.0; 19];
        for smoothness in ALL {
            let mut at = |log_lengthscale: f64| {
                kernel(smoothness, log_lengthscale.exp()).weighted_sums(
                    &points,
                    0..19,
                    0,
                    &weights,
                    &mut squares,
                )
            };
            let step = 1e-5;
            let difference = (at(-0.5 + step).value - at(-0.5 - step).value) / (2.0 * step);
            assert!((at(-0.5).slope - difference).abs() < 1e-8, "{smoothness:?}");
        }
    }
}
