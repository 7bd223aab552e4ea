use burn::tensor::{Device, Tensor};
use credence_complete::cloud::SurfaceNetwork;
use credence_nn::query::Batch;

use super::{
    evaluate::{evaluate, figure_names},
    example::{Example, training_example},
    losses::{Truth, losses},
};
use crate::{
    TrainError,
    augment::examples,
    data::SceneCache,
    run::{Figures, Task},
};

/// The surface network on cached scenes.
pub(super) struct SurfaceTask {
    /// Scenes to train on.
    pub(super) scenes: SceneCache,
    /// Scenes to validate on.
    pub(super) validation: SceneCache,
    /// Seed of the order and of the augmentation.
    pub(super) seed: u64,
    /// Observations of a step.
    pub(super) observations: usize,
    /// Queries of an observation.
    pub(super) queries: usize,
    /// Device that records gradients.
    pub(super) device: Device,
}

impl Task for SurfaceTask {
    type Network = SurfaceNetwork;
    type Batch = Vec<Example>;

    fn parts(&self) -> &'static [&'static str] {
        &["offset", "spread"]
    }

    fn prepare(&self, step: u64) -> Result<Vec<Example>, TrainError> {
        let draw = (self.seed, "cloud", step);
        examples(&self.scenes, draw, self.observations, |scene, rng| {
            training_example(scene, self.queries, rng)
        })
    }

    fn loss(
        &self,
        network: &SurfaceNetwork,
        examples: Vec<Example>,
        _step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError> {
        let truth = Truth::new(&examples, &self.device);
        let samples: Vec<_> = examples.into_iter().map(|e| e.sample).collect();
        let batch = Batch::new(&samples, &self.device)?;
        let [loss, offset, spread] = losses(network.forward(&batch), truth);
        Ok((loss, vec![offset, spread]))
    }

    fn figures(&self) -> Vec<String> {
        figure_names()
    }

    fn validate(&self, network: &SurfaceNetwork) -> Result<Figures, TrainError> {
        evaluate(network, &self.validation)
    }
}
