//! `RoIAlign` (He et al. 2017) over feature maps that are kept as rows, and its gradient.
//!
//! A region is cut into bins, and each bin is the mean of bilinear samples at regular places in
//! it, nothing rounded. The weights of a sample are a product of one factor down and one across,
//! so the cells and factors of each are found once per region.

#[cfg(test)]
mod tests;

use burn::{
    backend::{Backend, Dispatch, TensorMetadata as _, backend_extension, tensor::FloatTensor},
    tensor::{Shape, Tensor, TensorData},
};
use burn_autodiff::{
    Autodiff,
    checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    grads::Gradients,
    ops::{Backward, Ops, OpsKind},
};
use burn_flex::{Flex, FlexTensor};
use rayon::prelude::*;

use crate::conv::Grid;

/// A region of one of the feature maps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roi {
    /// The map.
    pub image: usize,
    /// Left, top, right and bottom in cells; the centre of the first cell is (0, 0).
    pub edges: [f32; 4],
}

/// The features of regions, `[rois * bins * bins, channels]`: region by region, `bins` x `bins`
/// bins row by row, each the mean of `samples` x `samples` bilinear samples.
///
/// A sample is 0 more than one cell before the centre of the first or behind that of the last,
/// and reads the outermost cells where it is less than that outside; a region that is not finite
/// has samples nowhere. This is torchvision's `roi_align` with `aligned=True`.
///
/// # Panics
/// When the grid has another number of rows than `x`, or a region is of an image that it has not.
pub fn roi_align(x: Tensor<2>, grid: Grid, rois: &[Roi], bins: usize, samples: usize) -> Tensor<2> {
    assert_eq!(x.dims()[0], grid.rows(), "a row of features per pixel");
    assert!(
        rois.iter().all(|roi| roi.image < grid.images),
        "regions are of the {} images of the grid",
        grid.images
    );
    let pooling = Pooling {
        grid,
        rois: rois.to_vec(),
        bins,
        samples,
    };
    Tensor::from_dispatch(Dispatch::pool_regions(x.into_dispatch(), pooling))
}

/// The operation, for burn's extension interface.
#[backend_extension(Flex, Autodiff)]
pub(crate) trait RegionPooling: Backend {
    /// See [`roi_align`].
    fn pool_regions(x: FloatTensor<Self>, pooling: Pooling) -> FloatTensor<Self>;
}

impl RegionPooling for Flex {
    fn pool_regions(x: FlexTensor, pooling: Pooling) -> FlexTensor {
        let [_, channels] = x.shape().dims();
        let x = x.to_contiguous();
        let out = pooling.forward(x.as_slice().unwrap_or_default(), channels);
        rows(out, [pooling.rows(), channels])
    }
}

impl<S: CheckpointStrategy> RegionPooling for Autodiff<Flex, S> {
    fn pool_regions(x: FloatTensor<Self>, pooling: Pooling) -> FloatTensor<Self> {
        let out = Flex::pool_regions(x.primitive().clone(), pooling.clone());
        let prepared = PoolBackward.prepare::<S>([x.node()]);
        match prepared.compute_bound().stateful() {
            OpsKind::Tracked(tracked) => tracked.finish(pooling, out),
            OpsKind::UnTracked(untracked) => untracked.finish(out),
        }
    }
}

#[derive(Debug)]
struct PoolBackward;

impl Backward<Flex, 1> for PoolBackward {
    type State = Pooling;

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let [parent] = ops.parents;
        let pooling = ops.state;
        let gradient = gradients.consume::<Flex>(&ops.node);
        let [_, channels] = gradient.shape().dims();
        if let Some(parent) = parent {
            let gradient = gradient.to_contiguous();
            let back = pooling.backward(gradient.as_slice().unwrap_or_default(), channels);
            gradients.register::<Flex>(parent.id, rows(back, [pooling.grid.rows(), channels]));
        }
    }
}

fn rows(values: Vec<f32>, shape: [usize; 2]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, Shape::from(shape)))
}

/// What is read where.
#[derive(Debug, Clone)]
pub(crate) struct Pooling {
    grid: Grid,
    rois: Vec<Roi>,
    bins: usize,
    samples: usize,
}

