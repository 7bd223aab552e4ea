//! Training of the networks: data, loops, command line.

pub mod data;
mod error;

pub use error::TrainError;
