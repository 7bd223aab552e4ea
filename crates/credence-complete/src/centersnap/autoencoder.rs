use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor, activation::relu},
};
use credence_nn::strongest_rows;

/// Numbers that a shape is described by.
pub const LATENT: usize = 128;

/// Points of a decoded shape.
pub const DECODED_POINTS: usize = 2048;

/// Shapes as 128 numbers each, and back: the point auto-encoder of `CenterSnap` (Irshad et al.
/// 2022).
///
/// Points are in the normalised object frame: z up, the box's middle at the origin, its diagonal 1.
#[derive(Module, Debug)]
pub struct AutoEncoder {
    encoder: PointEncoder,
    decoder: PointDecoder,
}

impl AutoEncoder {
    /// A network with unseeded weights.
    pub fn new(device: &Device) -> Self {
        Self {
            encoder: PointEncoder::new(device),
            decoder: PointDecoder::new(device),
        }
    }

    /// The latent of each of `clouds` equally large clouds, `[clouds, 128]`, from their points one
    /// cloud after the other, `[points, 3]`.
    ///
    /// # Panics
    /// When the points are not equally many per cloud.
    pub fn encode(&self, points: Tensor<2>, clouds: usize) -> Tensor<2> {
        self.encoder.forward(points, clouds)
    }

    /// The points of each latent, `[latents * 2048, 3]`; point i of any two of them correspond.
    pub fn decode(&self, latents: Tensor<2>) -> Tensor<2> {
        self.decoder.forward(latents)
    }
}

/// 3-64-128 per point, their maximum, and a linear layer that spreads it out.
#[derive(Module, Debug)]
struct PointEncoder {
    first: Linear,
    second: Linear,
    latent: Linear,
}

impl PointEncoder {
    fn new(device: &Device) -> Self {
        let layer = |inputs, outputs| LinearConfig::new(inputs, outputs).init(device);
        Self {
            first: layer(3, 64),
            second: layer(64, LATENT),
            latent: layer(LATENT, LATENT),
        }
    }

    fn forward(&self, points: Tensor<2>, clouds: usize) -> Tensor<2> {
        let features = self.second.forward(relu(self.first.forward(points)));
        let winners = strongest_rows(features.clone(), clouds).reshape([clouds, LATENT]);
        self.latent.forward(features.gather(0, winners))
    }
}

/// 128-512-1024-2048x3.
#[derive(Module, Debug)]
struct PointDecoder {
    first: Linear,
    second: Linear,
    points: Linear,
}

impl PointDecoder {
    fn new(device: &Device) -> Self {
        let layer = |inputs, outputs| LinearConfig::new(inputs, outputs).init(device);
        Self {
            first: layer(LATENT, 512),
            second: layer(512, 1024),
            points: layer(1024, 3 * DECODED_POINTS),
        }
    }

    fn forward(&self, latents: Tensor<2>) -> Tensor<2> {
        let [latents_count, _] = latents.dims();
        let hidden = relu(self.second.forward(relu(self.first.forward(latents))));
        let points = self.points.forward(hidden);
        points.reshape([latents_count * DECODED_POINTS, 3])
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;

    fn cloud(points: &[[f32; 3]]) -> Tensor<2> {
        let data = TensorData::new(points.as_flattened().to_vec(), [points.len(), 3]);
        Tensor::from_data(data, &Device::flex())
    }

    #[test]
    fn a_latent_does_not_depend_on_the_order_or_on_the_other_clouds() {
        let network = AutoEncoder::new(&Device::flex());
        let a = [[0.1, 0.2, 0.3], [-0.4, 0.0, 0.2], [0.0, 0.3, -0.1]];
        let b = [[0.5, 0.5, 0.5], [0.1, 0.1, 0.0], [0.2, -0.2, 0.2]];
        let latent = |points: &[[f32; 3]], clouds| -> Vec<f32> {
            network
                .encode(cloud(points), clouds)
                .into_data()
                .iter()
                .collect()
        };
        let alone = latent(&[a[2], a[0], a[1]], 1);
        let together = latent(&[a, b].concat(), 2);
        let close = |p: &[f32], q: &[f32]| p.iter().zip(q).all(|(p, q)| (p - q).abs() < 1e-5);
        assert!(close(&alone, &together[..LATENT]));
        assert!(!close(&alone, &together[LATENT..]));
        let points = network.decode(Tensor::zeros([2, LATENT], &Device::flex()));
        assert_eq!(points.dims(), [2 * DECODED_POINTS, 3]);
    }
}
