use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor, activation::relu},
};

use super::{Conv3, Grid, Layer, thin};
use crate::RowNorm;

/// The basic block of residual networks (He et al. 2016).
#[derive(Module, Debug)]
pub struct Block {
    first: Layer,
    second: Conv3,
    norm: RowNorm,
    shortcut: Option<Linear>,
    shortcut_norm: Option<RowNorm>,
    stride: usize,
}

impl Block {
    /// A block that keeps every `stride`-th pixel. The path around its convolutions is a linear
    /// layer where the shape changes, else it is the input itself.
    pub fn new(inputs: usize, outputs: usize, stride: usize, device: &Device) -> Self {
        let other = stride != 1 || inputs != outputs;
        Self {
            first: Layer::new(inputs, outputs, stride, device),
            second: Conv3::new(outputs, outputs, 1, device),
            norm: RowNorm::new(outputs, device),
            shortcut: other.then(|| {
                let linear = LinearConfig::new(inputs, outputs).with_bias(false);
                linear.init(device)
            }),
            shortcut_norm: other.then(|| RowNorm::new(outputs, device)),
            stride,
        }
    }

    /// The rows of the new grid, and this grid: [`Grid::every`] of the old one.
    ///
    /// # Panics
    /// When the grid has another number of rows than `x`.
    pub fn forward(&self, x: Tensor<2>, grid: Grid) -> (Tensor<2>, Grid) {
        let coarse = grid.every(self.stride);
        let y = self.first.forward(x.clone(), grid);
        let y = self.norm.forward(self.second.forward(y, coarse));
        let around = match (&self.shortcut, &self.shortcut_norm) {
            (Some(linear), Some(norm)) => norm.forward(linear.forward(thin(x, grid, self.stride))),
            _ => x,
        };
        (relu(y + around), coarse)
    }
}

#[cfg(test)]
mod tests {
    use burn::module::Param;

    use super::*;

    const GRID: Grid = Grid {
        images: 1,
        height: 2,
        width: 2,
    };

    /// What is left of two channels when the convolutions give nothing: the path around them.
    fn around(mut block: Block) -> (Vec<f32>, Grid) {
        let device = Device::flex();
        let nothing = block.second.linear.weight.val().zeros_like();
        block.second.linear.weight = Param::from_tensor(nothing);
        let x = [[1.0, -1.0], [2.0, -2.0], [-3.0, 3.0], [4.0, 4.0]];
        let (y, grid) = block.forward(Tensor::from_data(x, &device), GRID);
        (y.into_data().iter().collect(), grid)
    }

    #[test]
    fn the_input_passes_around_a_block_that_keeps_its_shape() {
        let (y, grid) = around(Block::new(2, 2, 1, &Device::flex()));
        assert_eq!(grid, GRID);
        assert_eq!(y, [1.0, 0.0, 2.0, 0.0, 0.0, 3.0, 4.0, 4.0]);
    }

    #[test]
    fn a_linear_layer_leads_around_one_that_changes_it() {
        let device = Device::flex();
        let mut block = Block::new(2, 3, 2, &device);
        let weights = [[1.0, 0.0, 2.0], [0.0, 1.0, -1.0]];
        let linear = block.shortcut.as_mut().unwrap();
        linear.weight = Param::from_data(weights, &device);
        let (y, grid) = around(block);
        assert_eq!(grid, GRID.every(2));
        // Of the first pixel, (1, -1): 1, -1 and 3; the normalisation has its epsilon.
        for (found, expected) in y.iter().zip([1.0, 0.0, 3.0]) {
            assert!((found - expected).abs() < 1e-3, "{y:?}");
        }
        assert_eq!(y.len(), 3);
    }
}
