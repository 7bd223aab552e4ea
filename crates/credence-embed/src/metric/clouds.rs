use burn::tensor::{Device, Tensor, TensorData};
use credence_nn::{NnError, edge_conv::NeighbourGraph};
use credence_types::{Point, all_finite, stream};
use rand::seq::SliceRandom as _;

use crate::EmbedError;

/// Neighbours per point, the point itself among them.
pub const NEIGHBOURS: usize = 20;

/// Points of a cloud in training, and the most that one cloud has in inference.
pub const CLOUD_POINTS: usize = 2048;

/// Metres per unit of the network's coordinates: objects are about one to two units wide.
const UNIT_M: f64 = 0.1;

/// Ten metres: nothing that far from a cloud's centre is told apart by its distance, and no
/// coordinate overflows.
const FARTHEST: f64 = 100.0;

/// Clouds of equally many points and their neighbour graph, as the network reads them.
#[derive(Debug, Clone)]
pub struct CloudBatch {
    coordinates: Vec<f32>,
    graph: NeighbourGraph,
    clouds: usize,
}

impl CloudBatch {
    /// Clouds in the network's coordinates, as [`centred`] makes them.
    ///
    /// # Errors
    ///
    /// When there is no cloud, one has fewer than [`NEIGHBOURS`] points, or they differ in size.
    pub fn new(clouds: &[&[[f32; 3]]]) -> Result<Self, EmbedError> {
        let points = clouds.first().map_or(0, |cloud| cloud.len());
        if let Some(odd) = clouds.iter().find(|cloud| cloud.len() != points) {
            return Err(EmbedError::UnequalClouds {
                first: points,
                other: odd.len(),
            });
        }
        if points < NEIGHBOURS {
            let k = NEIGHBOURS;
            return Err(NnError::TooFewPoints { k, points }.into());
        }
        Ok(Self {
            coordinates: clouds
                .iter()
                .flat_map(|cloud| cloud.as_flattened())
                .copied()
                .collect(),
            graph: NeighbourGraph::nearest(clouds, NEIGHBOURS)?,
            clouds: clouds.len(),
        })
    }

    /// Number of clouds.
    pub fn clouds(&self) -> usize {
        self.clouds
    }

    pub(super) fn graph(&self) -> &NeighbourGraph {
        &self.graph
    }

    /// All points, `[rows, 3]`.
    pub(super) fn coordinates(&self, device: &Device) -> Tensor<2> {
        let shape = [self.graph.rows(), 3];
        Tensor::from_data(TensorData::new(self.coordinates.clone(), shape), device)
    }
}

/// The network's coordinates of a cloud: from its mean, in units of 0.1 m, clamped at ten metres.
///
/// The mean needs no knowledge of the table or the object's pose, and with it the embedding does
/// not depend on where in the world the cloud lies. The size is kept: it tells a mug from a
/// laptop.
///
/// # Errors
///
/// When a coordinate is not finite.
pub fn centred(points: &[Point]) -> Result<Vec<[f32; 3]>, EmbedError> {
    all_finite("points", points)?;
    let share = 1.0 / points.len() as f64;
    let mut mean = Point::origin();
    for point in points {
        // Scaled first, so that no sum overflows.
        mean += point.coords * share;
    }
    let unit = |from: f64, to: f64| ((to - from) / UNIT_M).clamp(-FARTHEST, FARTHEST) as f32;
    Ok(points
        .iter()
        .map(|p| [unit(mean.x, p.x), unit(mean.y, p.y), unit(mean.z, p.z)])
        .collect())
}

/// Indices of the points of every cloud when `count` points are dealt at random into as few
/// clouds of at most [`CLOUD_POINTS`] as can be, at least one, of sizes that differ by at most one.
///
/// The draw is fixed: the same points get the same clouds in every run.
pub(super) fn deal(count: usize) -> Vec<Vec<usize>> {
    let clouds = count.div_ceil(CLOUD_POINTS).max(1);
    let mut order: Vec<usize> = (0..count).collect();
    if clouds > 1 {
        order.shuffle(&mut stream(0, "metric clouds"));
    }
    (0..clouds)
        .map(|i| order[i * count / clouds..(i + 1) * count / clouds].to_vec())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_is_centred_on_its_mean_in_tenths_of_a_metre() {
        let points = [Point::new(7.0, -3.0, 0.5), Point::new(7.2, -3.0, 0.3)];
        let centred = centred(&points).unwrap();
        for (point, expected) in centred.iter().zip([[-1.0, 0.0, 1.0], [1.0, 0.0, -1.0]]) {
            for (value, expected) in point.iter().zip(expected) {
                assert!((value - expected).abs() < 1e-6, "{value} is not {expected}");
            }
        }
    }

    #[test]
    fn the_largest_numbers_stay_finite() {
        let points = [
            Point::new(f64::MAX, 0.0, 0.0),
            Point::new(f64::MIN, 0.0, 0.0),
            Point::new(f64::MAX, 0.0, 0.0),
        ];
        let x: Vec<f32> = centred(&points).unwrap().iter().map(|p| p[0]).collect();
        assert_eq!(x, [100.0, -100.0, 100.0]);
    }

    #[test]
    fn a_coordinate_that_is_not_finite_is_named() {
        let points = [Point::origin(), Point::new(0.0, f64::NAN, 1.0)];
        let message = centred(&points).unwrap_err().to_string();
        assert!(message.starts_with("points[1] is not finite"), "{message}");
    }

    #[test]
    fn every_point_is_dealt_once_into_clouds_of_nearly_equal_size() {
        for (count, sizes) in [
            (0, vec![0]),
            (20, vec![20]),
            (2048, vec![2048]),
            (2049, vec![1024, 1025]),
            (5000, vec![1666, 1667, 1667]),
        ] {
            let clouds = deal(count);
            assert_eq!(clouds.iter().map(Vec::len).collect::<Vec<_>>(), sizes);
            let mut all = clouds.concat();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count));
            assert_eq!(clouds, deal(count), "the draw is fixed");
        }
    }

    #[test]
    fn a_million_points_make_clouds_of_the_size_of_the_training() {
        let sizes: Vec<usize> = deal(1_000_000).iter().map(Vec::len).collect();
        assert_eq!(sizes.len(), 489);
        assert_eq!(sizes.iter().sum::<usize>(), 1_000_000);
        assert!(sizes.iter().all(|size| [2044, 2045].contains(size)));
    }

    #[test]
    fn clouds_of_one_batch_have_one_size_and_enough_points() {
        let cloud = |n: usize| vec![[0.0_f32; 3]; n];
        let (small, large) = (cloud(19), cloud(30));
        let message = CloudBatch::new(&[&small]).unwrap_err().to_string();
        assert!(
            message.contains("19") && message.contains("20"),
            "{message}"
        );
        let message = CloudBatch::new(&[&large, &small]).unwrap_err().to_string();
        assert!(
            message.contains("30") && message.contains("19"),
            "{message}"
        );
        assert!(CloudBatch::new(&[]).is_err());
        assert_eq!(CloudBatch::new(&[&large, &large]).unwrap().clouds(), 2);
    }
}
