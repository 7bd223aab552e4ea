//! Networks that give points a place in a learned metric space.
//!
//! [`QueryEmbedder`] sees one observation of an object, its points and the free space around it,
//! and embeds any query point, seen or not: the object's class is a direction, and the radius says
//! how surely the point lies on the surface; free space is at zero.
//!
//! [`MetricEmbedder`] is the seed's: it gives the points of a cloud itself their directions.

mod error;
pub mod metric;
pub mod query;

pub use error::EmbedError;
pub use metric::MetricEmbedder;
pub use query::{Observation, QueryEmbedder, QueryEmbedding};
