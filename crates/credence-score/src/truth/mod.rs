//! Distances and rays against true meshes.

mod bounds;
mod mesh;
mod order;
mod tree;

pub use mesh::{MAX_COORDINATE_M, MeshTruth};

pub(crate) use mesh::finite_points;
