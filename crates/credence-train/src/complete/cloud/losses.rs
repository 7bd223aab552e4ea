use burn::tensor::{Device, Tensor, TensorData};
use credence_complete::cloud::Decoded;

use super::example::Example;

/// Errors are weighed by 1 / (this + distance from the surface), in the frame's units: a
/// millimetre matters near the surface, where points come to rest.
const SOFTENING: f32 = 0.1;

/// The spread is learned from queries nearer than this, 2 cm: points are asked for theirs last.
const SPREAD_REACH: f32 = 0.2;

/// Distances below which an offset has no direction to speak of, 0.5 mm.
const NO_DIRECTION: f32 = 0.005;

/// Weight of the spread's loss.
const SPREAD: f64 = 0.05;

/// Norms are kept above this, so that a zero vector has a gradient.
const SMALL: f64 = 1e-6;

/// Truth of a batch: offsets, their directions, and the weights of both losses (queries).
pub(super) struct Truth {
    offsets: Tensor<2>,
    directions: Tensor<2>,
    /// 1 where the offset has no direction.
    pointless: Tensor<1>,
    offset_weights: Tensor<1>,
    spread_weights: Tensor<1>,
}

impl Truth {
    pub(super) fn new(examples: &[Example], device: &Device) -> Self {
        let offsets: Vec<[f32; 3]> = examples.iter().flat_map(|e| &e.offsets).copied().collect();
        let norms: Vec<f32> = offsets.iter().map(norm).collect();
        let total = offsets.len();
        let column = |value: &dyn Fn(f32) -> f32| {
            let values: Vec<f32> = norms.iter().map(|n| value(*n)).collect();
            Tensor::<1>::from_data(TensorData::new(values, [total]), device)
        };
        let directions = offsets.iter().zip(&norms).map(|(offset, norm)| {
            if *norm < NO_DIRECTION {
                [0.0; 3]
            } else {
                offset.map(|c| c / norm)
            }
        });
        let rows = |rows: Vec<[f32; 3]>| {
            let values: Vec<f32> = rows.into_iter().flatten().collect();
            Tensor::<2>::from_data(TensorData::new(values, [total, 3]), device)
        };
        Self {
            directions: rows(directions.collect()),
            pointless: column(&|n| f32::from(n < NO_DIRECTION)),
            offset_weights: column(&|n| 1.0 / (SOFTENING + n)),
            spread_weights: column(&|n| f32::from(n < SPREAD_REACH)),
            offsets: rows(offsets),
        }
    }
}

/// The loss and its parts: the offset's, the spread's.
///
/// The offset's is the error's norm, so that where the surface may be here or there the answer is
/// a median place. The spread's is the negative log-likelihood of the error along the true offset,
/// which is what remains between a point that has followed its offset and the surface, under
/// Laplace's distribution of scale b: e / b + ln b. No gradient of it reaches the offsets.
pub(super) fn losses(decoded: Decoded, truth: Truth) -> [Tensor<1>; 3] {
    let total = truth.offsets.dims()[0];
    let error = decoded.offsets - truth.offsets;
    let squares = (error.clone() * error.clone()).sum_dim(1).reshape([total]);
    let norms = (squares + SMALL * SMALL).sqrt();
    let offset = (norms.clone() * truth.offset_weights).mean();
    let along = (error * truth.directions).sum_dim(1).reshape([total]).abs();
    let missed = (along + norms * truth.pointless).detach();
    let spread = missed * (-decoded.log_spreads.clone()).exp() + decoded.log_spreads;
    let count = truth.spread_weights.clone().sum().clamp_min(1.0);
    let spread = (spread * truth.spread_weights).sum() / count;
    [offset.clone() + spread.clone() * SPREAD, offset, spread]
}

fn norm(offset: &[f32; 3]) -> f32 {
    offset.iter().map(|c| c * c).sum::<f32>().sqrt()
}
