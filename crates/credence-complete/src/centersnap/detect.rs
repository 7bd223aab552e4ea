use burn::tensor::{Device, Tensor, TensorData};
use credence_nn::{knn::Neighbours, read, rgbd::RgbdImage};
use credence_types::{Category, Point, stream};
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, RngExt as _};
use rayon::prelude::*;

use super::{
    autoencoder::{AutoEncoder, DECODED_POINTS, LATENT},
    image::{CELLS, anchors},
    network::{CATEGORIES, CenterSnapNetwork, ImageBatch, StatisticValues},
    pose::{Anchor, ObjectPose, POSE},
};
use crate::CompleteError;

/// Least heat of an object.
const LEAST_HEAT: f32 = 0.3;
/// Cells around a peak in which there is no higher one.
const APART: usize = 2;
/// Shapes and poses that an object's spread is taken from.
const SAMPLES: usize = 8;

/// A cell where the network sees an object's centre, and what it says there.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// The object's category.
    pub category: Category,
    /// How sure the network is of the centre: its heat, about 1 at best.
    pub heat: f32,
    /// The cell.
    pub anchor: Anchor,
    /// The shape, in the unit of the statistics.
    pub latent: [f32; LATENT],
    /// The pose, told from the anchor.
    pub pose: [f32; POSE],
}

/// An object that the network has found.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Its category.
    pub category: Category,
    /// How sure the network is of it, in \[0, 1\].
    pub score: f64,
    /// The cell that tells of it: column and row in the network's camera.
    pub pixel: [f64; 2],
    /// Where it is, and its size.
    pub pose: ObjectPose,
    /// Its box along its own axes, metres.
    pub size_m: [f64; 3],
    /// 2,048 points of its surface, camera frame.
    pub points_camera: Vec<Point>,
    /// Expected distance of each from the true surface, metres.
    pub spread_m: Vec<f64>,
}

/// The trained networks, ready to look at images.
#[derive(Debug)]
pub struct CenterSnap {
    network: CenterSnapNetwork,
    autoencoder: AutoEncoder,
    statistics: StatisticValues,
    device: Device,
}

impl CenterSnap {
    /// Networks at hand, which record no gradients.
    pub fn new(network: CenterSnapNetwork, autoencoder: AutoEncoder) -> Self {
        Self {
            statistics: network.statistics().values(),
            network,
            autoencoder,
            device: Device::flex(),
        }
    }

    /// Looks at an image: every object's centre and what is told there, the surest first.
    ///
    /// # Errors
    /// None that a CPU gives.
    pub fn look(&self, image: &RgbdImage) -> Result<Vec<Told>, CompleteError> {
        let batch = ImageBatch::new(std::slice::from_ref(image), &self.device);
        let cells = self.network.forward(&batch);
        let heat = read(cells.heat)?;
        let peaks = peaks(&heat);
        if peaks.is_empty() {
            return Ok(Vec::new());
        }
        let voters: Vec<Vec<(usize, f32)>> = peaks.iter().map(|p| voters(&heat, p)).collect();
        let places: Vec<usize> = voters.iter().flatten().map(|(cell, _)| *cell).collect();
        let (latents, poses) = self.network.objects(&cells.features, &places);
        let (latents, poses) = (read(latents)?, read(poses)?);
        let latents = latents.as_chunks::<LATENT>().0.iter();
        let mut answers = latents.zip(poses.as_chunks::<POSE>().0);
        let anchors = anchors(image);
        Ok(peaks
            .iter()
            .zip(&voters)
            .map(|(peak, voters)| {
                let votes: Vec<Vote> = voters
                    .iter()
                    .zip(&mut answers)
                    .map(|((cell, heat), (latent, pose))| Vote {
                        weight: f64::from(*heat),
                        anchor: anchors[*cell],
                        latent: *latent,
                        pose: *pose,
                    })
                    .collect();
                let anchor = anchors[peak.cell];
                let (latent, pose) = agreed(&votes, &anchor);
                Told {
                    category: Category::ALL[peak.category],
                    heat: peak.heat,
                    anchor,
                    latent,
                    pose,
                }
            })
            .collect())
    }

