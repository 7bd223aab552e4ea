use burn::tensor::{Device, Tensor};
use credence_embed::query::{Batch, QueryNetwork};

use super::{
    augment::{Example, training_example},
    evaluate::{evaluate, figure_names},
    losses::{Truth, losses},
};
use crate::{
    TrainError,
    augment::examples,
    data::SceneCache,
    run::{Figures, Task},
};

/// The query network on cached scenes.
pub struct QueryTask {
    /// Scenes to train on.
    pub scenes: SceneCache,
    /// Scenes to validate on.
    pub validation: SceneCache,
    /// Seed of the order and of the augmentation.
    pub seed: u64,
    /// Observations of a step.
    pub observations: usize,
    /// Queries of an observation.
    pub queries: usize,
    /// Device that records gradients.
    pub device: Device,
}

impl Task for QueryTask {
    type Network = QueryNetwork;
    type Batch = Vec<Example>;

    fn parts(&self) -> &'static [&'static str] {
        &["surface", "direction", "class"]
    }

    fn prepare(&self, step: u64) -> Result<Vec<Example>, TrainError> {
        let draw = (self.seed, "query", step);
        examples(&self.scenes, draw, self.observations, |scene, rng| {
            training_example(scene, self.queries, rng)
        })
    }

    fn loss(
        &self,
        network: &QueryNetwork,
        examples: Vec<Example>,
        _step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError> {
        let truth = Truth::new(&examples, &self.device);
        let samples: Vec<_> = examples.into_iter().map(|e| e.sample).collect();
        let batch = Batch::new(&samples, &self.device)?;
        let (encoded, decoded) = network.forward(&batch);
        let [loss, surface, direction, class] = losses(network, &encoded, decoded, truth);
        Ok((loss, vec![surface, direction, class]))
    }

    fn figures(&self) -> Vec<String> {
        figure_names()
    }

    fn validate(&self, network: &QueryNetwork) -> Result<Figures, TrainError> {
        evaluate(network, &self.validation)
    }
}
