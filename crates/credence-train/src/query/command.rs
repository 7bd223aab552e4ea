use std::{collections::BTreeMap, path::PathBuf};

use burn::{module::Module as _, tensor::Device};
use clap::Args;
use credence_embed::query::{QueryNetwork, Widths};
use credence_nn::{Provenance, seed_parameters, weights};
use credence_types::stream;

use super::QueryTask;
use crate::{
    TrainError,
    cli::{at_least_one, command_line, git_revision, keep_curve, ready},
    data::{MeshSet, SceneCache},
    run::{Plan, Schedule, note, train},
};

/// Validation scenes.
const VALIDATION_SCENES: usize = 200;

/// Seed of the validation scenes: the same whatever the run's seed, so that runs compare.
const VALIDATION_SEED: u64 = 1;

/// What to train the query embedding on, and where to put it.
#[derive(Debug, Clone, Args)]
pub struct QueryArgs {
    /// Folder of training meshes with their MANIFEST.json
    #[arg(long)]
    pub meshes: PathBuf,
    /// Folder of validation meshes, none of them among the training meshes
    #[arg(long)]
    pub validation: PathBuf,
    /// File that the weights are written to
    #[arg(long)]
    pub out: PathBuf,
    /// Optimiser steps; more is better, slowly: 10,000 take about half an hour on two cores [default:
    /// 10000; 40 with --quick]
    #[arg(long)]
    pub steps: Option<u64>,
    /// Training scenes to generate [default: 30000; 60 with --quick]
    #[arg(long)]
    pub scenes: Option<usize>,
    /// Seed of the scenes, their order, the augmentation and the first weights
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Folder for checkpoints and logs
    #[arg(long, default_value = "data/checkpoints/query")]
    pub checkpoints: PathBuf,
    /// Folder for generated scenes
    #[arg(long, default_value = "data/cache")]
    pub cache: PathBuf,
    /// A few steps on a few scenes, to see that everything works; the weights are worth nothing
    #[arg(long)]
    pub quick: bool,
}

impl QueryArgs {
    /// Trains and writes the weights.
    ///
    /// # Errors
    /// Meshes that cannot be used, folders that cannot be written, checkpoints of another run, a
    /// loss that diverges.
    pub fn run(&self) -> Result<(), TrainError> {
        let (steps, scenes) = if self.quick {
            (40, 60)
        } else {
            (10_000, 30_000)
        };
        let steps = self.steps.unwrap_or(steps);
        let scenes = self.scenes.unwrap_or(scenes);
        at_least_one("scenes", scenes as u64)?;
        at_least_one("steps", steps)?;
        ready(&self.out)?;
        // Of the source that trains: hours later the checkout may have moved on.
        let git_revision = git_revision();
        let device = Device::flex().autodiff();
        let task = QueryTask {
            scenes: self.scenes_of("train", &self.meshes, scenes, self.seed)?,
            validation: self.scenes_of(
                "validation",
                &self.validation,
                if self.quick { 12 } else { VALIDATION_SCENES },
                VALIDATION_SEED,
            )?,
            seed: self.seed,
            observations: if self.quick { 4 } else { 24 },
            queries: 256,
            device: device.clone(),
        };
        let network = QueryNetwork::new(Widths::default(), &device);
        let network = seed_parameters(network, &mut stream(self.seed, "train/query/weights"));
        let outcome = train(&task, network, &self.plan(steps, scenes))?;
        weights::save(&outcome.network, &self.out)?;
        let curve = keep_curve(&outcome.loss_curve, &self.out)?;
        let provenance = Provenance {
            command: command_line(),
            seed: self.seed,
            git_revision,
            steps,
            parameters: outcome.network.num_params() as u64,
            data: BTreeMap::from([
                ("scenes".to_owned(), scenes.to_string()),
                ("meshes".to_owned(), self.meshes.display().to_string()),
                (
                    "validation_scenes".to_owned(),
                    task.validation.len().to_string(),
                ),
                (
                    "validation_meshes".to_owned(),
                    self.validation.display().to_string(),
                ),
            ]),
            loss_curve: curve,
            figures: outcome.figures,
        };
        provenance.save(&self.out)?;
        for (name, value) in &provenance.figures {
            note(&format!("{name:>18} {value:.4}"));
        }
        Ok(())
    }

    fn scenes_of(
        &self,
        split: &str,
        meshes: &std::path::Path,
        count: usize,
        seed: u64,
    ) -> Result<SceneCache, TrainError> {
        let folder = self.cache.join(if self.quick {
            format!("{split}-quick")
        } else {
            split.to_owned()
        });
        let meshes = MeshSet::open(meshes)?;
        note(&format!(
            "{split}: {count} scenes of {} meshes in {}",
            meshes.len(),
            folder.display()
        ));
        let progress = |done: usize| {
            if done.is_multiple_of(1000) {
                note(&format!("{split}: {done}/{count} scenes"));
            }
        };
        SceneCache::open_or_generate(&folder, &meshes, count, seed, &progress)
    }

    fn plan(&self, steps: u64, scenes: usize) -> Plan {
        let every = |full, quick| if self.quick { quick } else { full };
        Plan {
            schedule: Schedule {
                steps,
                warm_up: every(100, 10).min(steps),
                peak: 2e-3,
                last: 1e-5,
            },
            weight_decay: 1e-4,
            clip: 1.0,
            log_every: every(20, 5),
            checkpoint_every: every(500, 20),
            validate_every: every(1000, 20),
            folder: self.checkpoints.clone(),
            run: format!(
                "query, seed {}, {steps} steps, {scenes} scenes of {}{}",
                self.seed,
                self.meshes.display(),
                if self.quick { ", quick" } else { "" }
            ),
        }
    }
}
