//! The map of a scene: where things are, what they are, and where nothing is.
//!
//! - [`OccupancyMap`] is an octree of occupancy log-odds that agrees with `OctoMap` leaf for leaf.
//!   Rays from the sensor to each measured point make voxels free on their way and occupied at
//!   their end; [`OccupancyMap::sample_free`] draws points where rays have passed.
//! - [`SemanticMap`] keeps, beside it, the colour, class histogram, confidence and object of every
//!   occupied voxel (Table I of the seed paper, Hong et al.), and a partial cloud per object at
//!   the depth images' full resolution. [`SemanticMap::insert`] takes one [`Frame`] and the
//!   [`Instance`]s found in it.
//! - [`TrackedObject`]s keep their [`ObjectId`] over views: detections are paired with objects one
//!   to one by distance ([`Association`]), and an object is deleted only when a view looks through
//!   its place.
//!
//! [`Frame`]: credence_types::Frame
//! [`Instance`]: credence_types::Instance

mod aabb;
mod error;
mod free_space;
mod key;
mod nearest;
mod octree;
mod scan;
mod semantic;
mod tracker;

pub use aabb::Aabb;
pub use error::MapError;
pub use free_space::FreeSampling;
pub use key::VoxelKey;
pub use octree::{Leaf, Leaves, Occupancy, OccupancyMap};
pub use scan::ScanUpdate;
pub use semantic::{
    InsertReport, KeepAway, SemanticMap, SemanticMapConfig, SemanticVoxel, SupportConfig,
};
pub use tracker::{Association, ObjectId, TrackedObject, TrackerConfig};
