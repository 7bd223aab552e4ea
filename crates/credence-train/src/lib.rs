//! Training of the networks: data, loops, command line.

pub mod cli;
pub mod data;
mod error;
pub mod metric;
pub mod query;
pub mod run;

pub use error::TrainError;
