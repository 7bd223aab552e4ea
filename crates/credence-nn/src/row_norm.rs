use burn::{
    module::Module,
    nn::{BatchNorm, BatchNormConfig},
    tensor::{Device, Tensor},
};

/// Batch normalisation of rows, `[rows, channels]`.
///
/// In training burn's own brings the channels first, by a copy of the whole tensor for each of its
/// reductions; here the statistics are sums over the rows where they are. In inference it is one
/// product and one sum per element.
#[derive(Module, Debug)]
pub struct RowNorm {
    norm: BatchNorm,
}

impl RowNorm {
    /// A layer with scale 1 and shift 0.
    pub fn new(channels: usize, device: &Device) -> Self {
        Self {
            norm: BatchNormConfig::new(channels).init(device),
        }
    }

    /// Rows with mean 0 and variance 1 in every channel, scaled and shifted: by the statistics of
    /// these rows on a device that records gradients, else by those of the training.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        let norm = &self.norm;
        let [rows, channels] = x.dims();
        let row = |values: Tensor<1>| values.reshape([1, channels]);
        if !(x.device().is_autodiff() && norm.training.is_enabled()) {
            let device = x.device();
            let mean = norm.running_mean.value().to_device(&device);
            let variance = norm.running_var.value().to_device(&device);
            let scale = norm.gamma.val() / (variance + norm.epsilon).sqrt();
            let shift = norm.beta.val() - mean * scale.clone();
            return x * row(scale) + row(shift);
        }
        // A product with ones is the fastest sum over rows.
        let shares = Tensor::<2>::ones([1, rows], &x.device()) / rows as f64;
        let mean = shares.clone().matmul(x.clone());
        let centred = x - mean.clone();
        let variance = shares.matmul(centred.clone() * centred.clone());
        let per_channel = |running: Tensor<1>, batch: &Tensor<2>| {
            let batch = batch.clone().detach().reshape([channels]);
            (running * (1.0 - norm.momentum) + batch * norm.momentum).detach()
        };
        let running_mean = norm.running_mean.value_sync();
        let running_variance = norm.running_var.value_sync();
        norm.running_mean.update(per_channel(running_mean, &mean));
        norm.running_var
            .update(per_channel(running_variance, &variance));
        let scale = row(norm.gamma.val()) / (variance + norm.epsilon).sqrt();
        centred * scale + row(norm.beta.val())
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        module::{Module as _, Param},
        tensor::TensorData,
    };
    use proptest::prelude::*;

    use super::*;

    fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
        tensor.into_data().iter::<f32>().collect()
    }

    fn close(a: &[f32], b: &[f32]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3)
    }

    proptest! {
        #[test]
        fn agrees_with_burn_in_output_gradient_and_statistics(
            rows in 2..20_usize,
            draws in prop::collection::vec(-3.0_f32..3.0, 3 * 20),
            upstream in prop::collection::vec(-1.0_f32..1.0, 3 * 20),
        ) {
            let device = Device::flex().autodiff();
            let tensor = |values: &[f32]| {
                Tensor::<2>::from_data(TensorData::new(values[..3 * rows].to_vec(), [rows, 3]), &device)
            };
            let spread = |c: usize| {
                let column = || (0..rows).map(|r| draws[3 * r + c]);
                column().fold(f32::MIN, f32::max) - column().fold(f32::MAX, f32::min)
            };
            // A channel that hardly varies is divided by nearly nothing.
            prop_assume!((0..3).all(|c| spread(c) > 0.5));
            let layer = || {
                let mut layer = RowNorm::new(3, &device);
                layer.norm.gamma = Param::from_data([0.5_f32, -2.0, 1.0], &device);
                layer.norm.beta = Param::from_data([1.0_f32, 0.0, -3.0], &device);
                layer
            };
            let (ours, theirs) = (layer(), layer().norm);
            let run = |forward: &dyn Fn(Tensor<2>) -> Tensor<2>, norm: &BatchNorm| {
                let x = tensor(&draws).require_grad();
                let y = forward(x.clone());
                let grads = (y.clone() * tensor(&upstream)).sum().backward();
                [
                    values(y),
                    values(x.grad(&grads).unwrap()),
                    values(norm.gamma.val().grad(&grads).unwrap()),
                    values(norm.beta.val().grad(&grads).unwrap()),
                    values(norm.running_mean.value_sync()),
                    values(norm.running_var.value_sync()),
                ]
            };
            let a = run(&|x| ours.forward(x), &ours.norm);
            let b = run(&|x| theirs.forward(x), &theirs);
            for (a, b) in a.iter().zip(&b) {
                prop_assert!(close(a, b), "{a:?} is not {b:?}");
            }
            let served = values(ours.valid().forward(tensor(&draws).inner()));
            let expected = values(theirs.valid().forward(tensor(&draws).inner()));
            prop_assert!(close(&served, &expected));
        }
    }
}
