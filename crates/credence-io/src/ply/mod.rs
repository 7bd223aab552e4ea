//! Coloured point clouds as PLY, the Stanford polygon format 1.0.

mod header;
mod read;
mod scalar;
mod write;

use std::path::Path;

use credence_types::{Point, PointCloud};

use crate::{IoError, bytes::read_file};

/// Reads the vertices of a PLY file, ascii or binary of either byte order.
///
/// Needed are `x`, `y`, `z` (float or double, metres) and `red`, `green`, `blue` (uchar), in any
/// order; other properties and elements, faces for instance, are passed over.
///
/// # Errors
/// A file that cannot be read, is no PLY file, lacks a property or has it in another type, is cut
/// off or goes on after its last element; coordinates that are not finite.
pub fn read_point_cloud(path: impl AsRef<Path>) -> Result<PointCloud, IoError> {
    read_file(path.as_ref(), read::parse)
}

/// Writes a cloud as binary little-endian PLY: `x`, `y`, `z` as double, metres, then `red`,
/// `green`, `blue` as uchar. Reading it gives the same cloud back, bit for bit.
///
/// # Errors
/// Points that are not finite or lack a colour; a file that cannot be written. Nothing is left
/// then.
pub fn write_point_cloud(cloud: &PointCloud, path: impl AsRef<Path>) -> Result<(), IoError> {
    write::write(cloud, path.as_ref())
}

/// Writes points and the spread of each as binary little-endian PLY: `x`, `y`, `z` and `spread`,
/// all as double, metres.
///
/// # Errors
/// Points that are not finite or lack a spread; a file that cannot be written. Nothing is left
/// then.
pub fn write_spread_cloud(
    points_world: &[Point],
    spread_m: &[f64],
    path: impl AsRef<Path>,
) -> Result<(), IoError> {
    write::write_spreads(points_world, spread_m, path.as_ref())
}

#[cfg(test)]
mod tests;
