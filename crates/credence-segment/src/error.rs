use credence_nn::NnError;
use credence_types::InvalidInput;
use thiserror::Error;

/// What segmentation refuses. The message names the value and the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SegmentError {
    /// Masks or scores that are none.
    #[error(transparent)]
    Input(#[from] InvalidInput),
    /// Weights that cannot be read.
    #[error(transparent)]
    Network(#[from] NnError),
    /// Weights with a temperature that makes no probabilities.
    #[error(
        "{name} has a temperature of {value}; it must be positive: train the network again with \
         `credence-train segment`"
    )]
    Temperature {
        /// The file.
        name: String,
        /// The offending value.
        value: f32,
    },
    /// A frame without true masks for the segmenter that delivers them.
    #[error(
        "segmenter = \"oracle\" needs true masks: pass instance_ids and categories with the \
         frame, or choose another segmenter"
    )]
    NoTrueMasks,
    /// A segmenter from outside that failed or broke its protocol.
    #[error("the segmenter {name} {why}")]
    Foreign {
        /// Its name.
        name: String,
        /// What it did, and the remedy.
        why: String,
        /// The failure in its own language.
        #[source]
        source: Option<Box<dyn std::error::Error + Send + Sync>>,
    },
}
