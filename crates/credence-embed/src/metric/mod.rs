//! The seed's metric embedding: every point of a cloud gets a place on the unit sphere.
//!
//! A DGCNN gives each point logits for free space and the six categories from its cloud, and a
//! head maps them to a direction that A-Softmax has gathered around its category's. Whoever uses
//! the embedding puts free space at the zero vector.

mod clouds;
mod dgcnn;
mod embedder;
mod network;

pub use clouds::{CLOUD_POINTS, CloudBatch, NEIGHBOURS, centred};
pub use embedder::{MetricEmbedder, MetricEmbedding};
pub use network::{MetricNetwork, MetricWidths};
