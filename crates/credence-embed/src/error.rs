use credence_nn::NnError;
use thiserror::Error;

/// What the embedding refuses. The message names the value and the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EmbedError {
    /// An observation that lacks one of its two clouds.
    #[error("the observation has no {name} points; {remedy}")]
    NoPoints {
        /// Which cloud.
        name: &'static str,
        /// Where such points come from.
        remedy: &'static str,
    },
    /// A coordinate that is no number.
    #[error("{name}[{index}] is not finite; remove such points first")]
    NonFinitePoint {
        /// Which array.
        name: &'static str,
        /// Row of the array.
        index: usize,
    },
    /// A table height that is no number.
    #[error("table_height_m is {value}; give the table's height in world metres")]
    TableHeight {
        /// The offending value.
        value: f64,
    },
    /// Nothing to embed.
    #[error("the batch has no observations; pass at least one")]
    EmptyBatch,
    /// Observations that cannot be embedded together.
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
    /// Clouds that cannot be embedded together.
    #[error(
        "a cloud has {other} points, the first one has {first}; a batch needs the same number \
         everywhere"
    )]
    UnequalClouds {
        /// Points of the first cloud.
        first: usize,
        /// Points of the one that differs.
        other: usize,
    },
    /// Weights that cannot be read, or a failed neighbour search.
    #[error(transparent)]
    Network(#[from] NnError),
    /// Values that a device did not hand back.
    #[error("the network's output cannot be read: {why}")]
    Output {
        /// What the device says.
        why: String,
    },
}
