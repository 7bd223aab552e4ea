use std::{io, path::PathBuf};

/// What can go wrong in training; every message says what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A file that cannot be read.
    #[error("cannot read {}: {source}; check that the path exists and is readable", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file that cannot be written.
    #[error("cannot write {}: {source}; check the folder's permissions and free space", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A mesh or a manifest that is not what the generator writes.
    #[error(
        "{} cannot be used: {problem}; generate the meshes again with `harness assets`",
        path.display()
    )]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// No draw of a scene shows its object.
    #[error(
        "scene {index} shows too little of its object in {draws} draws; use meshes of household \
         size, as `harness assets` makes them"
    )]
    Scene {
        /// The scene.
        index: u64,
        /// Draws that were tried.
        draws: u32,
    },
    /// No draw of a picture can be photographed.
    #[error(
        "every one of {draws} pictures has an object right before the lens; use meshes of household \
         size, as `harness assets` makes them"
    )]
    Picture {
        /// Draws that were tried.
        draws: u32,
    },
    /// A file of pictures that is not what the renderer writes.
    #[error(
        "{} cannot be used: {why}; render the pictures again with `harness training-pictures`",
        path.display()
    )]
    Pictures {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A picture that a folder does not hold.
    #[error(
        "there is no picture {index}; the folder holds pictures 0 to {count}, the end excluded"
    )]
    PictureIndex {
        /// The picture.
        index: usize,
        /// Number of pictures.
        count: usize,
    },
    /// A scene that a cache does not hold.
    #[error("there is no scene {index}; the cache holds scenes 0 to {count}, the end excluded")]
    SceneIndex {
        /// The scene.
        index: usize,
        /// Number of scenes.
        count: usize,
    },
    /// A cache of other scenes.
    #[error(
        "{} holds scenes of another seed, other meshes or another version; delete its folder or \
         name another one",
        path.display()
    )]
    OtherCache {
        /// The file.
        path: PathBuf,
    },
    /// What the networks and their files refuse.
    #[error(transparent)]
    Network(#[from] credence_nn::NnError),
    /// Points or a viewpoint that are not.
    #[error(transparent)]
    Input(#[from] credence_types::InvalidInput),
    /// What shape completion refuses.
    #[error(transparent)]
    Complete(#[from] credence_complete::CompleteError),
    /// What segmentation refuses.
    #[error(transparent)]
    Segment(#[from] credence_segment::SegmentError),
    /// What the embedding refuses.
    #[error(transparent)]
    Embed(#[from] credence_embed::EmbedError),
    /// A checkpoint that cannot be written or read.
    #[error("checkpoint {}: {problem}; delete it to resume from an older one", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A checkpoint of a run with other settings.
    #[error(
        "{} belongs to another run ({found}), not to this one ({wanted}); delete its folder, or \
         name another one with --checkpoints",
        path.display()
    )]
    OtherRun {
        /// The file.
        path: PathBuf,
        /// The run it is of.
        found: String,
        /// The run that was asked for.
        wanted: String,
    },
    /// A loss that is no number.
    #[error("the loss is not finite at step {step}; lower the learning rate or check the data")]
    Diverged {
        /// The step.
        step: u64,
    },
    /// A number on the command line that nothing can be trained with.
    #[error("--{option} is {value}; it must be at least {least}")]
    Option {
        /// The option.
        option: &'static str,
        /// The offending value.
        value: u64,
        /// Its least value.
        least: u64,
    },
}
