//! Gathering of 3x3 neighbourhoods, and its gradient.

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

use super::{Grid, NEIGHBOURHOOD};

/// The 3x3 neighbourhood of every `stride`-th pixel, `[rows, 9 * channels]`: pixel by pixel from
/// the upper left, zeros outside the image.
///
/// # Panics
/// When the grid has another number of rows than `x`.
pub fn patches(x: Tensor<2>, grid: Grid, stride: usize) -> Tensor<2> {
    assert_eq!(x.dims()[0], grid.rows(), "a row of features per pixel");
    Tensor::from_dispatch(Dispatch::gather_patches(x.into_dispatch(), grid, stride))
}

/// The operation, for burn's extension interface.
#[backend_extension(Flex, Autodiff)]
pub(super) trait Patches: Backend {
    /// See [`patches`].
    fn gather_patches(x: FloatTensor<Self>, grid: Grid, stride: usize) -> FloatTensor<Self>;
}

impl Patches for Flex {
    fn gather_patches(x: FlexTensor, grid: Grid, stride: usize) -> FlexTensor {
        let [_, channels] = x.shape().dims();
        let x = x.to_contiguous();
        let out = gather(x.as_slice().unwrap_or_default(), channels, grid, stride);
        rows(out, NEIGHBOURHOOD * channels)
    }
}

impl<S: CheckpointStrategy> Patches for Autodiff<Flex, S> {
    fn gather_patches(x: FloatTensor<Self>, grid: Grid, stride: usize) -> FloatTensor<Self> {
        let out = Flex::gather_patches(x.primitive().clone(), grid, stride);
        let prepared = GatherBackward.prepare::<S>([x.node()]);
        match prepared.compute_bound().stateful() {
            OpsKind::Tracked(tracked) => tracked.finish((grid, stride), out),
            OpsKind::UnTracked(untracked) => untracked.finish(out),
        }
    }
}

#[derive(Debug)]
struct GatherBackward;

impl Backward<Flex, 1> for GatherBackward {
    type State = (Grid, usize);

    fn backward(
        self,
        ops: Ops<Self::State, 1>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let [parent] = ops.parents;
        let (grid, stride) = ops.state;
        let gradient = gradients.consume::<Flex>(&ops.node);
        let [_, columns] = gradient.shape().dims();
        let channels = columns / NEIGHBOURHOOD;
        if let Some(parent) = parent {
            let gradient = gradient.to_contiguous();
            let back = scatter(
                gradient.as_slice().unwrap_or_default(),
                channels,
                grid,
                stride,
            );
            gradients.register::<Flex>(parent.id, rows(back, channels));
        }
    }
}

fn rows(values: Vec<f32>, columns: usize) -> FlexTensor {
    let shape = Shape::from([values.len() / columns, columns]);
    FlexTensor::from_data(TensorData::new(values, shape))
}

/// Where one line of a neighbourhood lies: three neighbouring pixels of a row of the image, cut at
/// its sides.
struct Line {
    /// First of them that is in the image, as a row of the features.
    from: usize,
    /// Its place in the neighbourhood, 0 to 8.
    place: usize,
    count: usize,
}

/// The lines of the neighbourhood of pixel (`y`, `x`) of an image.
fn lines(grid: Grid, image: usize, [y, x]: [usize; 2]) -> impl Iterator<Item = Line> {
    let left = x.saturating_sub(1);
    let right = (x + 2).min(grid.width);
    (0..3).filter_map(move |line| {
        let row = (y + line).checked_sub(1).filter(|row| *row < grid.height)?;
        Some(Line {
            from: (image * grid.height + row) * grid.width + left,
            place: 3 * line + (left + 1 - x),
            count: right - left,
        })
    })
}

fn gather(x: &[f32], channels: usize, grid: Grid, stride: usize) -> Vec<f32> {
    let coarse = grid.every(stride);
    let columns = NEIGHBOURHOOD * channels;
    let mut out = vec![0.0; coarse.rows() * columns];
    out.par_chunks_mut(coarse.width * columns)
        .enumerate()
        .for_each(|(line, out)| {
            let (image, y) = (line / coarse.height, line % coarse.height);
            for (x_out, out) in out.chunks_exact_mut(columns).enumerate() {
                for line in lines(grid, image, [y * stride, x_out * stride]) {
                    let length = line.count * channels;
                    out[line.place * channels..][..length]
                        .copy_from_slice(&x[line.from * channels..][..length]);
                }
            }
        });
    out
}

