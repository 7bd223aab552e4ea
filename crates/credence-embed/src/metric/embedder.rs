use std::path::Path;

use burn::{
    module::Module as _,
    tensor::{Device, Tensor},
};
use credence_nn::weights;
use credence_types::Point;

use super::{
    clouds::{CloudBatch, centred, deal},
    network::{MetricNetwork, MetricWidths},
};
use crate::EmbedError;

/// Weights trained by `credence-train embed`.
static EMBEDDED: &[u8] = include_bytes!("../../../../assets/weights/metric.safetensors");

/// Points whose logits are computed together.
const BLOCK: usize = 256;

/// Directions on the unit sphere for the points of a cloud, from the trained network.
#[derive(Debug, Clone)]
pub struct MetricEmbedder {
    network: MetricNetwork,
}

impl MetricEmbedder {
    /// The network that comes with the library.
    ///
    /// # Errors
    ///
    /// When the weights do not fit the network.
    pub fn embedded() -> Result<Self, EmbedError> {
        let name = "the built-in weights of the metric embedding";
        let network = weights::from_bytes(untrained(), EMBEDDED.to_vec(), name)?;
        Ok(Self::new(network))
    }

    /// A network from a file of weights.
    ///
    /// # Errors
    ///
    /// When the file cannot be read, is damaged, or holds another network's weights.
    pub fn from_file(path: &Path) -> Result<Self, EmbedError> {
        Ok(Self::new(weights::load(untrained(), path)?))
    }

    /// A network at hand, as training has it.
    #[expect(
        clippy::needless_pass_by_value,
        reason = "the embedder takes the network over; burn freezes it by reference"
    )]
    pub fn new(network: MetricNetwork) -> Self {
        Self {
            network: network.valid(),
        }
    }

    /// A unit vector per point of a cloud, given in metres in any frame whose z axis points up.
    ///
    /// The cloud holds an object's points and the free space around it, as in training: about
    /// half of each, 2,048 together. More points are dealt at random into clouds of at most that
    /// size. The free points' vectors are of no use: the caller sets them to zero.
    ///
    /// # Errors
    ///
    /// When there are fewer than [`NEIGHBOURS`](super::NEIGHBOURS) points or a coordinate is not finite.
    pub fn embed(&self, points: &[Point]) -> Result<Vec<[f64; 3]>, EmbedError> {
        let embedded = self.embed_with_logits(points)?;
        Ok(embedded.into_iter().map(|point| point.direction).collect())
    }

    /// The unit vectors of [`embed`](Self::embed) with the logits they are made of.
    ///
    /// # Errors
    ///
    /// As [`embed`](Self::embed).
    pub fn embed_with_logits(&self, points: &[Point]) -> Result<Vec<MetricEmbedding>, EmbedError> {
        let centred = centred(points)?;
        let mut embedded = vec![MetricEmbedding::default(); points.len()];
        for indices in deal(points.len()) {
            let cloud: Vec<[f32; 3]> = indices.iter().map(|&i| centred[i]).collect();
            let blocks = self.network.in_blocks(&CloudBatch::new(&[&cloud])?, BLOCK);
            let points = blocks
                .into_iter()
                .flat_map(|[logits, features]| rows(logits).into_iter().zip(rows(features)));
            for (index, (logits, feature)) in indices.into_iter().zip(points) {
                embedded[index] = MetricEmbedding {
                    direction: unit(&feature),
                    logits,
                };
            }
        }
        Ok(embedded)
    }

    /// The categories' directions, unit vectors in the order of
    /// [`Category`](credence_types::Category).
    pub fn class_directions(&self) -> Vec<[f64; 3]> {
        let columns = rows(self.network.classes().transpose());
        columns.iter().map(|column| unit(column)).collect()
    }
}

/// What the network says about a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MetricEmbedding {
    /// Place on the unit sphere.
    pub direction: [f64; 3],
    /// One logit per class, free space first.
    pub logits: Vec<f64>,
}

fn untrained() -> MetricNetwork {
    MetricNetwork::new(&MetricWidths::default(), &Device::flex())
}

/// The rows of a matrix.
fn rows(tensor: Tensor<2>) -> Vec<Vec<f64>> {
    let [_, columns] = tensor.dims();
    let values: Vec<f64> = tensor.into_data().iter::<f64>().collect();
    values.chunks_exact(columns).map(<[f64]>::to_vec).collect()
}