    /// The objects that were told of, with their points and spreads; none that makes no sense.
    ///
    /// # Errors
    /// None that a CPU gives.
    pub fn detections(&self, told: &[Told]) -> Result<Vec<Detection>, CompleteError> {
        let mut rng = stream(0, "centersnap/spread");
        let mut guesses = Vec::with_capacity(told.len() * (1 + SAMPLES));
        for told in told {
            guesses.push((told.latent, told.pose));
            for _ in 0..SAMPLES {
                guesses.push(self.sample(told, &mut rng));
            }
        }
        if guesses.is_empty() {
            return Ok(Vec::new());
        }
        let latents: Vec<_> = guesses.iter().map(|(latent, _)| *latent).collect();
        let clouds = self.decode(&latents)?;
        let of_each = told.par_iter().zip(
            guesses
                .par_chunks(1 + SAMPLES)
                .zip(clouds.par_chunks((1 + SAMPLES) * DECODED_POINTS)),
        );
        let detections: Vec<Option<Detection>> = of_each
            .map(|(told, (guesses, clouds))| {
                let Some(pose) = told.anchor.decode(told.pose) else {
                    return Ok(None);
                };
                let (own, samples) = clouds.split_at(DECODED_POINTS);
                let points: Vec<Point> = own.iter().map(|p| pose.place(*p)).collect();
                let samples: Vec<Vec<[f32; 3]>> = guesses[1..]
                    .iter()
                    .zip(samples.chunks(DECODED_POINTS))
                    .filter_map(|((_, pose), cloud)| {
                        let pose = told.anchor.decode(*pose)?;
                        Some(cloud.iter().map(|p| narrow(&pose.place(*p))).collect())
                    })
                    .collect();
                let factor = self.statistics.spread_factor[place_of(told.category)];
                Ok(Some(Detection {
                    category: told.category,
                    score: f64::from(told.heat.clamp(0.0, 1.0)),
                    pixel: told.anchor.pixel,
                    size_m: box_of(own).map(|side| f64::from(side) * pose.scale_m),
                    spread_m: spreads(&points, &samples, f64::from(factor))?,
                    pose,
                    points_camera: points,
                }))
            })
            .collect::<Result<_, CompleteError>>()?;
        Ok(detections.into_iter().flatten().collect())
    }

    /// Shape and pose as they might be too, given how wrong the network was in validation.
    fn sample(&self, told: &Told, rng: &mut impl Rng) -> ([f32; LATENT], [f32; POSE]) {
        let category = place_of(told.category);
        let mut latent = told.latent;
        for (value, error) in latent
            .iter_mut()
            .zip(&self.statistics.latent_error[category])
        {
            *value += error * normal(rng);
        }
        let mut pose = told.pose;
        for (value, error) in pose.iter_mut().zip(&self.statistics.pose_error[category]) {
            *value += error * normal(rng);
        }
        (latent, pose)
    }

    /// The points of latents in the unit of the statistics, in the normalised object frame.
    fn decode(&self, latents: &[[f32; LATENT]]) -> Result<Vec<[f32; 3]>, CompleteError> {
        let StatisticValues {
            latent_mean,
            latent_scale,
            ..
        } = &self.statistics;
        let count = latents.len();
        let values: Vec<f32> = latents
            .iter()
            .flat_map(|latent| latent.iter().zip(latent_mean))
            .map(|(value, mean)| value * latent_scale + mean)
            .collect();
        let latents = Tensor::from_data(TensorData::new(values, [count, LATENT]), &self.device);
        let points = read(self.autoencoder.decode(latents))?;
        Ok(points.as_chunks::<3>().0.to_vec())
    }
}

/// Place of a category among all.
fn place_of(category: Category) -> usize {
    usize::from(category.class()) - 1
}

/// A cell whose heat is the highest around.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Peak {
    cell: usize,
    category: usize,
    heat: f32,
}

