use burn::tensor::{
    Tensor,
    activation::{self, relu},
};

/// Slope below zero, as in DGCNN.
const SLOPE: f64 = 0.2;

/// max(x, 0.2 x).
///
/// On a device that records gradients as 0.8 relu(x) + 0.2 x: burn's own is several times slower
/// there, since it records a comparison, a product and a choice by mask, which branches at every
/// element.
pub fn leaky_relu<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    if x.is_autodiff() {
        relu(x.clone()) * (1.0 - SLOPE) + x * SLOPE
    } else {
        activation::leaky_relu(x, SLOPE)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;

    #[test]
    fn slopes_are_one_fifth_and_one_with_and_without_gradients() {
        let device = Device::flex();
        let x = Tensor::<1>::from_data([-5.0_f32, -0.5, 0.0, 2.0], &device);
        let close = |found: Tensor<1>, expected: [f32; 4]| {
            for (found, expected) in found.into_data().iter::<f32>().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
            }
        };
        close(leaky_relu(x.clone()), [-1.0, -0.1, 0.0, 2.0]);
        let x = x.autodiff().require_grad();
        let y = leaky_relu(x.clone());
        close(y.clone(), [-1.0, -0.1, 0.0, 2.0]);
        let grads = y.sum().backward();
        close(x.grad(&grads).unwrap(), [0.2, 0.2, 0.2, 1.0]);
    }
}