/// The direction of a vector of three, +z where it has none.
fn unit(vector: &[f64]) -> [f64; 3] {
    let [x, y, z] = [vector[0], vector[1], vector[2]];
    let length = (x * x + y * y + z * z).sqrt();
    if length > 0.0 {
        [x / length, y / length, z / length]
    } else {
        [0.0, 0.0, 1.0]
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use credence_nn::seed_parameters;
    use credence_types::stream;
    use nalgebra::Vector3;
    use rand::RngExt as _;

    use super::*;

    fn embedder() -> MetricEmbedder {
        let device = Device::flex().autodiff();
        let network = MetricNetwork::new(&MetricWidths::default(), &device);
        MetricEmbedder::new(seed_parameters(network, &mut stream(3, "weights")))
    }

    fn cloud(count: usize) -> Vec<Point> {
        let mut rng = stream(4, "cloud");
        let mut coordinate = || rng.random_range(-0.1..0.1);
        (0..count)
            .map(|_| Point::new(coordinate(), coordinate(), coordinate()))
            .collect()
    }

    fn assert_unit(directions: &[[f64; 3]]) {
        for direction in directions {
            let length = direction.iter().map(|c| c * c).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 1e-9, "{direction:?}");
        }
    }

    #[test]
    fn every_point_gets_a_unit_vector_also_of_more_than_one_cloud() {
        let embedder = embedder();
        for count in [20, 21, 2048, 2049, 5000] {
            let directions = embedder.embed(&cloud(count)).unwrap();
            assert_eq!(directions.len(), count);
            assert_unit(&directions);
        }
    }

    #[test]
    fn duplicates_and_far_away_points_have_finite_vectors() {
        let embedder = embedder();
        let same = vec![Point::new(0.3, 0.2, 0.1); 25];
        assert_unit(&embedder.embed(&same).unwrap());
        let mut far = cloud(40);
        far[7] = Point::new(1e3, -4.0, 2.0);
        far[8] = Point::new(f64::MAX, f64::MIN, 0.0);
        assert_unit(&embedder.embed(&far).unwrap());
    }

    #[test]
    fn a_cloud_may_lie_anywhere_and_in_any_order() {
        let embedder = embedder();
        let here = cloud(100);
        let directions = embedder.embed(&here).unwrap();
        let close = |a: [f64; 3], b: [f64; 3]| {
            let cosine: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            assert!(cosine > 1.0 - 1e-6, "{a:?} is not {b:?}");
        };
        let away = Vector3::new(12.0, -7.0, 3.0);
        let there: Vec<Point> = here.iter().map(|p| p + away).collect();
        for (a, b) in embedder.embed(&there).unwrap().into_iter().zip(&directions) {
            close(a, *b);
        }
        let reversed: Vec<Point> = here.iter().rev().copied().collect();
        let reversed = embedder.embed(&reversed).unwrap();
        for (a, b) in reversed.into_iter().zip(directions.iter().rev()) {
            close(a, *b);
        }
    }

    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let embedder = embedder();
        let points = cloud(2100);
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| embedder.embed(&points).unwrap())
        };
        assert_eq!(on(1), on(2));
    }

    #[test]
    fn bad_clouds_have_their_messages() {
        let embedder = embedder();
        let message = |points: &[Point]| embedder.embed(points).unwrap_err().to_string();
        assert_eq!(
            message(&cloud(19)),
            "20 nearest of 19 points were asked for; pass at least 20 points"
        );
        assert!(message(&[]).contains("20 nearest of 0 points"));
        let mut nan = cloud(30);
        nan[4].y = f64::NAN;
        assert_eq!(
            message(&nan),
            "points[4] is not finite; remove such points first"
        );
    }

    #[test]
    fn bad_weight_files_have_their_messages() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metric.safetensors");
        let message = || MetricEmbedder::from_file(&path).unwrap_err().to_string();
        assert!(message().starts_with("cannot read "), "{}", message());
        let embedder = embedder();
        weights::save(&embedder.network, &path).unwrap();
        let loaded = MetricEmbedder::from_file(&path).unwrap();
        let points = cloud(60);
        assert_eq!(
            loaded.embed(&points).unwrap(),
            embedder.embed(&points).unwrap()
        );
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        assert!(
            message().contains("not a whole safetensors file"),
            "{}",
            message()
        );
    }

    #[test]
    fn the_built_in_network_has_six_directions_far_apart_and_puts_points_on_the_sphere() {
        let embedder = MetricEmbedder::embedded().unwrap();
        let directions = embedder.class_directions();
        assert_eq!(directions.len(), credence_types::Category::ALL.len());
        assert_unit(&directions);
        for (i, a) in directions.iter().enumerate() {
            for b in &directions[..i] {
                let cosine: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                assert!(
                    cosine < 0.5,
                    "{a:?} and {b:?} are less than 60 degrees apart"
                );
            }
        }
        assert_unit(&embedder.embed(&cloud(500)).unwrap());
    }
}
