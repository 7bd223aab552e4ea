use credence_types::InvalidInput;
use thiserror::Error;

/// What keeps the pipeline from a result.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// A setting that does not exist or cannot be.
    #[error("pipeline configuration: {0}")]
    Config(String),
    /// An input no stage can work with.
    #[error(transparent)]
    Input(#[from] InvalidInput),
    /// The oracle was chosen for data without masks.
    #[error(
        "segmenter = \"oracle\" needs true masks, and this frame has none; \
         pass instance_ids and categories, or choose another segmenter"
    )]
    NoTrueMasks,
    /// The map cannot answer.
    #[error(transparent)]
    Map(#[from] credence_map::MapError),
    /// The classifier cannot answer.
    #[error(transparent)]
    Gp(#[from] credence_gp::GpError),
}
