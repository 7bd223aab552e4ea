//! Training of the shape completers.

mod cloud;
mod command;

pub use command::CompleteArgs;
