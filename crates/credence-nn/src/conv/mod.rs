//! Convolutions over feature maps that are kept as rows, `[images * height * width, channels]`.
//!
//! A pixel's channels lie together, so that a 1x1 convolution is a linear layer, normalisation is
//! that of rows ([`RowNorm`](crate::RowNorm)), and a 3x3 convolution is one product of its
//! neighbourhoods with a matrix. Gathering the neighbourhoods is an operation of its own with a
//! gradient of its own: burn's CPU backend has no kernel for the weights of a convolution.

mod block;
mod layer;
mod patches;

use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Int, Tensor, TensorData},
};

pub use block::Block;
pub use layer::Layer;
pub use patches::patches;

/// Pixels of a 3x3 neighbourhood.
pub const NEIGHBOURHOOD: usize = 9;

/// How the rows of a batch of feature maps lie: image by image, row by row, column by column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Feature maps.
    pub images: usize,
    /// Pixels down.
    pub height: usize,
    /// Pixels across.
    pub width: usize,
}

impl Grid {
    /// Number of rows.
    pub const fn rows(&self) -> usize {
        self.images * self.height * self.width
    }

    /// The grid of every `stride`-th pixel, the first among them.
    #[must_use]
    pub const fn every(&self, stride: usize) -> Self {
        Self {
            images: self.images,
            height: self.height.div_ceil(stride),
            width: self.width.div_ceil(stride),
        }
    }

    /// The row of this grid at or before each pixel of a finer grid of which it is every second
    /// one: what nearest-neighbour enlargement reads.
    fn enlarged(&self, fine: Self) -> Vec<i32> {
        let mut rows = Vec::with_capacity(fine.rows());
        for image in 0..fine.images {
            for y in 0..fine.height {
                let first = (image * self.height + y / 2) * self.width;
                rows.extend((0..fine.width).map(|x| ((first + x / 2) as u32).cast_signed()));
            }
        }
        rows
    }
}

/// A 3x3 convolution without bias, zeros around the image.
#[derive(Module, Debug)]
pub struct Conv3 {
    linear: Linear,
    stride: usize,
}

impl Conv3 {
    /// A layer that keeps every `stride`-th pixel.
    pub fn new(inputs: usize, outputs: usize, stride: usize, device: &Device) -> Self {
        Self {
            linear: LinearConfig::new(NEIGHBOURHOOD * inputs, outputs)
                .with_bias(false)
                .init(device),
            stride,
        }
    }

    /// The rows of the new grid, [`Grid::every`] of the old one.
    ///
    /// # Panics
    /// When the grid has another number of rows than `x`.
    pub fn forward(&self, x: Tensor<2>, grid: Grid) -> Tensor<2> {
        self.linear.forward(patches(x, grid, self.stride))
    }
}

/// Every `stride`-th pixel of feature maps, the first among them; `grid` is that of `x`.
///
/// # Panics
/// When the grid has another number of rows than `x`.
pub fn thin(x: Tensor<2>, grid: Grid, stride: usize) -> Tensor<2> {
    assert_eq!(x.dims()[0], grid.rows(), "a row of features per pixel");
    let coarse = grid.every(stride);
    let mut rows = Vec::with_capacity(coarse.rows());
    for image in 0..grid.images {
        for y in (0..grid.height).step_by(stride) {
            let first = (image * grid.height + y) * grid.width;
            let columns = (0..grid.width).step_by(stride);
            rows.extend(columns.map(|x| ((first + x) as u32).cast_signed()));
        }
    }
    select(x, rows)
}

/// Doubles feature maps in both directions by repeating pixels; `fine` is the grid of the result.
///
/// # Panics
/// When `fine` is not twice the grid of `x`, give or take an odd last row or column.
pub fn enlarge(x: Tensor<2>, fine: Grid) -> Tensor<2> {
    let grid = fine.every(2);
    assert_eq!(x.dims()[0], grid.rows(), "a row of features per pixel");
    select(x, grid.enlarged(fine))
}

fn select(x: Tensor<2>, rows: Vec<i32>) -> Tensor<2> {
    let count = rows.len();
    let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [count]), &x.device());
    x.select(0, rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_odd_grid_is_enlarged_by_hand() {
        let fine = Grid {
            images: 2,
            height: 3,
            width: 2,
        };
        assert_eq!(fine.every(2).rows(), 4);
        let x = Tensor::<2>::from_data([[1.0], [2.0], [3.0], [4.0]], &Device::flex());
        let y: Vec<f32> = enlarge(x, fine).into_data().iter().collect();
        let first = [1.0, 1.0, 1.0, 1.0, 2.0, 2.0];
        assert_eq!(y[..6], first);
        assert_eq!(y[6..], first.map(|v| v + 2.0));
    }

    #[test]
    fn thinning_keeps_the_first_of_each_square() {
        let grid = Grid {
            images: 2,
            height: 3,
            width: 2,
        };
        let values = TensorData::new((0..12).map(|v| v as f32).collect(), [12, 1]);
        let x = Tensor::<2>::from_data(values, &Device::flex());
        let y: Vec<f32> = thin(x, grid, 2).into_data().iter().collect();
        assert_eq!(y, [0.0, 4.0, 6.0, 10.0]);
    }
}
