use std::path::PathBuf;

use burn::tensor::Device;
use clap::Args;
use credence_embed::{
    MetricEmbedder,
    metric::{CLOUD_POINTS, MetricNetwork, MetricWidths},
};
use credence_nn::seed_parameters;
use credence_types::stream;

use super::{
    evaluate::{evaluate, write_table},
    task::MetricTask,
};
use crate::{
    TrainError,
    cli::at_least_one,
    command::{RunArgs, VALIDATION_SCENES, VALIDATION_SEED, open_scenes, show},
    run::train,
};

/// Clouds of a step.
const CLOUDS: usize = 8;

/// What to train the seed's metric embedding on, and where to put it.
#[derive(Debug, Clone, Args)]
pub struct EmbedArgs {
    /// The run.
    #[command(flatten)]
    pub run: RunArgs,
    /// Optimiser steps of 8 clouds; by default every scene is seen once [10 with --quick]
    #[arg(long)]
    pub steps: Option<u64>,
}

impl EmbedArgs {
    /// Trains and writes the weights.
    ///
    /// # Errors
    /// Meshes that cannot be used, folders that cannot be written, checkpoints of another run, a
    /// loss that diverges.
    pub fn run(&self) -> Result<(), TrainError> {
        let args = &self.run;
        let once = args.scene_count().div_ceil(CLOUDS) as u64;
        let run = args.begin("embed", self.steps.unwrap_or(args.pick(once, 10)))?;
        let device = Device::flex().autodiff();
        let task = MetricTask {
            scenes: run.training()?,
            validation: run.validation()?,
            seed: args.seed,
            clouds: CLOUDS,
            scored: CLOUD_POINTS / 4,
        };
        let network = MetricNetwork::new(&MetricWidths::default(), &device);
        let network = seed_parameters(network, &mut stream(args.seed, "train/metric/weights"));
        let outcome = train(&task, network, &run.plan(750))?;
        run.finish(outcome, &task.validation)
    }
}

/// Embed the points of unseen objects and write the unit vectors, for the picture of the sphere.
///
/// The table's rows are the learned directions of the categories and a sample of every category's
/// points: kind, category and the vector.
#[derive(Debug, Clone, Args)]
pub struct SphereArgs {
    /// Weights, as `credence-train embed` writes them; those that are built in by default
    #[arg(long)]
    pub weights: Option<PathBuf>,
    /// Folder of meshes that the network was not trained on
    #[arg(long)]
    pub validation: PathBuf,
    /// File that the table is written to, as CSV
    #[arg(long)]
    pub out: PathBuf,
    /// Scenes to generate
    #[arg(long, default_value_t = VALIDATION_SCENES)]
    pub scenes: usize,
    /// Most points per category in the table
    #[arg(long, default_value_t = 1000)]
    pub points: usize,
    /// Folder for generated scenes
    #[arg(long, default_value = "data/cache")]
    pub cache: PathBuf,
}

impl SphereArgs {
    /// Evaluates the network and writes the table.
    ///
    /// # Errors
    /// Weights or meshes that cannot be used, folders that cannot be written.
    pub fn run(&self) -> Result<(), TrainError> {
        at_least_one("scenes", self.scenes as u64)?;
        let embedder = match &self.weights {
            Some(path) => MetricEmbedder::from_file(path)?,
            None => MetricEmbedder::embedded()?,
        };
        let folder = self.cache.join("validation");
        let scenes = open_scenes(&folder, &self.validation, self.scenes, VALIDATION_SEED)?;
        let evaluated = evaluate(&embedder, &scenes)?;
        write_table(&evaluated, self.points, &self.out)?;
        show(&evaluated.figures());
        Ok(())
    }
}
