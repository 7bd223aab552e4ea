use burn::tensor::Tensor;
use credence_embed::{
    MetricEmbedder,
    metric::{CLOUD_POINTS, MetricNetwork},
};
use credence_types::stream;
use rayon::prelude::*;

use super::{
    cloud::LabelledCloud,
    evaluate::{FIGURES, evaluate},
    losses::Losses,
};
use crate::{
    TrainError,
    data::SceneCache,
    run::{Figures, Task},
};

/// The metric embedding on cached scenes, one after the other.
pub(super) struct MetricTask {
    /// Scenes to train on.
    pub(super) scenes: SceneCache,
    /// Scenes to validate on.
    pub(super) validation: SceneCache,
    /// Seed of the augmentation and of the points that the loss is taken at.
    pub(super) seed: u64,
    /// Clouds of a step.
    pub(super) clouds: usize,
    /// Points of every cloud that the loss is taken at.
    pub(super) scored: usize,
}

impl Task for MetricTask {
    type Network = MetricNetwork;
    /// Clouds in the network's coordinates with their points' classes.
    type Batch = Vec<(Vec<[f32; 3]>, Vec<u8>)>;

    fn parts(&self) -> &'static [&'static str] {
        &["cross_entropy", "sphere"]
    }

    fn prepare(&self, step: u64) -> Result<Self::Batch, TrainError> {
        let cloud = |slot: usize| {
            let index = (step as usize - 1) * self.clouds + slot;
            let scene = self.scenes.get(index % self.scenes.len())?;
            let cloud = LabelledCloud::from_scene(&scene, CLOUD_POINTS);
            let mut rng = stream(self.seed, &format!("train/metric/{step}/{slot}"));
            Ok((cloud.turned(&mut rng)?, cloud.classes))
        };
        (0..self.clouds).into_par_iter().map(cloud).collect()
    }

    fn loss(
        &self,
        network: &MetricNetwork,
        batch: Self::Batch,
        step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError> {
        let mut rng = stream(self.seed, &format!("train/metric/{step}/rows"));
        let Losses {
            cross_entropy,
            sphere,
        } = Losses::of(network, &batch, self.scored, step as usize, &mut rng)?;
        let loss = cross_entropy.clone() + sphere.clone();
        Ok((loss, vec![cross_entropy, sphere]))
    }

    fn figures(&self) -> Vec<String> {
        FIGURES.map(str::to_owned).to_vec()
    }

    fn validate(&self, network: &MetricNetwork) -> Result<Figures, TrainError> {
        let embedder = MetricEmbedder::new(network.clone());
        Ok(evaluate(&embedder, &self.validation)?.figures())
    }
}
