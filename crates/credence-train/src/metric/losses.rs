use burn::{
    nn::loss::CrossEntropyLossConfig,
    tensor::{Int, Tensor, TensorData},
};
use credence_embed::{
    EmbedError,
    metric::{CloudBatch, MetricNetwork},
};
use credence_nn::loss::a_softmax::{a_softmax, annealing};
use credence_types::FREE_CLASS;
use rand::{Rng, seq::SliceRandom as _};

/// Probability that label smoothing takes from a point's class and shares among the others.
const SMOOTHING: f64 = 0.2;

/// Both parts of the loss of one batch.
pub(super) struct Losses {
    /// Cross-entropy of the logits of all points.
    pub(super) cross_entropy: Tensor<1>,
    /// A-Softmax of the head's features of the objects' points; the logits are constants to it,
    /// so the head learns from the network and not the other way round.
    pub(super) sphere: Tensor<1>,
}

impl Losses {
    /// The losses of clouds in the network's coordinates with their points' classes, after
    /// `step` steps, on `scored` points of every cloud, drawn at random: the features of all
    /// points enter, but only these points' logits are computed.
    pub(super) fn of(
        network: &MetricNetwork,
        clouds: &[(Vec<[f32; 3]>, Vec<u8>)],
        scored: usize,
        step: usize,
        rng: &mut impl Rng,
    ) -> Result<Self, EmbedError> {
        let points: Vec<&[[f32; 3]]> = clouds.iter().map(|(points, _)| points.as_slice()).collect();
        let batch = CloudBatch::new(&points)?;
        let mut rows = Vec::with_capacity(clouds.len() * scored);
        let mut classes = Vec::with_capacity(clouds.len() * scored);
        let mut first_row = 0_u32;
        for (_, labels) in clouds {
            let mut order: Vec<u32> = (0..labels.len() as u32).collect();
            let (drawn, _) = order.partial_shuffle(rng, scored);
            rows.extend(drawn.iter().map(|&i| (first_row + i).cast_signed()));
            classes.extend(drawn.iter().map(|&i| labels[i as usize]));
            first_row += labels.len() as u32;
        }
        Ok(Self::on_rows(network, &batch, rows, &classes, step))
    }

