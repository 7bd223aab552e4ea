//! Training of the shape completers.

mod autoencoder;
mod centersnap;
mod cloud;
mod command;

pub use command::CompleteArgs;
