use burn::tensor::Device;
use credence_complete::cloud::SurfaceNetwork;
use credence_nn::query::{Batch, Sample};
use credence_types::Category;
use rayon::prelude::*;

use super::example::{Example, validation_example};
use crate::{TrainError, augment::UNITS_PER_M, data::SceneCache, run::Figures};

/// Scenes that are worked on at a time.
const TOGETHER: usize = 4;

/// Queries nearer to the surface than this are the ones that a completion ends with, metres.
const NEAR_M: f64 = 0.02;

/// An offset that errs by less than this leads to the surface, metres: the tolerance of the scores.
const ON_SURFACE_M: f64 = 0.005;

/// What is summed over queries.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    count: f64,
    error_m: f64,
    on_surface: f64,
    spread_m: f64,
}

impl Tally {
    fn add(&mut self, error_m: f64, spread_m: f64) {
        self.count += 1.0;
        self.error_m += error_m;
        self.on_surface += f64::from(error_m <= ON_SURFACE_M);
        self.spread_m += spread_m;
    }

    fn mean(&self, sum: f64) -> f64 {
        sum / self.count.max(1.0)
    }
}

/// Names of the figures, in the order of the log.
pub(super) fn figure_names() -> Vec<String> {
    let mut names: Vec<String> = ["near_mm", "near_spread_mm", "near_within_5mm", "far_mm"]
        .map(str::to_owned)
        .to_vec();
    names.extend(Category::ALL.iter().map(|c| format!("near_mm_{c}")));
    names
}

/// Mean error of the offsets of a network on whole scenes, of queries within 2 cm of the surface
/// (all, and by category) and beyond, and the mean spread that it claims of the former.
///
/// # Errors
/// A scene that cannot be read.
pub(super) fn evaluate(
    network: &SurfaceNetwork,
    scenes: &SceneCache,
) -> Result<Figures, TrainError> {
    let device = Device::flex();
    let mut near = [Tally::default(); Category::ALL.len()];
    let mut far = Tally::default();
    let indices: Vec<usize> = (0..scenes.len()).collect();
    for indices in indices.chunks(TOGETHER) {
        let example = |index: &usize| {
            let scene = scenes.get(*index)?;
            Ok((scene.category, validation_example(&scene)?))
        };
        let examples: Result<Vec<(Category, Example)>, TrainError> =
            indices.par_iter().map(example).collect();
        let examples = examples?;
        let samples: Vec<Sample> = examples.iter().map(|(_, e)| e.sample.clone()).collect();
        let decoded = network.forward(&Batch::new(&samples, &device)?);
        let offsets = decoded.offsets.into_data();
        let mut offsets = offsets.iter::<f64>();
        let spreads = decoded.log_spreads.exp().into_data();
        let mut spreads = spreads.iter::<f64>();
        for (category, example) in &examples {
            for truth in &example.offsets {
                let (mut square, mut distance) = (0.0, 0.0);
                for axis in truth {
                    let found = offsets.next().unwrap_or(f64::NAN);
                    square += (found - f64::from(*axis)).powi(2);
                    distance += f64::from(*axis).powi(2);
                }
                let error_m = square.sqrt() / UNITS_PER_M;
                let spread_m = spreads.next().unwrap_or(f64::NAN) / UNITS_PER_M;
                if distance.sqrt() / UNITS_PER_M < NEAR_M {
                    near[usize::from(category.class()) - 1].add(error_m, spread_m);
                } else {
                    far.add(error_m, spread_m);
                }
            }
        }
    }
    let mut all = Tally::default();
    for tally in &near {
        all.count += tally.count;
        all.error_m += tally.error_m;
        all.on_surface += tally.on_surface;
        all.spread_m += tally.spread_m;
    }
    let mut values = vec![
        1e3 * all.mean(all.error_m),
        1e3 * all.mean(all.spread_m),
        all.mean(all.on_surface),
        1e3 * far.mean(far.error_m),
    ];
    values.extend(near.iter().map(|tally| 1e3 * tally.mean(tally.error_m)));
    Ok(figure_names().into_iter().zip(values).collect())
}