/// The peaks of heat maps of all categories, cell by cell, the highest first: over a threshold, and
/// no other cell within two is higher, whatever its category.
fn peaks(heat: &[f32]) -> Vec<Peak> {
    let [across, down] = CELLS;
    let highest: Vec<Peak> = heat
        .chunks_exact(CATEGORIES)
        .enumerate()
        .map(|(cell, heats)| {
            let first = Peak {
                cell,
                category: 0,
                heat: f32::NEG_INFINITY,
            };
            (0..).zip(heats).fold(first, |best, (category, &heat)| {
                if heat > best.heat {
                    Peak {
                        cell,
                        category,
                        heat,
                    }
                } else {
                    best
                }
            })
        })
        .collect();
    let higher = |a: &Peak, b: &Peak| a.heat > b.heat || (a.heat == b.heat && a.cell < b.cell);
    let around = |at: usize, size: usize| at.saturating_sub(APART)..(at + APART + 1).min(size);
    let mut peaks: Vec<Peak> = highest
        .iter()
        .filter(|peak| peak.heat >= LEAST_HEAT)
        .filter(|peak| {
            let (row, column) = (peak.cell / across, peak.cell % across);
            !around(row, down)
                .flat_map(|row| around(column, across).map(move |column| row * across + column))
                .any(|cell| higher(&highest[cell], peak))
        })
        .copied()
        .collect();
    peaks.sort_by(|a, b| b.heat.total_cmp(&a.heat).then(a.cell.cmp(&b.cell)));
    peaks
}

/// The cells that a peak's object is told from, with their heat: the peak and those of its eight
/// neighbours that are warm for its category, as the cells were that learned to tell.
fn voters(heat: &[f32], peak: &Peak) -> Vec<(usize, f32)> {
    let [across, down] = CELLS;
    let (row, column) = (peak.cell / across, peak.cell % across);
    let around = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
    around(row, down)
        .flat_map(|row| around(column, across).map(move |column| row * across + column))
        .map(|cell| (cell, heat[cell * CATEGORIES + peak.category]))
        .filter(|(_, heat)| *heat >= LEAST_HEAT)
        .collect()
}

/// What one cell tells of an object.
struct Vote {
    weight: f64,
    anchor: Anchor,
    latent: [f32; LATENT],
    pose: [f32; POSE],
}

/// The mean of the votes, by their weights, told from one cell. Each cell was taught the whole
/// object, so their errors partly cancel.
fn agreed(votes: &[Vote], anchor: &Anchor) -> ([f32; LATENT], [f32; POSE]) {
    let mut latent = [0.0_f64; LATENT];
    let (mut rotation, mut centre_m, mut log_scale) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    let mut total = 0.0;
    for vote in votes {
        let Some(pose) = vote.anchor.decode(vote.pose) else {
            continue;
        };
        total += vote.weight;
        rotation += pose.rotation * vote.weight;
        centre_m += pose.centre_m * vote.weight;
        log_scale += pose.scale_m.ln() * vote.weight;
        for (sum, value) in latent.iter_mut().zip(vote.latent) {
            *sum += f64::from(value) * vote.weight;
        }
    }
    // Numbers that are none stay so: such an object is dropped.
    let pose = anchor.encode(&ObjectPose {
        rotation: rotation / total,
        centre_m: centre_m / total,
        scale_m: (log_scale / total).exp(),
    });
    (latent.map(|sum| (sum / total) as f32), pose)
}

/// Of each point, the mean distance from the surfaces that might be there instead.
fn spreads(
    points: &[Point],
    samples: &[Vec<[f32; 3]>],
    factor: f64,
) -> Result<Vec<f64>, CompleteError> {
    let queries: Vec<[f32; 3]> = points.iter().map(narrow).collect();
    let mut sums = vec![0.0; points.len()];
    for sample in samples {
        let nearest = Neighbours::new(sample)?.nearest(&queries, 1)?;
        for ((sum, query), index) in sums.iter_mut().zip(&queries).zip(nearest) {
            let other = sample[index as usize];
            let squared = (0..3).map(|axis| f64::from(query[axis] - other[axis]).powi(2));
            *sum += squared.sum::<f64>().sqrt();
        }
    }
    let share = factor / samples.len().max(1) as f64;
    Ok(sums.into_iter().map(|sum| sum * share).collect())
}

fn box_of(points: &[[f32; 3]]) -> [f32; 3] {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    [0, 1, 2].map(|axis| (high[axis] - low[axis]).max(0.0))
}

fn narrow(point: &Point) -> [f32; 3] {
    [point.x, point.y, point.z].map(|c| c as f32)
}

