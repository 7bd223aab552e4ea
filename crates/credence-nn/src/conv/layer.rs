use burn::{
    module::Module,
    tensor::{Device, Tensor, activation::relu},
};

use super::{Conv3, Grid};
use crate::RowNorm;

/// A 3x3 convolution, normalised and rectified.
#[derive(Module, Debug)]
pub struct Layer {
    conv: Conv3,
    norm: RowNorm,
}

impl Layer {
    /// A layer that keeps every `stride`-th pixel.
    pub fn new(inputs: usize, outputs: usize, stride: usize, device: &Device) -> Self {
        Self {
            conv: Conv3::new(inputs, outputs, stride, device),
            norm: RowNorm::new(outputs, device),
        }
    }

    /// The rows of the new grid, [`Grid::every`] of the old one.
    ///
    /// # Panics
    /// When the grid has another number of rows than `x`.
    pub fn forward(&self, x: Tensor<2>, grid: Grid) -> Tensor<2> {
        relu(self.norm.forward(self.conv.forward(x, grid)))
    }
}

#[cfg(test)]
mod tests {
    use burn::{module::Param, tensor::TensorData};

    use super::*;

    #[test]
    fn sums_of_neighbours_by_hand() {
        let device = Device::flex();
        let mut layer = Layer::new(1, 2, 2, &device);
        // The first channel is the sum of the neighbourhood, the second its negative.
        let weights = TensorData::new([1.0_f32, -1.0].repeat(9), [9, 2]);
        layer.conv.linear.weight = Param::from_data(weights, &device);
        let grid = Grid {
            images: 1,
            height: 2,
            width: 3,
        };
        let x = [[1.0], [-2.0], [3.0], [4.0], [-5.0], [-6.0]];
        let y = layer.forward(Tensor::from_data(x, &device), grid);
        assert_eq!(y.dims(), [grid.every(2).rows(), 2]);
        // 1 - 2 + 4 - 5 = -2 about the first pixel, -2 + 3 - 5 - 6 = -10 about the third; an
        // untrained normalisation leaves them as they are, but for its epsilon.
        let y: Vec<f32> = y.into_data().iter().collect();
        for (found, expected) in y.iter().zip([0.0, 2.0, 0.0, 10.0]) {
            assert!((found - expected).abs() < 1e-3, "{y:?}");
        }
    }
}
