//! Training scenes, drawn from the meshes and kept on disk.
//!
//! A [`Scene`] is what the map would know of one object after one to five depth views (observed
//! points, neighbours' points, free space), and query points with their true distances. It is a
//! function of a [`MeshSet`], a seed and an index alone. A [`SceneCache`] keeps many of them.

mod cache;
mod camera;
mod codec;
mod command;
mod mesh_set;
mod near;
mod observe;
mod picture;
mod ply;
mod queries;
mod raster;
mod scene;
mod sensor;
mod stage;
#[cfg(test)]
pub(crate) mod tests;
mod texture;

pub use cache::SceneCache;
pub use command::DataCommand;
pub(crate) use mesh_set::Mesh;
pub use mesh_set::MeshSet;
pub(crate) use picture::{Picture, Shown};
pub use scene::Scene;
pub(crate) use stage::any_category;
