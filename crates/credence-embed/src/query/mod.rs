//! The query embedding: an observed cloud in, any point's place in the unit ball out.

mod batch;
mod embedder;
mod network;
mod observation;
mod support;

pub use batch::{Batch, Sample};
pub use embedder::{QueryEmbedder, QueryEmbedding};
pub use network::{CATEGORIES, Decoded, Encoded, QueryNetwork, Widths};
pub use observation::Observation;
pub use support::{SUBSET_FREE, SUBSET_OBJECT, Support};
