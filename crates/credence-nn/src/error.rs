use std::{io, path::PathBuf};

use thiserror::Error;

/// What the layers, the neighbour search and the weight files refuse. The message names the value
/// and the remedy.
#[derive(Debug, Error)]
pub enum NnError {
    /// More neighbours asked for than there are points.
    #[error("{k} nearest of {points} points were asked for; pass at least {k} points")]
    TooFewPoints {
        /// Neighbours asked for.
        k: usize,
        /// Points there are.
        points: usize,
    },
    /// No neighbours asked for.
    #[error("0 nearest points were asked for; k must be at least 1")]
    NoNeighbours,
    /// More points than an index of 32 bits can name.
    #[error("{points} points are too many to index; thin the cloud")]
    TooManyPoints {
        /// Points there are.
        points: usize,
    },
    /// A coordinate that is no number.
    #[error("{name}[{index}] is not finite; remove such points first")]
    NonFinitePoint {
        /// Which array.
        name: &'static str,
        /// Row of the array.
        index: usize,
    },
    /// A list of neighbours that is not k per point.
    #[error("{entries} neighbours are not {k} for every point; pass k >= 1 of each")]
    RaggedNeighbours {
        /// Length of the list.
        entries: usize,
        /// Neighbours of each point.
        k: usize,
    },
    /// A neighbour that is no point.
    #[error("neighbour {neighbour} is not one of {rows} points; number them from 0")]
    NeighbourOutOfRange {
        /// The neighbour's index.
        neighbour: u32,
        /// Points there are.
        rows: usize,
    },
    /// An observation that lacks one of its two clouds.
    #[error("the observation has no {name} points; {remedy}")]
    NoPoints {
        /// Which cloud.
        name: &'static str,
        /// Where such points come from.
        remedy: &'static str,
    },
    /// Nothing to ask a network about.
    #[error("the batch has no observations; pass at least one")]
    EmptyBatch,
    /// Observations that a network cannot be asked about together.
    #[error(
        "observation {index} has {found} queries, the first one has {expected}; a batch needs the \
         same number everywhere"
    )]
    RaggedBatch {
        /// Position in the batch.
        index: usize,
        /// Its queries.
        found: usize,
        /// Queries of the first observation.
        expected: usize,
    },
    /// Values that a device did not hand back.
    #[error("the network's output cannot be read: {why}")]
    Output {
        /// What the device says.
        why: String,
    },
    /// A file that could not be read.
    #[error(
        "cannot read {}: {source}; check the path, or train the network again with \
         `credence-train`",
        path.display()
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        source: io::Error,
    },
    /// A file that could not be written.
    #[error(
        "cannot write {}: {source}; check that the folder exists, may be written and has room",
        path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        source: io::Error,
    },
    /// A file of weights that is gone, or not the one that its provenance tells of.
    #[error(
        "the weights {} are {found}, sha256 {expected} is expected; restore them with `git checkout \
         -- {}`, or train them anew with `{command}`",
        path.display(),
        path.display()
    )]
    Weights {
        /// The file.
        path: PathBuf,
        /// The hash that the provenance names.
        expected: String,
        /// What is there instead.
        found: String,
        /// The command that trained them.
        command: String,
    },
    /// Bytes that are no weight file.
    #[error(
        "{name} is not a whole safetensors file ({why}); fetch it again or train the network anew"
    )]
    Corrupt {
        /// The file's path, or what the bytes are.
        name: String,
        /// What is wrong with it.
        why: String,
    },
    /// The weights of another network.
    #[error("{name} holds the weights of another network: {why}; pass the file of this one")]
    OtherNetwork {
        /// The file's path, or what the bytes are.
        name: String,
        /// The first difference.
        why: String,
    },
    /// A weight that is no number.
    #[error("{name} holds a weight that is not finite in '{tensor}'; train the network anew")]
    NonFiniteWeight {
        /// The file's path, or what the bytes are.
        name: String,
        /// The tensor.
        tensor: String,
    },
    /// A provenance that could not be written down or read.
    #[error("the provenance {} is not valid: {source}", path.display())]
    Provenance {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        source: serde_json::Error,
    },
}
