use credence_nn::NnError;
use credence_types::InvalidInput;
use thiserror::Error;

/// What the embedding refuses. The message names the value and the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EmbedError {
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
    /// Points, a viewpoint or a table height that are not.
    #[error(transparent)]
    Input(#[from] InvalidInput),
    /// Weights that cannot be read, an observation without points, or a failed neighbour search.
    #[error(transparent)]
    Network(#[from] NnError),
}
