use burn::tensor::{Tensor, activation::relu};

/// Slope below zero, as in DGCNN.
const SLOPE: f64 = 0.2;

/// max(x, 0.2 x), as 0.8 relu(x) + 0.2 x.
///
/// burn's own is several times slower in training: it records a comparison, a product and a
/// choice by mask, which branches at every element.
pub fn leaky_relu<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    relu(x.clone()) * (1.0 - SLOPE) + x * SLOPE
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;

    #[test]
    fn slopes_are_one_fifth_and_one() {
        let device = Device::flex().autodiff();
        let x = Tensor::<1>::from_data([-5.0_f32, -0.5, 0.0, 2.0], &device).require_grad();
        let y = leaky_relu(x.clone());
        let close = |found: Tensor<1>, expected: [f32; 4]| {
            for (found, expected) in found.into_data().iter::<f32>().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
            }
        };
        close(y.clone(), [-1.0, -0.1, 0.0, 2.0]);
        let grads = y.sum().backward();
        close(x.grad(&grads).unwrap(), [0.2, 0.2, 0.2, 1.0]);
    }
}
