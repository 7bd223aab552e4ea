//! Files that other tools read and write.
//!
//! - [`read_octomap`], [`write_bt`] and [`write_ot`] exchange an occupancy octree with `OctoMap` 1.9:
//!   `.bt` keeps occupied or free per leaf in two bits, `.ot` keeps the log-odds.
//! - [`read_point_cloud`] and [`write_point_cloud`] exchange coloured points as PLY.
//!
//! Readers trust nothing that a file declares: memory grows only with the bytes that are really
//! there. Writers put a file under its name only when all of it is on the disk.

mod atomic;
mod bytes;
mod error;
mod octomap;
mod ply;

pub use error::IoError;
pub use octomap::{read_octomap, write_bt, write_ot};
pub use ply::{read_point_cloud, write_point_cloud, write_spread_cloud};
