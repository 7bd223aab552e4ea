use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use burn::{module::Module as _, tensor::Device};
use clap::Args;
use credence_embed::{
    MetricEmbedder,
    metric::{CLOUD_POINTS, MetricNetwork, MetricWidths},
};
use credence_nn::{Provenance, seed_parameters, weights};
use credence_types::stream;

use super::{
    evaluate::{evaluate, write_table},
    task::MetricTask,
};
use crate::{
    TrainError,
    cli::{at_least_one, command_line, git_revision, keep_curve, ready},
    data::{MeshSet, SceneCache},
    run::{Figures, Plan, Schedule, note, train},
};

/// Validation scenes.
const VALIDATION_SCENES: usize = 200;

/// Seed of the validation scenes: the same whatever the run's seed, so that runs compare.
const VALIDATION_SEED: u64 = 1;

/// Clouds of a step.
const CLOUDS: usize = 8;

/// Train the seed's metric embedding: a cloud in, a unit vector per point out.
///
/// Scenes are generated from the meshes on the first run and cached; `credence-train query` uses
/// the same. The run may be stopped at any time (Ctrl-C): the same command resumes it from its
/// newest checkpoint and ends with the same weights. Beside the weights it writes their provenance
/// (.json) and the curve of the loss (.csv).
#[derive(Debug, Clone, Args)]
pub struct EmbedArgs {
    /// Folder of training meshes with their MANIFEST.json
    #[arg(long)]
    pub meshes: PathBuf,
    /// Folder of validation meshes, none of them among the training meshes
    #[arg(long)]
    pub validation: PathBuf,
    /// File that the weights are written to
    #[arg(long)]
    pub out: PathBuf,
    /// Training scenes to generate
    #[arg(long)]
    pub scenes: Option<usize>,
    /// Optimiser steps of 8 clouds; by default every scene is seen once
    #[arg(long)]
    pub steps: Option<u64>,
    /// Seed of the scenes, the augmentation and the first weights
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Folder for checkpoints and logs
    #[arg(long, default_value = "data/checkpoints/embed")]
    pub checkpoints: PathBuf,
    /// Folder for generated scenes
    #[arg(long, default_value = "data/cache")]
    pub cache: PathBuf,
    /// A few steps on a few scenes, to see that everything works; the weights are worth nothing
    #[arg(long)]
    pub quick: bool,
}

impl EmbedArgs {
    /// Trains and writes the weights.
    ///
    /// # Errors
    /// Meshes that cannot be used, folders that cannot be written, checkpoints of another run, a
    /// loss that diverges.
    pub fn run(&self) -> Result<(), TrainError> {
        let scenes = self.scenes.unwrap_or(if self.quick { 60 } else { 30_000 });
        let once = scenes.div_ceil(CLOUDS) as u64;
        let steps = self.steps.unwrap_or(if self.quick { 10 } else { once });
        at_least_one("scenes", scenes as u64)?;
        at_least_one("steps", steps)?;
        ready(&self.out)?;
        // Of the source that trains: hours later the checkout may have moved on.
        let git_revision = git_revision();
        let device = Device::flex().autodiff();
        let task = MetricTask {
            scenes: self.scenes_of("train", &self.meshes, scenes, self.seed)?,
            validation: self.scenes_of(
                "validation",
                &self.validation,
                if self.quick { 12 } else { VALIDATION_SCENES },
                VALIDATION_SEED,
            )?,
            seed: self.seed,
            clouds: CLOUDS,
            scored: CLOUD_POINTS / 4,
        };
        let network = MetricNetwork::new(&MetricWidths::default(), &device);
        let network = seed_parameters(network, &mut stream(self.seed, "train/metric/weights"));
        let outcome = train(&task, network, &self.plan(steps, scenes))?;
        weights::save(&outcome.network, &self.out)?;
        let curve = keep_curve(&outcome.loss_curve, &self.out)?;
        let validation_scenes = task.validation.len().to_string();
        let provenance = Provenance {
            command: command_line(),
            seed: self.seed,
            git_revision,
            steps,
            parameters: outcome.network.num_params() as u64,
            data: BTreeMap::from([
                ("scenes".to_owned(), scenes.to_string()),
                ("meshes".to_owned(), self.meshes.display().to_string()),
                ("validation_scenes".to_owned(), validation_scenes),
                (
                    "validation_meshes".to_owned(),
                    self.validation.display().to_string(),
                ),
            ]),
            loss_curve: curve,
            figures: outcome.figures,
        };
        provenance.save(&self.out)?;
        show(&provenance.figures);
        Ok(())
    }

    fn scenes_of(
        &self,
        split: &str,
        meshes: &Path,
        count: usize,
        seed: u64,
    ) -> Result<SceneCache, TrainError> {
        let suffix = if self.quick { "-quick" } else { "" };
        open_scenes(
            &self.cache.join(format!("{split}{suffix}")),
            meshes,
            count,
            seed,
        )
    }

    fn plan(&self, steps: u64, scenes: usize) -> Plan {
        let every = |full, quick| if self.quick { quick } else { full };
        Plan {
            schedule: Schedule {
                steps,
                warm_up: every(100, 2).min(steps),
                peak: 2e-3,
                last: 1e-5,
            },
            weight_decay: 1e-4,
            clip: 1.0,
            log_every: every(20, 5),
            checkpoint_every: every(500, 5),
            validate_every: every(750, 5),
            folder: self.checkpoints.clone(),
            run: format!(
                "embed, seed {}, {steps} steps, {scenes} scenes of {}{}",
                self.seed,
                self.meshes.display(),
                if self.quick { ", quick" } else { "" }
            ),
        }
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

fn open_scenes(
    folder: &Path,
    meshes: &Path,
    count: usize,
    seed: u64,
) -> Result<SceneCache, TrainError> {
    let meshes = MeshSet::open(meshes)?;
    note(&format!(
        "{count} scenes of {} meshes in {}",
        meshes.len(),
        folder.display()
    ));
    let progress = |done: usize| {
        if done.is_multiple_of(1000) {
            note(&format!("{done}/{count} scenes"));
        }
    };
    SceneCache::open_or_generate(folder, &meshes, count, seed, &progress)
}

fn show(figures: &Figures) {
    for (name, value) in figures {
        note(&format!("{name:>32} {value:.4}"));
    }
}