/// A standard normal number, by Box and Muller.
fn normal(rng: &mut impl Rng) -> f32 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    (radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_by_hand() {
        let [across, down] = CELLS;
        let mut heat = vec![0.0; across * down * CATEGORIES];
        let mut set = |row: usize, column: usize, category: usize, value: f32| {
            heat[(row * across + column) * CATEGORIES + category] = value;
        };
        set(0, 0, 5, 0.8);
        // Within two cells of a higher one, of whatever category.
        set(2, 1, 1, 0.7);
        set(2, 3, 1, 0.6);
        // Beyond.
        set(10, 10, 2, 0.9);
        set(10, 10, 3, 0.5);
        set(13, 10, 3, 0.9);
        // Equal neighbours: the first stands for both.
        set(20, 20, 0, 0.4);
        set(20, 21, 0, 0.4);
        set(29, 39, 4, 0.29);
        let found: Vec<(usize, usize, f32)> = peaks(&heat)
            .iter()
            .map(|p| (p.cell, p.category, p.heat))
            .collect();
        let cell = |row, column| row * across + column;
        let expected = [
            (cell(10, 10), 2, 0.9),
            (cell(13, 10), 3, 0.9),
            (cell(0, 0), 5, 0.8),
            (cell(20, 20), 0, 0.4),
        ];
        assert_eq!(found, expected);
        assert_eq!(peaks(&vec![f32::NAN; heat.len()]), []);
    }

    #[test]
    fn an_object_is_told_from_the_warm_cells_around_its_peak() {
        let [across, down] = CELLS;
        let mut heat = vec![0.0; across * down * CATEGORIES];
        for (row, column, category, value) in [
            (0, 5, 2, 0.9),
            (0, 4, 2, 0.6),
            (1, 5, 2, 0.29),
            (1, 6, 3, 0.5),
            (0, 7, 2, 0.8),
        ] {
            heat[(row * across + column) * CATEGORIES + category] = value;
        }
        let peak = Peak {
            cell: 5,
            category: 2,
            heat: 0.9,
        };
        assert_eq!(voters(&heat, &peak), [(4, 0.6), (5, 0.9)]);
    }

    #[test]
    fn votes_agree_on_their_weighted_mean() {
        let anchor = |column: f64, depth_m| Anchor {
            pixel: [column, 119.75],
            depth_m,
        };
        let vote = |weight, anchor: Anchor, depth: f64, latent: f32| Vote {
            weight,
            anchor,
            latent: [latent; LATENT],
            pose: anchor.encode(&ObjectPose {
                rotation: Matrix3::identity(),
                centre_m: Vector3::new(0.0, 0.0, depth),
                scale_m: 0.2,
            }),
        };
        let votes = [
            vote(3.0, anchor(155.5, 0.45), 0.5, 1.0),
            vote(1.0, anchor(163.5, 0.6), 0.54, 5.0),
        ];
        let told_from = anchor(155.5, 0.45);
        let (latent, pose) = agreed(&votes, &told_from);
        assert!(latent.iter().all(|v| (v - 2.0).abs() < 1e-6));
        let pose = told_from.decode(pose).unwrap();
        assert!((pose.centre_m - Vector3::new(0.0, 0.0, 0.51)).norm() < 1e-6);
        assert!((pose.rotation - Matrix3::identity()).amax() < 1e-6);
        assert!((pose.scale_m - 0.2).abs() < 1e-6);

        // A vote that is none does not count; without any other there is no object.
        let mut votes = votes;
        votes[1].pose = [f32::NAN; POSE];
        let (latent, _) = agreed(&votes, &told_from);
        assert!(latent.iter().all(|v| (v - 1.0).abs() < 1e-6));
        let (_, pose) = agreed(&votes[1..], &told_from);
        assert_eq!(told_from.decode(pose), None);
    }

    #[test]
    fn spread_is_the_mean_distance_from_the_other_surfaces() {
        let points = [Point::origin(), Point::new(1.0, 0.0, 0.0)];
        let samples = vec![
            vec![[0.0, 0.0, 0.5], [1.0, 0.0, 0.0]],
            vec![[0.0, 0.25, 0.0], [3.0, 0.0, 0.0]],
        ];
        let found = spreads(&points, &samples, 2.0).unwrap();
        // (0.5 + 0.25) / 2 and (0 + sqrt(1 + 1/16)) / 2, twice.
        assert!((found[0] - 0.75).abs() < 1e-6);
        assert!((found[1] - (17.0_f64 / 16.0).sqrt()).abs() < 1e-6);
        assert_eq!(spreads(&points, &[], 2.0).unwrap(), [0.0; 2]);
    }
}
