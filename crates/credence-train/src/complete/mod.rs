//! Training of the shape completers.

mod autoencoder;
mod cloud;
mod command;

pub use command::CompleteArgs;
