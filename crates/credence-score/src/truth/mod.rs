//! Distances and rays against true meshes.

mod bounds;
mod mesh;
mod order;
mod scene;
mod tolerance;
mod tree;

pub use mesh::{MAX_COORDINATE_M, MeshTruth};
pub use scene::{Nearest, SceneTruth};
pub use tolerance::{DEFAULT_TOLERANCE_M, TOLERANCES_M, on_surface};

pub(crate) use mesh::finite_points;