fn scatter(gradient: &[f32], channels: usize, grid: Grid, stride: usize) -> Vec<f32> {
    let coarse = grid.every(stride);
    let columns = NEIGHBOURHOOD * channels;
    let mut back = vec![0.0; grid.rows() * channels];
    let per_image = grid.height * grid.width * channels;
    // An image is one task: its neighbourhoods overlap.
    back.par_chunks_mut(per_image.max(1))
        .zip(gradient.par_chunks((coarse.height * coarse.width * columns).max(1)))
        .for_each(|(back, gradient)| {
            for (pixel, gradient) in gradient.chunks_exact(columns).enumerate() {
                let at = [pixel / coarse.width * stride, pixel % coarse.width * stride];
                for line in lines(grid, 0, at) {
                    let length = line.count * channels;
                    let from = &gradient[line.place * channels..][..length];
                    let to = &mut back[line.from * channels..][..length];
                    for (to, from) in to.iter_mut().zip(from) {
                        *to += from;
                    }
                }
            }
        });
    back
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_neighbourhoods_of_a_small_image_by_hand() {
        let grid = Grid {
            images: 1,
            height: 2,
            width: 3,
        };
        let device = Device::flex();
        let x = Tensor::<2>::from_data([[1.0], [2.0], [3.0], [4.0], [5.0], [6.0]], &device);
        let values = |stride| -> Vec<f32> {
            patches(x.clone(), grid, stride)
                .into_data()
                .iter()
                .collect()
        };
        let dense = values(1);
        assert_eq!(dense[..9], [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0, 4.0, 5.0]);
        assert_eq!(dense[9..18], [0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(dense[45..], [2.0, 3.0, 0.0, 5.0, 6.0, 0.0, 0.0, 0.0, 0.0]);
        let sparse = values(2);
        assert_eq!(sparse.len(), 2 * 9);
        assert_eq!(sparse[9..], [0.0, 0.0, 0.0, 2.0, 3.0, 0.0, 5.0, 6.0, 0.0]);
    }

    fn problem() -> impl Strategy<Value = (Grid, usize, usize, Vec<f32>)> {
        (1..3_usize, 1..5_usize, 1..5_usize, 1..3_usize, 1..3_usize).prop_flat_map(
            |(images, height, width, channels, stride)| {
                let grid = Grid {
                    images,
                    height,
                    width,
                };
                let values = prop::collection::vec(-1.0_f32..1.0, grid.rows() * channels);
                (Just(grid), Just(channels), Just(stride), values)
            },
        )
    }

    proptest! {
        /// A convolution is what the sum over shifted pixels says.
        #[test]
        fn agrees_with_the_definition((grid, channels, stride, values) in problem()) {
            let x = Tensor::<2>::from_data(
                TensorData::new(values.clone(), [grid.rows(), channels]),
                &Device::flex(),
            );
            let out: Vec<f32> = patches(x, grid, stride).into_data().iter().collect();
            let coarse = grid.every(stride);
            prop_assert_eq!(out.len(), coarse.rows() * 9 * channels);
            for row in 0..coarse.rows() {
                let image = row / (coarse.height * coarse.width);
                let y = row / coarse.width % coarse.height * stride;
                let x = row % coarse.width * stride;
                for place in 0..9 {
                    let (yy, xx) = ((y + place / 3).wrapping_sub(1), (x + place % 3).wrapping_sub(1));
                    for channel in 0..channels {
                        let expected = if yy < grid.height && xx < grid.width {
                            values[((image * grid.height + yy) * grid.width + xx) * channels + channel]
                        } else {
                            0.0
                        };
                        prop_assert_eq!(out[(row * 9 + place) * channels + channel], expected);
                    }
                }
            }
        }

        /// The operation is linear, so differences of any size give its gradient: of a weighted
        /// sum, the change when one input grows by 1.
        #[test]
        fn gradients_are_those_of_finite_differences((grid, channels, stride, values) in problem()) {
            let device = Device::flex().autodiff();
            let shape = [grid.rows(), channels];
            let x = Tensor::<2>::from_data(TensorData::new(values.clone(), shape), &device).require_grad();
            let coarse = grid.every(stride);
            let weights: Vec<f32> = (0..coarse.rows() * 9 * channels)
                .map(|i| (i as f32 * 0.7).sin())
                .collect();
            let weight = Tensor::<2>::from_data(
                TensorData::new(weights.clone(), [coarse.rows(), 9 * channels]),
                &device,
            );
            let gradients = (patches(x.clone(), grid, stride) * weight).sum().backward();
            let found: Vec<f32> = x.grad(&gradients).unwrap().into_data().iter().collect();
            let loss = |x: &[f32]| -> f64 {
                gather(x, channels, grid, stride)
                    .iter()
                    .zip(&weights)
                    .map(|(a, b)| f64::from(*a) * f64::from(*b))
                    .sum()
            };
            let before = loss(&values);
            for (at, found) in found.into_iter().enumerate() {
                let mut moved = values.clone();
                moved[at] += 1.0;
                let expected = loss(&moved) - before;
                prop_assert!((f64::from(found) - expected).abs() < 1e-4, "{found} is not {expected}");
            }
        }
    }
}
