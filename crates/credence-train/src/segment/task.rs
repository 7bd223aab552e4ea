use burn::tensor::{Device, Tensor};
use credence_segment::maskrcnn::{Anchors, ImageRows, MaskRcnnNetwork};
use credence_types::stream;
use rand::RngExt as _;
use rayon::prelude::*;

use super::{
    augment::vary,
    evaluate::{evaluate, figure_names},
    losses::{Example, losses},
    pictures::PictureSet,
    truth::truths,
};
use crate::{
    TrainError,
    run::{Figures, Task},
};

/// Mask R-CNN on rendered pictures; every other one has its depth withheld, so that the network
/// serves with and without.
pub(super) struct SegmentTask {
    pub(super) pictures: PictureSet,
    pub(super) validation: PictureSet,
    pub(super) seed: u64,
    /// Pictures of a step.
    pub(super) batch: usize,
    /// Pictures of a validation.
    pub(super) trials: usize,
    pub(super) anchors: Anchors,
    pub(super) device: Device,
}

impl Task for SegmentTask {
    type Network = MaskRcnnNetwork;
    type Batch = Vec<Example>;

    fn parts(&self) -> &'static [&'static str] {
        &["objectness", "proposal", "class", "box", "mask"]
    }

    fn prepare(&self, step: u64) -> Result<Vec<Example>, TrainError> {
        let example = |slot| {
            let mut rng = stream(self.seed, &format!("train/segment/{step}/{slot}"));
            let index = rng.random_range(0..self.pictures.len());
            let picture = vary(self.pictures.get(index)?, &mut rng);
            Ok(Example {
                truths: truths(&picture),
                rows: ImageRows::new(&picture.image, slot % 2 == 0),
                owners: picture.owners,
            })
        };
        (0..self.batch).into_par_iter().map(example).collect()
    }

    fn loss(
        &self,
        network: &MaskRcnnNetwork,
        examples: Vec<Example>,
        step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError> {
        let draw = (self.seed, step);
        let [loss, parts @ ..] = losses(network, &self.anchors, examples, draw, &self.device)?;
        Ok((loss, parts.to_vec()))
    }

    fn figures(&self) -> Vec<String> {
        figure_names()
    }

    fn validate(&self, network: &MaskRcnnNetwork) -> Result<Figures, TrainError> {
        evaluate(network, &self.validation, self.trials)
    }
}
