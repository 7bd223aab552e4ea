//! Training and evaluation of the seed's metric embedding.

mod cloud;
mod command;
mod evaluate;
mod fitness;
mod losses;
mod task;
#[cfg(test)]
mod tests;

pub use command::{EmbedArgs, SphereArgs};
