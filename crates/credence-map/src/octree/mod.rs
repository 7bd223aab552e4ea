//! The occupancy octree: `OctoMap`'s log-odds model over an arena of child blocks.

mod arena;
mod flat;
mod leaves;
mod log_odds;
#[cfg(test)]
mod tests;
mod update;

use arena::{Arena, Kind, Node};
use credence_types::Point;
pub use leaves::{Leaf, Leaves};

use crate::{
    MapError, VoxelKey,
    key::{DEPTH, Grid},
    scan::{ScanCells, ScanUpdate},
};

/// What is known of a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Occupancy {
    /// No ray has reached it.
    Unknown,
    /// Rays have passed through: log-odds below 0.
    Free,
    /// Rays have ended there: log-odds of at least 0, as in `OctoMap`.
    Occupied,
}

/// An octree of occupancy log-odds, 16 levels deep, centred on the world's origin.
///
/// [`insert_scan`](Self::insert_scan) gives, leaf for leaf, what `OctoMap`'s `insertPointCloud`
/// gives: hit 0.7, miss 0.4, clamped to \[0.1192, 0.971\], eight equal leaves pruned to one. Within
/// one scan every voxel is updated once: as occupied where a ray ends, else as free where one
/// passes. Coordinates are rounded to f32 first, as there.
#[derive(Debug, Clone)]
pub struct OccupancyMap {
    grid: Grid,
    arena: Arena,
    root: Node,
}

impl OccupancyMap {
    /// An empty map whose smallest voxels have an edge of `resolution_m`.
    ///
    /// # Errors
    /// A resolution outside 1e-5 to 1000 m.
    pub fn new(resolution_m: f64) -> Result<Self, MapError> {
        Ok(Self {
            grid: Grid::new(resolution_m)?,
            arena: Arena::default(),
            root: Node::UNKNOWN,
        })
    }

    /// Edge of the smallest voxels, metres.
    pub const fn resolution_m(&self) -> f64 {
        self.grid.resolution_m()
    }

    pub(crate) const fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Inserts one scan: rays from the sensor to each point.
    ///
    /// Rays longer than `max_range_m` are cut there and end in no occupied voxel. Points outside
    /// the tree's volume are left out and counted.
    ///
    /// # Errors
    /// A coordinate that is not finite, a sensor outside the volume, a range that is not positive,
    /// rays that cross more space than a scan may. The map is unchanged then.
    pub fn insert_scan(
        &mut self,
        origin_world: &Point,
        points_world: &[Point],
        max_range_m: Option<f64>,
    ) -> Result<ScanUpdate, MapError> {
        let cells = ScanCells::trace(&self.grid, origin_world, points_world, max_range_m)?;
        self.apply(&cells);
        Ok(cells.update())
    }

    /// Log-odds at a point; `None` where nothing is known.
    pub fn log_odds(&self, point_world: &Point) -> Option<f32> {
        self.log_odds_at(self.grid.key_of(point_world)?)
    }

    /// Log-odds of the leaf that holds a voxel; `None` where nothing is known.
    pub fn log_odds_at(&self, key: VoxelKey) -> Option<f32> {
        let mut node = self.root;
        let mut level = DEPTH;
        loop {
            match node.kind() {
                Kind::Unknown => return None,
                Kind::Leaf => return Some(node.log_odds),
                Kind::Inner(block) => {
                    level -= 1;
                    let octant = (key.morton() >> (3 * level)) & 7;
                    node = self.arena.block(block)[octant as usize];
                }
            }
        }
    }

    /// What is known of a point's place.
    pub fn occupancy(&self, point_world: &Point) -> Occupancy {
        let key = self.grid.key_of(point_world);
        key.map_or(Occupancy::Unknown, |key| self.occupancy_at(key))
    }

    /// What is known of a voxel.
    pub fn occupancy_at(&self, key: VoxelKey) -> Occupancy {
        match self.log_odds_at(key) {
            None => Occupancy::Unknown,
            Some(log_odds) if log_odds < 0.0 => Occupancy::Free,
            Some(_) => Occupancy::Occupied,
        }
    }

    /// Bytes that the tree holds allocated.
    pub const fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.arena.bytes()
    }
}
