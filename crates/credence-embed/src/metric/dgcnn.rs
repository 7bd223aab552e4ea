use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor},
};
use credence_nn::{RowNorm, edge_conv::EdgeConv, leaky_relu, strongest_rows};

use super::{clouds::CloudBatch, network::MetricWidths};

/// Per-point logits of a cloud (Wang et al. 2019, the network for part segmentation).
///
/// All three edge convolutions use the k nearest neighbours in space. The published network looks
/// for neighbours among its own features anew in every layer, which here would cost three times
/// more than the layers do: the second layer's neighbours would have to be searched in 64
/// dimensions, where no tree helps.
#[derive(Module, Debug)]
pub(super) struct Dgcnn {
    edges: [EdgeConv; 3],
    points: [PointLayer; 2],
    code: Linear,
    code_norm: RowNorm,
    from_code: Linear,
    from_point: Linear,
    decoder_norm: RowNorm,
    decoder: PointLayer,
    logits: Linear,
}

impl Dgcnn {
    pub(super) fn new(widths: &MetricWidths, device: &Device) -> Self {
        let edge = widths.edge;
        let [first, second] = widths.decoder;
        // Normalisation follows: a bias would cancel.
        let linear = |inputs, outputs| {
            LinearConfig::new(inputs, outputs)
                .with_bias(false)
                .init(device)
        };
        Self {
            edges: [3, edge, edge].map(|inputs| EdgeConv::new(inputs, edge, device)),
            points: [(); 2].map(|()| PointLayer::new(edge, edge, device)),
            code: linear(3 * edge, widths.code),
            code_norm: RowNorm::new(widths.code, device),
            from_code: linear(widths.code, first),
            from_point: linear(3 * edge, first),
            decoder_norm: RowNorm::new(first, device),
            decoder: PointLayer::new(first, second, device),
            logits: LinearConfig::new(second, widths.logits).init(device),
        }
    }

    /// What is known of every cloud.
    pub(super) fn encode(&self, batch: &CloudBatch) -> Encoded {
        let points = self.point_features(batch);
        let codes = self.cloud_codes(&points, batch.clouds());
        Encoded { points, codes }
    }

    /// Logits of points from their features, `[points, 3 * edge]`, and their clouds' codes:
    /// equally many points of every cloud, cloud by cloud.
    pub(super) fn decode(&self, points: Tensor<2>, codes: Tensor<2>) -> Tensor<2> {
        // The layer on [code, features] is the sum of a layer on each: the code's is computed
        // once per cloud.
        let from_code = self.from_code.forward(codes);
        let from_point = self.from_point.forward(points);
        let [clouds, width] = from_code.dims();
        let [points, _] = from_point.dims();
        let hidden = (from_point.reshape([clouds, points / clouds, width])
            + from_code.reshape([clouds, 1, width]))
        .reshape([points, width]);
        let hidden = leaky_relu(self.decoder_norm.forward(hidden));
        self.logits.forward(self.decoder.forward(hidden))
    }

    /// The three edge convolutions' features side by side, `[rows, 3 * edge]`.
    fn point_features(&self, batch: &CloudBatch) -> Tensor<2> {
        let [first, second, third] = &self.edges;
        let [after_first, after_second] = &self.points;
        let device = self.logits.weight.val().device();
        let graph = batch.graph();
        let a = after_first.forward(first.forward(batch.coordinates(&device), graph));
        let b = after_second.forward(second.forward(a.clone(), graph));
        let c = third.forward(b.clone(), graph);
        Tensor::cat(vec![a, b, c], 1)
    }

    /// One code per cloud: every channel's strongest response over the cloud's points, normalised
    /// after the maximum.
    ///
    /// The gradient reaches only the winning point of each channel, so the responses of all
    /// points are computed outside autodiff and the winners' once more inside.
    fn cloud_codes(&self, features: &Tensor<2>, clouds: usize) -> Tensor<2> {
        let weight = self.code.weight.val();
        let [inputs, channels] = weight.dims();
        let responses = features.clone().inner().matmul(weight.clone().inner());
        let winners = strongest_rows(responses, clouds).to_device(&features.device());
        let winners = features
            .clone()
            .select(0, winners)
            .reshape([clouds, channels, inputs]);
        let responses = (winners * weight.transpose().reshape([1, channels, inputs]))
            .sum_dim(2)
            .reshape([clouds, channels]);
        leaky_relu(self.code_norm.forward(responses))
    }
}

/// Clouds as the network knows them.
pub(super) struct Encoded {
    /// Features of every point, cloud by cloud.
    pub(super) points: Tensor<2>,
    /// A code per cloud.
    pub(super) codes: Tensor<2>,
}

/// A layer applied to every point by itself.
#[derive(Module, Debug)]
struct PointLayer {
    linear: Linear,
    norm: RowNorm,
}

impl PointLayer {
    fn new(inputs: usize, outputs: usize, device: &Device) -> Self {
        Self {
            linear: LinearConfig::new(inputs, outputs)
                .with_bias(false)
                .init(device),
            norm: RowNorm::new(outputs, device),
        }
    }

    fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        leaky_relu(self.norm.forward(self.linear.forward(x)))
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use credence_nn::seed_parameters;
    use credence_types::stream;
    use rand::RngExt as _;

    use super::*;