    fn on_rows(
        network: &MetricNetwork,
        batch: &CloudBatch,
        rows: Vec<i32>,
        classes: &[u8],
        step: usize,
    ) -> Self {
        let device = network.classes().device();
        let integers = |values: Vec<i32>| {
            let count = values.len();
            Tensor::<1, Int>::from_data(TensorData::new(values, [count]), &device)
        };
        let logits = network.logits(batch, Some(integers(rows)));
        let [_, class_count] = logits.dims();
        // burn's smoothing shares among all classes, the own one included.
        let share = class_count as f64 / (class_count - 1) as f64;
        let cross_entropy = CrossEntropyLossConfig::new()
            .with_smoothing(Some((SMOOTHING * share) as f32))
            .init(&device)
            .forward(
                logits.clone(),
                integers(classes.iter().map(|&c| i32::from(c)).collect()),
            );
        let (occupied, categories): (Vec<i32>, Vec<i32>) = (0..)
            .zip(classes)
            .filter(|(_, class)| **class != FREE_CLASS)
            .map(|(row, class)| (row, i32::from(*class) - 1))
            .unzip();
        let sphere = if occupied.is_empty() {
            Tensor::zeros([1], &device)
        } else {
            let logits = logits.detach().select(0, integers(occupied));
            a_softmax(
                network.features(logits),
                &network.classes(),
                integers(categories),
                annealing(step),
            )
        };
        Self {
            cross_entropy,
            sphere,
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        module::Module as _,
        optim::{AdamWConfig, GradientsParams},
        tensor::Device,
    };
    use credence_embed::metric::MetricWidths;
    use credence_nn::seed_parameters;
    use credence_types::stream;
    use rand::RngExt as _;

    use super::*;

    const WIDTHS: MetricWidths = MetricWidths {
        edge: 16,
        code: 64,
        decoder: [32, 16],
        logits: 4,
        head: [32, 16, 16],
    };
    const POINTS: usize = 96;
    const STEPS: usize = 400;

    /// A disc, a rod or a sphere, and free points well away from it.
    fn shape(class: u8, rng: &mut impl Rng) -> (Vec<[f32; 3]>, Vec<u8>) {
        let mut uniform = || rng.random_range(-1.0_f32..1.0);
        let surface = |p: [f32; 3]| match class {
            1 => [p[0], p[1], 0.0],
            2 => [0.0, 0.0, p[2]],
            _ => p.map(|c| c / (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt().max(0.1)),
        };
        let away = |p: [f32; 3]| {
            let q = surface(p);
            (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f32>() > 0.16
        };
        let mut draw = || [uniform(), uniform(), uniform()];
        let mut points: Vec<[f32; 3]> = (0..POINTS / 2).map(|_| surface(draw())).collect();
        points.extend(
            std::iter::repeat_with(draw)
                .filter(|p| away(*p))
                .take(POINTS / 2),
        );
        let mut classes = vec![class; POINTS / 2];
        classes.resize(POINTS, FREE_CLASS);
        (points, classes)
    }

    fn batch(rng: &mut impl Rng) -> Vec<(Vec<[f32; 3]>, Vec<u8>)> {
        (0..6).map(|i| shape(i % 3 + 1, rng)).collect()
    }

    #[test]
    fn three_shapes_are_learned_to_99_percent() {
        let device = Device::flex().autodiff();
        let network = MetricNetwork::new(&WIDTHS, &device);
        let mut network = seed_parameters(network, &mut stream(0, "weights"));
        let mut optimizer = AdamWConfig::new().init();
        for step in 0..STEPS {
            let mut rng = stream(0, &format!("step {step}"));
            let clouds = batch(&mut rng);
            let losses = Losses::of(&network, &clouds, POINTS / 2, step, &mut rng).unwrap();
            let loss = losses.cross_entropy + losses.sphere;
            let grads = GradientsParams::from_grads(loss.backward(), &network);
            network = optimizer.step(8e-3 * (1.0 - step as f64 / STEPS as f64), network, grads);
        }

        let network = network.valid();
        let directions: Vec<Vec<f32>> = rows(network.classes().transpose());
        let (mut right, mut on_sphere, mut points, mut occupied) = (0, 0, 0, 0);
        let mut rng = stream(1, "unseen");
        for (cloud, classes) in (0..5).flat_map(|_| batch(&mut rng)) {
            let logits = network.logits(&CloudBatch::new(&[&cloud]).unwrap(), None);
            let features = rows(network.features(logits.clone()));
            for ((logits, feature), class) in rows(logits).into_iter().zip(features).zip(classes) {
                points += 1;
                right += u32::from(largest(&logits) == usize::from(class));
                if class != FREE_CLASS {
                    occupied += 1;
                    let cosines: Vec<f32> =
                        directions.iter().map(|d| cosine(d, &feature)).collect();
                    on_sphere += u32::from(largest(&cosines) + 1 == usize::from(class));
                }
            }
        }
        let share = |count: u32, of: u32| f64::from(count) / f64::from(of);
        assert!(share(right, points) >= 0.99, "{right} of {points} by logit");
        assert!(
            share(on_sphere, occupied) >= 0.99,
            "{on_sphere} of {occupied} by direction"
        );
    }

    fn cosine(a: &[f32], b: &[f32]) -> f32 {
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
    }

    fn largest(values: &[f32]) -> usize {
        (0..values.len())
            .max_by(|a, b| values[*a].total_cmp(&values[*b]))
            .unwrap()
    }

    fn rows(tensor: Tensor<2>) -> Vec<Vec<f32>> {
        let [_, columns] = tensor.dims();
        let values: Vec<f32> = tensor.into_data().iter::<f32>().collect();
        values.chunks_exact(columns).map(<[f32]>::to_vec).collect()
    }

    #[test]
    fn smoothing_leaves_four_fifths_to_the_own_class() {
        // Equal logits: any target of sum 1 costs ln(classes).
        let device = Device::flex();
        let network = MetricNetwork::new(&WIDTHS, &device);
        let clouds = [shape(1, &mut stream(0, "shape"))];
        let points: Vec<&[[f32; 3]]> = clouds.iter().map(|(points, _)| points.as_slice()).collect();
        let batch = CloudBatch::new(&points).unwrap();
        let logits = network.logits(&batch, Some(Tensor::from_data([0], &device)));
        let [own, others] = [0.8, 0.2 / 3.0];
        let log: Vec<f32> = rows(burn::tensor::activation::log_softmax(logits, 1)).concat();
        let expected: f32 = -log
            .iter()
            .enumerate()
            .map(|(class, log)| log * if class == 1 { own } else { others })
            .sum::<f32>();
        let losses = Losses::on_rows(&network, &batch, vec![0], &[1], 0);
        let found: f32 = losses.cross_entropy.into_scalar();
        assert!((found - expected).abs() < 1e-5, "{found} is not {expected}");
    }

    #[test]
    fn the_sphere_loss_leaves_the_logits_alone() {
        let device = Device::flex().autodiff();
        let network = MetricNetwork::new(&WIDTHS, &device);
        let clouds = batch(&mut stream(0, "batch"));
        let losses = Losses::of(&network, &clouds, 20, 0, &mut stream(0, "rows")).unwrap();
        let grads = GradientsParams::from_grads(losses.sphere.backward(), &network);
        // Four layers of the head with their biases, and the classes' directions.
        assert_eq!(grads.len(), 9);
    }

    #[test]
    fn a_batch_of_free_space_alone_has_no_sphere_loss() {
        let device = Device::flex().autodiff();
        let network = MetricNetwork::new(&WIDTHS, &device);
        let (points, _) = shape(1, &mut stream(0, "shape"));
        let clouds = [(points, vec![FREE_CLASS; POINTS])];
        let losses = Losses::of(&network, &clouds, 20, 0, &mut stream(0, "rows")).unwrap();
        assert_eq!(losses.sphere.into_scalar::<f32>(), 0.0);
    }
}
