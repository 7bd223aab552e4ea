//! Training of the point auto-encoder on clouds drawn from the meshes.

mod chamfer;
mod clouds;
mod command;
mod task;

pub(super) use clouds::{Turn, canonical_cloud};
pub(super) use command::run;