    const WIDTHS: MetricWidths = MetricWidths {
        edge: 4,
        code: 6,
        decoder: [8, 5],
        logits: 3,
        head: [4, 4, 4],
    };
    const POINTS: usize = 30;

    fn cloud(seed: u64) -> Vec<[f32; 3]> {
        let mut rng = stream(seed, "cloud");
        (0..POINTS)
            .map(|_| [(); 3].map(|()| rng.random_range(-1.0..1.0)))
            .collect()
    }

    fn network(device: &Device) -> Dgcnn {
        seed_parameters(Dgcnn::new(&WIDTHS, device), &mut stream(1, "weights"))
    }

    fn values(tensor: Tensor<2>) -> Vec<f32> {
        tensor.into_data().iter::<f32>().collect()
    }

    fn close(a: &[f32], b: &[f32]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4)
    }

    #[test]
    fn a_cloud_in_a_batch_has_the_logits_it_has_alone() {
        let network = network(&Device::flex().autodiff()).valid();
        let (a, b) = (cloud(1), cloud(2));
        let both = network.encode(&CloudBatch::new(&[&a, &b]).unwrap());
        let alone = network.encode(&CloudBatch::new(&[&b]).unwrap());
        let some_of_both = both.points.clone();
        let codes = both.codes.clone();
        let both = values(network.decode(both.points, both.codes));
        let alone = values(network.decode(alone.points, alone.codes));
        assert!(close(&both[POINTS * WIDTHS.logits..], &alone));
        // The second cloud's rows begin at 30.
        let chosen = [3_u8, 0, 37, 31];
        let rows = TensorData::new(chosen.map(i32::from).to_vec(), [4]);
        let rows = some_of_both.select(0, Tensor::from_data(rows, &Device::flex()));
        let some = values(network.decode(rows, codes));
        for (row, some) in chosen.iter().zip(some.chunks(WIDTHS.logits)) {
            assert!(close(
                &both[usize::from(*row) * WIDTHS.logits..][..WIDTHS.logits],
                some
            ));
        }
    }

    #[test]
    fn a_permutation_of_the_cloud_permutes_the_logits() {
        let network = network(&Device::flex().autodiff()).valid();
        let first = cloud(1);
        let reversed: Vec<[f32; 3]> = first.iter().rev().copied().collect();
        let logits = |cloud: &[[f32; 3]]| {
            let encoded = network.encode(&CloudBatch::new(&[cloud]).unwrap());
            values(network.decode(encoded.points, encoded.codes))
        };
        let (forth, back) = (logits(&first), logits(&reversed));
        for (forth, back) in forth
            .chunks(WIDTHS.logits)
            .zip(back.chunks(WIDTHS.logits).rev())
        {
            assert!(close(forth, back), "{forth:?} is not {back:?}");
        }
    }

    #[test]
    fn the_code_is_the_maximum_of_all_points_responses_with_its_gradient() {
        let device = Device::flex().autodiff();
        let network = network(&device);
        let mut rng = stream(2, "features");
        let draws: Vec<f32> = (0..3 * 4 * 12)
            .map(|_| rng.random_range(-1.0..1.0))
            .collect();
        let tensor = || {
            let data = TensorData::new(draws.clone(), [3 * 4, 12]);
            Tensor::<2>::from_data(data, &device).require_grad()
        };
        let (sparse, dense) = (tensor(), tensor());
        let upstream = Tensor::<2>::from_data([[1.0_f32, 2.0, -1.0, 0.5, 3.0, -2.0]; 3], &device);

        let code = network.cloud_codes(&sparse, 3);
        let responses = dense
            .clone()
            .matmul(network.code.weight.val())
            .reshape([3, 4, WIDTHS.code])
            .max_dim(1)
            .reshape([3, WIDTHS.code]);
        let expected = leaky_relu(network.code_norm.forward(responses));
        assert!(close(&values(code.clone()), &values(expected.clone())));

        // A square: what batch normalisation centres gives a plain sum no gradient.
        let gradient = |code: Tensor<2>, at: &Tensor<2>| {
            let loss = ((code + 0.3) * upstream.clone()).powi_scalar(2).sum();
            let grads = loss.backward();
            let weight = network.code.weight.val().grad(&grads).unwrap();
            (values(at.grad(&grads).unwrap()), values(weight))
        };
        let (sparse_x, sparse_w) = gradient(code, &sparse);
        let (dense_x, dense_w) = gradient(expected, &dense);
        assert!(
            close(&sparse_x, &dense_x),
            "{sparse_x:?} is not {dense_x:?}"
        );
        assert!(
            close(&sparse_w, &dense_w),
            "{sparse_w:?} is not {dense_w:?}"
        );
    }

    #[test]
    fn every_weight_gets_a_gradient() {
        let device = Device::flex().autodiff();
        let network = network(&device);
        let (a, b) = (cloud(1), cloud(2));
        let encoded = network.encode(&CloudBatch::new(&[&a, &b]).unwrap());
        let logits = network.decode(encoded.points, encoded.codes);
        let loss = logits.powi_scalar(2).mean();
        let grads = burn::optim::GradientsParams::from_grads(loss.backward(), &network);
        // Ten layers' weights, scales and shifts of eight normalisations, and one bias.
        assert_eq!(grads.len(), 10 + 2 * 8 + 1);
    }
}
