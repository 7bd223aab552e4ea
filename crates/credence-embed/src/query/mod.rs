//! The query embedding: an observed cloud in, any point's place in the unit ball out.

mod embedder;
mod network;

pub use credence_nn::query::{Batch, SUBSET_FREE, SUBSET_OBJECT, Sample, Support, Widths};
pub use credence_types::Observation;
pub use embedder::{QueryEmbedder, QueryEmbedding};
pub use network::{CATEGORIES, Decoded, Encoded, QueryNetwork};
