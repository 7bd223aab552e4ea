//! Training of the point auto-encoder on clouds drawn from the meshes.

mod chamfer;
mod clouds;
mod command;
mod task;

#[cfg(test)]
mod tests;

pub(crate) use clouds::{Shape, canonical_cloud, is_round};
pub(crate) use command::train;
