use credence_types::{Category, InvalidInput};
use thiserror::Error;

/// What keeps the pipeline from a result.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// A setting that does not exist or cannot be.
    #[error("pipeline configuration: {0}")]
    Config(String),
    /// A name that no choice has.
    #[error("{what}: {why}")]
    Choice {
        /// What was to be chosen.
        what: &'static str,
        /// The name as given, and those that exist.
        why: String,
    },
    /// Training points and classes of different number.
    #[error("classes has {found} entries; {expected} training points need one each")]
    TrainingLength {
        /// Classes found.
        found: usize,
        /// Number of points.
        expected: usize,
    },
    /// A training point of a class that does not exist.
    #[error("classes[{index}] is {class}; 0 is free space and the categories run from 1 to {last}")]
    TrainingClass {
        /// Position of the point.
        index: usize,
        /// Its class.
        class: u8,
        /// The last category's class.
        last: usize,
    },
    /// More training points than a classifier has memory for.
    #[error(
        "there are {found} training points; pass at most {most}, as the classifier's memory grows \
         with their square"
    )]
    TooManyTrainingPoints {
        /// Points found.
        found: usize,
        /// Points allowed.
        most: usize,
    },
    /// A viewpoint that is nowhere.
    #[error("the viewpoint {value:?} is not finite; pass the camera's centre in world metres")]
    Viewpoint {
        /// The point.
        value: [f64; 3],
    },
    /// A network was asked about a training set that does not say where it was seen from.
    #[error(
        "the training set has no viewpoint, and the network needs one; draw the set from the \
         pipeline, or pass viewpoint_world, the mean camera centre"
    )]
    NoViewpoint,
    /// Completion probabilities of another number than test points.
    #[error("completion_confidence holds {found} values; {expected} test points need one each")]
    CompletionLength {
        /// Values found.
        found: usize,
        /// Number of test points.
        expected: usize,
    },
    /// A training set that cannot tell what is asked.
    #[error(
        "the object is a {category}, and no training point is of that category; draw the training \
         set for this object"
    )]
    CategoryNotTrained {
        /// The object's category.
        category: Category,
    },
    /// An object about which nothing is known to be free.
    #[error(
        "object {id} has no free space within {box_padding_m} m of its box and at least \
         {free_margin_m} m away from observed points; insert views that look past it, raise \
         training.box_padding_m or lower training.free_margin_m"
    )]
    NoFreeSpace {
        /// The object.
        id: u32,
        /// Padding of its box, metres.
        box_padding_m: f64,
        /// Distance kept from observed points, metres.
        free_margin_m: f64,
    },
    /// A reconfigured pipeline was asked about completions that it does not have yet.
    #[error(
        "{completed} of {frames} frames are completed under this configuration; pass the others to \
         complete_frame in their order, frame {completed} next"
    )]
    NotCompleted {
        /// Frames completed.
        completed: usize,
        /// Frames in the map.
        frames: usize,
    },
    /// A frame to complete that is not the next one.
    #[error("frame {index} cannot be completed now: {next}")]
    CompletionOrder {
        /// The frame.
        index: usize,
        /// What can be.
        next: String,
    },
    /// A frame to complete that is not the one that was mapped.
    #[error(
        "frame {index} was mapped with {mapped}; pass the frame and the detections that it was \
         added with"
    )]
    OtherFrame {
        /// Its index.
        index: usize,
        /// What differs, and how.
        mapped: String,
    },
    /// An input no stage can work with.
    #[error(transparent)]
    Input(#[from] InvalidInput),
    /// The segmenter cannot work with a frame, or broke its protocol.
    #[error(transparent)]
    Segment(#[from] credence_segment::SegmentError),
    /// The map cannot answer.
    #[error(transparent)]
    Map(#[from] credence_map::MapError),
    /// The completer cannot work with a frame, or broke its protocol.
    #[error(transparent)]
    Complete(#[from] credence_complete::CompleteError),
    /// A network cannot be loaded, or cannot embed these points.
    #[error(transparent)]
    Embed(#[from] credence_embed::EmbedError),
    /// The classifier cannot answer.
    #[error(transparent)]
    Gp(#[from] credence_gp::GpError),
}
