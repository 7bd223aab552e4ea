//! Training of the networks: data, loops, command line.

mod augment;
pub mod cli;
mod command;
pub mod complete;
pub mod data;
mod error;
pub mod metric;
pub mod query;
pub mod run;
pub mod segment;

pub use command::RunArgs;
pub use error::TrainError;
