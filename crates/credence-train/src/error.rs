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
    /// What the embedding refuses.
    #[error(transparent)]
    Embed(#[from] credence_embed::EmbedError),
}
