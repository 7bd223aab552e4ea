use credence_nn::NnError;
use credence_types::InvalidInput;
use thiserror::Error;

/// What shape completion refuses. The message names the value and the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CompleteError {
    /// A number of masks or a size of masks that does not fit the frame, or points that are not.
    #[error(transparent)]
    Input(#[from] InvalidInput),
    /// Weights that cannot be read, or a failed neighbour search.
    #[error(transparent)]
    Network(#[from] NnError),
    /// A completer from outside that failed or broke its protocol.
    #[error("the completer {name} {why}")]
    Foreign {
        /// Its name.
        name: String,
        /// What it did, and the remedy.
        why: String,
        /// The failure in its own language.
        #[source]
        source: Option<Box<dyn std::error::Error + Send + Sync>>,
    },
    /// A completer that forgot instances or made some up.
    #[error("the completer gave {found} answers; {expected} instances need one each")]
    Count {
        /// Answers given.
        found: usize,
        /// Instances asked about.
        expected: usize,
    },
    /// More points than a search can hold.
    #[error("{count} points are more than a neighbour search can hold; pass fewer")]
    TooManyPoints {
        /// Points given.
        count: usize,
    },
    /// A vertical that points nowhere.
    #[error("the vertical {value:?} has no direction; pass the world's z axis in the camera frame")]
    Vertical {
        /// The vector.
        value: [f64; 3],
    },
}
