use burn::tensor::{Device, Tensor};
use credence_complete::centersnap::CenterSnapNetwork;
use credence_types::stream;
use rayon::prelude::*;

use super::{
    evaluate::{Trial, evaluate, figure_names},
    example::Example,
    losses::losses,
    truth::Shapes,
};
use crate::{
    TrainError,
    data::{MeshSet, Picture},
    run::{Figures, Task},
};

/// `CenterSnap`'s network on pictures that are drawn for each step.
pub(super) struct CenterSnapTask {
    pub(super) meshes: MeshSet,
    pub(super) validation: MeshSet,
    pub(super) shapes: Shapes,
    pub(super) seed: u64,
    /// Pictures of a step.
    pub(super) pictures: usize,
    /// Pictures of a validation.
    pub(super) trials: usize,
    pub(super) device: Device,
}

impl Task for CenterSnapTask {
    type Network = CenterSnapNetwork;
    type Batch = Vec<Example>;

    fn parts(&self) -> &'static [&'static str] {
        &["heat", "latent", "pose", "depth", "segments"]
    }

    fn prepare(&self, step: u64) -> Result<Vec<Example>, TrainError> {
        let example = |slot| {
            let mut rng = stream(self.seed, &format!("train/centersnap/{step}/{slot}"));
            let picture = Picture::draw(&self.meshes, &mut rng)?;
            Ok(Example::new(picture, &self.shapes, &mut rng))
        };
        (0..self.pictures).into_par_iter().map(example).collect()
    }

    fn loss(
        &self,
        network: &CenterSnapNetwork,
        examples: Vec<Example>,
        _step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError> {
        let [loss, parts @ ..] = losses(network, examples, &self.device);
        Ok((loss, parts.to_vec()))
    }

    fn figures(&self) -> Vec<String> {
        figure_names()
    }

    fn validate(&self, network: &CenterSnapNetwork) -> Result<Figures, TrainError> {
        let trial = Trial {
            meshes: &self.validation,
            purpose: "validate/centersnap",
            pictures: self.trials,
        };
        let statistics = self.shapes.statistics.clone();
        let network = network
            .clone()
            .with_statistics(&statistics, &Device::flex());
        evaluate(network, &self.shapes.autoencoder, &trial)
    }
}
