//! What networks share that are asked about points, given an observed cloud.
//!
//! A [`Support`] holds the observed points, [`Sample`]s and [`Batch`]es carry queries to the
//! device, and a [`QueryTrunk`] encodes the one and decodes the other. Coordinates are in the units
//! of the caller's frame.

mod batch;
mod support;
mod trunk;

pub use batch::{Batch, QueryTensors, Sample};
pub use support::{REACH, SUBSET_FREE, SUBSET_OBJECT, Support};
pub use trunk::{Encoded, QueryTrunk, Widths};