/// A cell of one axis, and how much of it a bin holds.
#[derive(Debug, Clone, Copy)]
struct Tap {
    cell: usize,
    weight: f32,
}

impl Pooling {
    const fn rows(&self) -> usize {
        self.rois.len() * self.bins * self.bins
    }

    fn forward(&self, x: &[f32], channels: usize) -> Vec<f32> {
        let mut out = vec![0.0; self.rows() * channels];
        out.par_chunks_mut((self.bins * self.bins * channels).max(1))
            .zip(&self.rois)
            .for_each(|(out, roi)| {
                self.for_each_tap(roi, |bin, cell, weight| {
                    let cell = roi.image * self.grid.height * self.grid.width + cell;
                    add(
                        &mut out[bin * channels..][..channels],
                        &x[cell * channels..][..channels],
                        weight,
                    );
                });
            });
        out
    }

    fn backward(&self, gradient: &[f32], channels: usize) -> Vec<f32> {
        let mut back = vec![0.0; self.grid.rows() * channels];
        let per_roi = self.bins * self.bins * channels;
        // An image is one task: its regions overlap, and are added in their order.
        back.par_chunks_mut((self.grid.height * self.grid.width * channels).max(1))
            .enumerate()
            .for_each(|(image, back)| {
                for (number, roi) in self.rois.iter().enumerate() {
                    if roi.image != image {
                        continue;
                    }
                    let gradient = &gradient[number * per_roi..][..per_roi];
                    self.for_each_tap(roi, |bin, cell, weight| {
                        add(
                            &mut back[cell * channels..][..channels],
                            &gradient[bin * channels..][..channels],
                            weight,
                        );
                    });
                }
            });
        back
    }

    /// Calls with each bin of a region, each cell of its image that the bin reads, and the weight
    /// of this cell in the bin.
    fn for_each_tap(&self, roi: &Roi, mut call: impl FnMut(usize, usize, f32)) {
        let [left, top, right, bottom] = roi.edges;
        let down = self.taps(top, bottom, self.grid.height);
        let across = self.taps(left, right, self.grid.width);
        for (y, down) in down.iter().enumerate() {
            for (x, across) in across.iter().enumerate() {
                for v in down {
                    for u in across {
                        let cell = v.cell * self.grid.width + u.cell;
                        call(y * self.bins + x, cell, v.weight * u.weight);
                    }
                }
            }
        }
    }

    /// What each bin reads along one axis of `size` cells. Neighbouring samples that read the same
    /// cell are put together: those of a small region nearly all do.
    fn taps(&self, from: f32, to: f32, size: usize) -> Vec<Vec<Tap>> {
        let step = (to - from) / (self.bins * self.samples) as f32;
        let share = 1.0 / self.samples as f32;
        let mut bins = Vec::with_capacity(self.bins);
        for bin in 0..self.bins {
            let mut taps: Vec<Tap> = Vec::with_capacity(2 * self.samples);
            let first = bin * self.samples;
            for sample in first..first + self.samples {
                let at = from + (sample as f32 + 0.5) * step;
                for (cell, weight) in around(at, size).into_iter().flatten() {
                    let weight = weight * share;
                    match taps.iter_mut().rev().find(|tap| tap.cell == cell) {
                        Some(tap) => tap.weight += weight,
                        None => taps.push(Tap { cell, weight }),
                    }
                }
            }
            bins.push(taps);
        }
        bins
    }
}

/// The cells about a place on an axis of `size` cells, each with its weight; none outside.
fn around(at: f32, size: usize) -> [Option<(usize, f32)>; 2] {
    // Not a number is in no range.
    if size == 0 || !(-1.0..=size as f32).contains(&at) {
        return [None, None];
    }
    let at = at.clamp(0.0, (size - 1) as f32);
    let low = at as usize;
    let part = at - low as f32;
    [
        Some((low, 1.0 - part)),
        (part > 0.0).then_some((low + 1, part)),
    ]
}

fn add(to: &mut [f32], from: &[f32], weight: f32) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += weight * from;
    }
}
