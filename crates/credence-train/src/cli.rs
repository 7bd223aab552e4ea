//! The command line.

use std::{fs, path::Path, process::Command};

use clap::{Parser, Subcommand};
use credence_nn::weights;

use crate::{
    TrainError,
    data::DataCommand,
    metric::{EmbedArgs, SphereArgs},
    query::QueryArgs,
    run::note,
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
    /// The query embedding: an observed cloud in, any point's place in the unit ball out
    Query(QueryArgs),
    /// The seed's metric embedding: a cloud in, a unit vector per point out
    Embed(EmbedArgs),
    /// Unit vectors of unseen objects' points, for the picture of the sphere
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
            Network::Sphere(args) => args.run(),
        }
    }
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
