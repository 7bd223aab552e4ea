//! What the commands that train a network share.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use burn::module::Module;
use clap::Args;
use credence_nn::{Provenance, weights};

use crate::{
    TrainError,
    cli::{at_least_one, command_line, git_revision, keep_curve, ready},
    data::{MeshSet, SceneCache},
    run::{Figures, Outcome, Plan, Schedule, note},
};

/// Validation scenes.
pub(crate) const VALIDATION_SCENES: usize = 200;

/// Seed of the validation scenes: the same whatever the run's seed, so that runs compare.
pub(crate) const VALIDATION_SEED: u64 = 1;

/// What to train on, and where to put the weights.
#[derive(Debug, Clone, Args)]
pub struct RunArgs {
    /// Folder of training meshes with their MANIFEST.json
    #[arg(long)]
    pub meshes: PathBuf,
    /// Folder of validation meshes, none of them among the training meshes
    #[arg(long)]
    pub validation: PathBuf,
    /// File that the weights are written to
    #[arg(long)]
    pub out: PathBuf,
    /// Training scenes to generate [default: 30000; 60 with --quick]
    #[arg(long)]
    pub scenes: Option<usize>,
    /// Seed of the scenes, their order, the augmentation and the first weights
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Folder for checkpoints and logs [default: data/checkpoints/ and the command's name]
    #[arg(long)]
    pub checkpoints: Option<PathBuf>,
    /// Folder for generated scenes
    #[arg(long, default_value = "data/cache")]
    pub cache: PathBuf,
    /// A few steps on a few scenes, to see that everything works; the weights are worth nothing
    #[arg(long)]
    pub quick: bool,
}

/// A run whose options have been found sound.
pub(crate) struct Run<'a> {
    args: &'a RunArgs,
    name: &'static str,
    steps: u64,
    /// Of the source that trains: hours later the checkout may have moved on.
    git_revision: Option<String>,
    /// What the folders are of, as the provenance names them.
    folders: [&'static str; 2],
}

impl RunArgs {
    /// One value for a run of worth, another for a quick one.
    pub(crate) const fn pick(&self, full: u64, quick: u64) -> u64 {
        if self.quick { quick } else { full }
    }

    /// Number of training scenes.
    pub(crate) fn scene_count(&self) -> usize {
        self.scenes.unwrap_or(self.pick(30_000, 60) as usize)
    }

    /// Checks what would otherwise fail after hours.
    ///
    /// # Errors
    /// No scenes, no steps, weights that could not be written.
    pub(crate) fn begin(&self, name: &'static str, steps: u64) -> Result<Run<'_>, TrainError> {
        at_least_one("scenes", self.scene_count() as u64)?;
        at_least_one("steps", steps)?;
        ready(&self.out)?;
        Ok(Run {
            args: self,
            name,
            steps,
            git_revision: git_revision(),
            folders: ["meshes", "validation_meshes"],
        })
    }
}

impl Run<'_> {
    /// The same where the folders hold something else than meshes.
    pub(crate) const fn on_folders_of(mut self, names: [&'static str; 2]) -> Self {
        self.folders = names;
        self
    }

    /// The scenes to train on.
    pub(crate) fn training(&self) -> Result<SceneCache, TrainError> {
        let args = self.args;
        self.scenes("train", &args.meshes, args.scene_count(), args.seed)
    }

    /// The scenes to validate on.
    pub(crate) fn validation(&self) -> Result<SceneCache, TrainError> {
        let count = self.args.pick(VALIDATION_SCENES as u64, 12) as usize;
        self.scenes("validation", &self.args.validation, count, VALIDATION_SEED)
    }

    fn scenes(
        &self,
        split: &str,
        meshes: &Path,
        count: usize,
        seed: u64,
    ) -> Result<SceneCache, TrainError> {
        let suffix = if self.args.quick { "-quick" } else { "" };
        let folder = self.args.cache.join(format!("{split}{suffix}"));
        open_scenes(&folder, meshes, count, seed)
    }

    /// How the run proceeds.
    pub(crate) fn plan(&self, validate_every: u64) -> Plan {
        let args = self.args;
        let default = || Path::new("data/checkpoints").join(self.name);
        Plan {
            schedule: Schedule {
                steps: self.steps,
                warm_up: args.pick(100, 5).min(self.steps),
                peak: 2e-3,
                last: 1e-5,
            },
            weight_decay: 1e-4,
            clip: 1.0,
            log_every: args.pick(20, 5),
            checkpoint_every: args.pick(500, 5),
            validate_every: args.pick(validate_every, 20),
            folder: args.checkpoints.clone().unwrap_or_else(default),
            run: format!(
                "{}, seed {}, {} steps, {} scenes of {}{}",
                self.name,
                args.seed,
                self.steps,
                args.scene_count(),
                args.meshes.display(),
                if args.quick { ", quick" } else { "" }
            ),
        }
    }

    /// Writes the weights, and beside them the curve of the loss and where they come from.
    pub(crate) fn finish<N: Module>(
        self,
        outcome: Outcome<N>,
        validation: &SceneCache,
    ) -> Result<(), TrainError> {
        let bytes = weights::to_bytes(&outcome.network)?;
        let data = [
            ("scenes", self.args.scene_count()),
            ("validation_scenes", validation.len()),
        ];
        self.finish_with(outcome, &bytes, text(data))
    }

    /// The same with the weights' bytes as given, and what is to be said of what was trained and
    /// validated on.
    pub(crate) fn finish_with<N: Module>(
        self,
        outcome: Outcome<N>,
        bytes: &[u8],
        data: impl IntoIterator<Item = (String, String)>,
    ) -> Result<(), TrainError> {
        let args = self.args;
        weights::write_file(&args.out, bytes)?;
        let mut data: BTreeMap<String, String> = data.into_iter().collect();
        for (key, folder) in self.folders.iter().zip([&args.meshes, &args.validation]) {
            data.insert((*key).to_owned(), folder.display().to_string());
        }
        let provenance = Provenance {
            command: command_line(),
            seed: args.seed,
            git_revision: self.git_revision,
            steps: self.steps,
            parameters: outcome.network.num_params() as u64,
            data,
            loss_curve: keep_curve(&outcome.loss_curve, &args.out)?,
            figures: outcome.figures,
            sha256: None,
        };
        provenance.save(&args.out)?;
        show(&provenance.figures);
        Ok(())
    }
}

/// Named numbers as a provenance's data.
pub(crate) fn text<const N: usize>(numbers: [(&str, usize); N]) -> [(String, String); N] {
    numbers.map(|(key, number)| (key.to_owned(), number.to_string()))
}

/// Opens a folder of scenes, with those that are missing generated first.
pub(crate) fn open_scenes(
    folder: &Path,
    meshes: &Path,
    count: usize,
    seed: u64,
) -> Result<SceneCache, TrainError> {
    let meshes = MeshSet::open(meshes)?;
    let folder_name = folder.display();
    note(&format!(
        "{count} scenes of {} meshes in {folder_name}",
        meshes.len()
    ));
    let progress = |done: usize| {
        if done.is_multiple_of(1000) {
            note(&format!("{folder_name}: {done}/{count} scenes"));
        }
    };
    SceneCache::open_or_generate(folder, &meshes, count, seed, &progress)
}

/// Prints figures.
pub(crate) fn show(figures: &Figures) {
    for (name, value) in figures {
        note(&format!("{name:>32} {value:.4}"));
    }
}
