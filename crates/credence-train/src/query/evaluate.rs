use burn::tensor::{Device, Tensor};
use credence_embed::query::{Batch, QueryNetwork};
use credence_types::Category;
use rayon::prelude::*;

use super::augment::{Example, validation_example};
use crate::{TrainError, data::SceneCache, run::Figures};

/// Scenes that are worked on at a time.
const TOGETHER: usize = 4;

/// Queries nearer to the surface than this are the hard ones.
const NEAR_M: f32 = 0.02;

/// What is counted over a set of queries or scenes.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    count: f64,
    right: f64,
    loss: f64,
}

impl Tally {
    fn add(&mut self, right: bool, loss: f64) {
        self.count += 1.0;
        self.right += f64::from(right);
        self.loss += loss;
    }

    fn accuracy(&self) -> f64 {
        self.right / self.count.max(1.0)
    }
}

/// Tallies of everything that is reported.
#[derive(Debug, Default)]
struct Tallies {
    surface: [Tally; Category::ALL.len()],
    near: Tally,
    direction: Tally,
    class: Tally,
}

/// Names of the figures, in the order of the log.
pub(super) fn figure_names() -> Vec<String> {
    let mut names: Vec<String> = ["bce", "accuracy", "accuracy_near", "direction", "class"]
        .map(str::to_owned)
        .to_vec();
    names.extend(Category::ALL.iter().map(|c| format!("accuracy_{c}")));
    names
}

/// Figures of a network on whole scenes, every query asked.
///
/// Cross entropy and accuracy of the surface, its accuracy within 2 cm of the true one, accuracy
/// of the directions on it, of the class head, and of the surface by category.
///
/// # Errors
/// A scene that cannot be read.
pub fn evaluate(network: &QueryNetwork, scenes: &SceneCache) -> Result<Figures, TrainError> {
    let device = Device::flex();
    let mut tallies = Tallies::default();
    let indices: Vec<usize> = (0..scenes.len()).collect();
    for indices in indices.chunks(TOGETHER) {
        let example = |index: &usize| validation_example(&scenes.get(*index)?);
        let examples: Result<Vec<Example>, TrainError> = indices.par_iter().map(example).collect();
        tallies.add(network, &examples?, &device)?;
    }
    Ok(tallies.figures())
}

impl Tallies {
    fn add(
        &mut self,
        network: &QueryNetwork,
        examples: &[Example],
        device: &Device,
    ) -> Result<(), TrainError> {
        let samples: Vec<_> = examples.iter().map(|e| e.sample.clone()).collect();
        let (encoded, decoded) = network.forward(&Batch::new(&samples, device)?);
        let cosines = decoded.directions.matmul(network.anchors().transpose());
        let closest = highest(cosines);
        let classes = highest(encoded.class_logits);
        let logits = decoded.logits.into_data();
        let mut answers = logits.iter::<f32>().map(f64::from).zip(closest);
        for (example, class) in examples.iter().zip(classes) {
            self.class.add(class == example.category, 0.0);
            for (label, distance_m) in example.labels.iter().zip(&example.distances_m) {
                let Some((logit, closest)) = answers.next() else {
                    break;
                };
                let on = *label > 0.5;
                let right = (logit > 0.0) == on;
                let loss =
                    logit.max(0.0) - logit * f64::from(*label) + (-logit.abs()).exp().ln_1p();
                self.surface[example.category].add(right, loss);
                if *distance_m < NEAR_M {
                    self.near.add(right, loss);
                }
                if on {
                    self.direction.add(closest == example.category, 0.0);
                }
            }
        }
        Ok(())
    }

    fn figures(&self) -> Figures {
        let mut all = Tally::default();
        for tally in &self.surface {
            all.count += tally.count;
            all.right += tally.right;
            all.loss += tally.loss;
        }
        let mut values = vec![
            all.loss / all.count.max(1.0),
            all.accuracy(),
            self.near.accuracy(),
            self.direction.accuracy(),
            self.class.accuracy(),
        ];
        values.extend(self.surface.iter().map(Tally::accuracy));
        figure_names().into_iter().zip(values).collect()
    }
}

/// Position of each row's highest value.
fn highest(rows: Tensor<2>) -> Vec<usize> {
    let places = rows.argmax(1).into_data();
    places.iter::<i64>().map(|place| place as usize).collect()
}
