//! Instance segmentation: from a frame to the objects in it.
//!
//! A [`Segmenter`] gives every object of a frame a mask, a distribution over the categories and a
//! score.

mod error;
pub mod maskrcnn;
mod segmenter;
mod trim;

pub use error::SegmentError;
pub use segmenter::Segmenter;
pub use trim::trimmed;
