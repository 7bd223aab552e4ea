use std::path::PathBuf;

use burn::tensor::Device;
use clap::Args;
use credence_nn::{seed_parameters, weights};
use credence_segment::maskrcnn::{Anchors, MaskRcnnNetwork};
use credence_types::stream;

use super::{calibrate::calibrate, evaluate::evaluate, pictures::PictureSet, task::SegmentTask};
use crate::{TrainError, command::RunArgs, run::train};

/// What to train segmentation on, and where to put the weights.
#[derive(Debug, Clone, Args)]
pub struct SegmentArgs {
    /// Folder of training pictures, as `harness training-pictures` renders them
    #[arg(long)]
    pub pictures: PathBuf,
    /// Folder of validation pictures, of none of the same meshes
    #[arg(long)]
    pub validation: PathBuf,
    /// File that the weights are written to
    #[arg(long, default_value = "assets/weights/maskrcnn.safetensors")]
    pub out: PathBuf,
    /// Optimiser steps [default: 6000; 6 with --quick]
    #[arg(long)]
    pub steps: Option<u64>,
    /// Seed of the pictures' order, the augmentation and the first weights
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Folder for checkpoints and logs
    #[arg(long, default_value = "data/checkpoints/segment")]
    pub checkpoints: PathBuf,
    /// A few steps on a few pictures, to see that everything works; the weights are worth nothing
    #[arg(long)]
    pub quick: bool,
}

impl SegmentArgs {
    /// Trains, measures the temperatures and writes the weights.
    ///
    /// # Errors
    /// Pictures that cannot be used, folders that cannot be written, checkpoints of another run, a
    /// loss that diverges.
    pub fn run(&self) -> Result<(), TrainError> {
        let pictures = PictureSet::open(&self.pictures)?;
        let args = RunArgs {
            meshes: self.pictures.clone(),
            validation: self.validation.clone(),
            out: self.out.clone(),
            scenes: Some(pictures.len()),
            seed: self.seed,
            checkpoints: Some(self.checkpoints.clone()),
            cache: PathBuf::new(),
            quick: self.quick,
        };
        let run = args.begin("segment", self.steps.unwrap_or(args.pick(6000, 6)))?;
        let run = run.on_folders_of(["pictures", "validation_pictures"]);
        let device = Device::flex().autodiff();
        let task = SegmentTask {
            pictures,
            validation: PictureSet::open(&self.validation)?,
            seed: self.seed,
            batch: args.pick(8, 2) as usize,
            trials: args.pick(150, 4) as usize,
            anchors: Anchors::new(),
            device: device.clone(),
        };
        let network = MaskRcnnNetwork::new(&device);
        let network = seed_parameters(network, &mut stream(self.seed, "train/segment/weights"));
        let mut outcome = train(&task, network, &run.plan(1000))?;
        // What is shipped is what is measured: in half precision.
        let all = args.pick(task.validation.len() as u64, 4) as usize;
        let (network, figures) = calibrate(&halved(&outcome.network)?, &task.validation, all)?;
        outcome.network = halved(&network)?;
        outcome.figures = evaluate(&outcome.network, &task.validation, all)?;
        outcome.figures.extend(figures);
        let bytes = weights::to_half_bytes(&outcome.network)?;
        let mut data = vec![("validation_picture_count_used".to_owned(), all.to_string())];
        for (folder, set) in [
            ("pictures", &task.pictures),
            ("validation_pictures", &task.validation),
        ] {
            let rows = set.description().into_iter();
            data.extend(rows.map(|(key, value)| (format!("{folder}_{key}"), value)));
        }
        run.finish_with(outcome, &bytes, data)
    }
}

/// The network as a file in half precision gives it back.
fn halved(network: &MaskRcnnNetwork) -> Result<MaskRcnnNetwork, TrainError> {
    let bytes = weights::to_half_bytes(network)?;
    let empty = MaskRcnnNetwork::new(&Device::flex());
    Ok(weights::from_bytes(empty, bytes, "these weights")?)
}
