use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::{autoencoder, centersnap, cloud};
use crate::{TrainError, command::RunArgs};

/// What to train the completers on, and where to put them.
#[derive(Debug, Clone, Args)]
pub struct CompleteArgs {
    /// Which networks
    #[arg(long, value_enum, default_value_t = Part::All)]
    pub part: Part,
    /// Folder of training meshes with their MANIFEST.json
    #[arg(long)]
    pub meshes: PathBuf,
    /// Folder of validation meshes, none of them among the training meshes
    #[arg(long)]
    pub validation: PathBuf,
    /// Folder that the weights are written to
    #[arg(long, default_value = "assets/weights")]
    pub out: PathBuf,
    /// Optimiser steps of each network [default: each network's own; 40 with --quick]
    #[arg(long)]
    pub steps: Option<u64>,
    /// Training scenes to generate [default: 30000; 60 with --quick]
    #[arg(long)]
    pub scenes: Option<usize>,
    /// Seed of the scenes, their order, the augmentation and the first weights
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Folder for checkpoints and logs, one folder per network in it
    #[arg(long, default_value = "data/checkpoints")]
    pub checkpoints: PathBuf,
    /// Folder for generated scenes
    #[arg(long, default_value = "data/cache")]
    pub cache: PathBuf,
    /// A few steps on a few scenes, to see that everything works; the weights are worth nothing
    #[arg(long)]
    pub quick: bool,
}

/// The networks of shape completion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// All of them, one after the other
    All,
    /// The completer of a segmented partial cloud
    Cloud,
    /// Shapes as numbers and back, for `CenterSnap`
    Autoencoder,
    /// `CenterSnap`'s network, by the auto-encoder's weights in the folder that it writes to
    Centersnap,
}

impl CompleteArgs {
    /// Trains and writes the weights.
    ///
    /// # Errors
    /// Meshes that cannot be used, folders that cannot be written, checkpoints of another run, a
    /// loss that diverges.
    pub fn run(&self) -> Result<(), TrainError> {
        if matches!(self.part, Part::All | Part::Cloud) {
            cloud::run(&self.of("cloud"), self.steps)?;
        }
        if matches!(self.part, Part::All | Part::Autoencoder) {
            autoencoder::run(&self.of("autoencoder"), self.steps)?;
        }
        if matches!(self.part, Part::All | Part::Centersnap) {
            centersnap::run(&self.of("centersnap"), self.steps)?;
        }
        Ok(())
    }

    /// The run of one network.
    fn of(&self, name: &str) -> RunArgs {
        RunArgs {
            meshes: self.meshes.clone(),
            validation: self.validation.clone(),
            out: self.out.join(Path::new(name).with_extension("safetensors")),
            scenes: self.scenes,
            seed: self.seed,
            checkpoints: Some(self.checkpoints.join(name)),
            cache: self.cache.clone(),
            quick: self.quick,
        }
    }
}
