//! The command line.

use std::{fs, io, path::Path, process::Command};

use clap::{Parser, Subcommand};
use credence_nn::weights;

use crate::{
    TrainError,
    complete::CompleteArgs,
    data::DataCommand,
    metric::{EmbedArgs, SphereArgs},
    query::QueryArgs,
    run::note,
    segment::SegmentArgs,
};

/// Trains Credence's networks; every run is repeatable, resumable, and says where its weights came
/// from.
#[derive(Debug, Parser)]
#[command(name = "credence-train", version)]
pub struct Cli {
    /// What to train
    #[command(subcommand)]
    pub network: Network,
}

/// The networks.
#[derive(Debug, Subcommand)]
pub enum Network {
    /// Training scenes in advance; a training run makes those that it lacks itself
    Data(DataCommand),
    /// Train the query embedding: an observed cloud in, any point's place in the unit ball out
    ///
    /// Scenes are generated from the meshes on the first run and cached. The run may be stopped at
    /// any time (Ctrl-C): the same command resumes it from its newest checkpoint and ends with the
    /// same weights. Beside the weights it writes their provenance (.json) and the curve of the
    /// loss (.loss.csv).
    ///
    /// Make the meshes with `harness assets --split train --out data/meshes/train` and `harness
    /// assets --split validation --out data/meshes/validation`.
    Query(QueryArgs),
    /// Train the seed's metric embedding: a cloud in, a unit vector per point out
    ///
    /// Scenes are generated from the meshes on the first run and cached; `credence-train query`
    /// uses the same. The run may be stopped at any time (Ctrl-C): the same command resumes it from
    /// its newest checkpoint and ends with the same weights. Beside the weights it writes their
    /// provenance (.json) and the curve of the loss (.loss.csv).
    Embed(EmbedArgs),
    /// Train the shape completers: what a frame shows of an object in, its whole surface out
    ///
    /// Scenes are generated from the meshes on the first run and cached; `credence-train query`
    /// uses the same. The run may be stopped at any time (Ctrl-C): the same command resumes it from
    /// its newest checkpoint and ends with the same weights. Beside each file of weights it writes
    /// their provenance (.json) and the curve of the loss (.loss.csv).
    Complete(CompleteArgs),
    /// Train instance segmentation: a picture in, the masks and classes of its objects out
    ///
    /// Render the pictures with `harness training-pictures --objects data/meshes/train --out
    /// data/pictures/train`, and those of data/meshes/validation likewise. The run may be stopped at
    /// any time (Ctrl-C): the same command resumes it from its newest checkpoint and ends with the
    /// same weights. Beside the weights it writes their provenance (.json) and the curve of the
    /// loss (.loss.csv).
    Segment(SegmentArgs),
    /// Embed the points of unseen objects and write the unit vectors, for the picture of the sphere
    ///
    /// The table's rows are the learned directions of the categories and a sample of every
    /// category's points: kind, category and the vector.
    Sphere(SphereArgs),
}

impl Cli {
    /// Does what the command line says.
    ///
    /// # Errors
    /// Whatever the training cannot work with.
    pub fn run(&self) -> Result<(), TrainError> {
        match &self.network {
            Network::Data(args) => args.run(&note),
            Network::Query(args) => args.run(),
            Network::Embed(args) => args.run(),
            Network::Complete(args) => args.run(),
            Network::Segment(args) => args.run(),
            Network::Sphere(args) => args.run(),
        }
    }
}

/// Refuses a count of nothing.
pub(crate) fn at_least_one(option: &'static str, value: u64) -> Result<(), TrainError> {
    let least = 1;
    if value < least {
        return Err(TrainError::Option {
            option,
            value,
            least,
        });
    }
    Ok(())
}

/// The command as it was typed, for the provenance.
pub(crate) fn command_line() -> String {
    let words: Vec<String> = std::env::args().skip(1).collect();
    format!("credence-train {}", words.join(" "))
}

/// The revision of the source, where the training runs in a checkout.
pub(crate) fn git_revision() -> Option<String> {
    let output = Command::new("git")
        .args(["rev-parse", "HEAD"])
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.is_empty()).then(|| text.trim().to_owned())
}

/// Makes the folder of a file that is written at the end of a long run, and tries to write there:
/// better now than then.
pub(crate) fn ready(out: &Path) -> Result<(), TrainError> {
    let parent = out.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = parent.unwrap_or_else(|| Path::new("."));
    let refused = |source| TrainError::Write {
        path: out.to_path_buf(),
        source,
    };
    if out.file_name().is_none() || out.is_dir() {
        return Err(refused(io::Error::from(io::ErrorKind::IsADirectory)));
    }
    fs::create_dir_all(folder).map_err(refused)?;
    tempfile::tempfile_in(folder).map_err(refused)?;
    Ok(())
}

/// Copies the curve of the loss beside the weights; returns the copy's name.
pub(crate) fn keep_curve(curve: &Path, out: &Path) -> Result<String, TrainError> {
    let text = fs::read(curve).map_err(|source| TrainError::Read {
        path: curve.to_path_buf(),
        source,
    })?;
    let copy = out.with_extension("loss.csv");
    weights::write_file(&copy, &text)?;
    Ok(copy
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned()))
}
