//! Training of the networks: data, loops, command line.

pub mod data;
mod error;
pub mod metric;

pub use error::TrainError;
