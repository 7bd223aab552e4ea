//! The voxels that one scan touches.
//!
//! 1. Each point becomes a ray, cut at the maximum range; points outside the volume are counted.
//! 2. Rays are traced in parallel into a bitmap over their bounding box, or, if that box is huge,
//!    into a hash map of 4 x 4 x 4 blocks of bounded size.
//! 3. Voxels in which a ray ends are occupied, the others free; the blocks are sorted in Morton
//!    order, so the outcome depends on neither threads nor hashing.

mod dense;
mod ray;
mod sparse;
#[cfg(test)]
mod tests;

use credence_types::{InvalidInput, Point};
use dense::DenseMarks;
use rayon::prelude::*;
use sparse::SparseMarks;

use crate::{
    MapError, VoxelKey,
    key::{DEPTH, Grid, KEYS, spread, to_f32},
};

/// Bits of a key within a block of 4 x 4 x 4 voxels.
const BLOCK_BITS: u32 = 2;
/// Depth of the node that is a block.
pub(crate) const BLOCK_DEPTH: u32 = DEPTH - BLOCK_BITS;
/// Most words in a dense bitmap: 64 MiB, a cube of 4 m at 5 mm. A scan takes two bitmaps, one of
/// the voxels that rays pass and one of those in which they end.
const DENSE_LIMIT: usize = 1 << 23;
/// Most blocks that a scan too wide for the bitmap may touch: about 200 MB while it is traced.
const SPARSE_LIMIT: usize = 1 << 22;

/// What one scan changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScanUpdate {
    /// Voxels that a ray passed.
    pub free_voxels: usize,
    /// Voxels in which a ray ended.
    pub occupied_voxels: usize,
    /// Points left out because they lie outside the map's volume.
    pub points_outside: usize,
}

/// The touched voxels of one block, a bit each in Morton order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Cells {
    /// Morton code of the block.
    pub(crate) code: u64,
    /// Voxels that a ray passed and in which none ended.
    pub(crate) free: u64,
    /// Voxels in which a ray ended.
    pub(crate) occupied: u64,
}

/// All voxels that a scan touches, in Morton order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ScanCells {
    blocks: Vec<Cells>,
    points_outside: usize,
}

/// One ray's end after the cut at the maximum range.
struct Ray {
    end: [f32; 3],
    keys: [u16; 3],
    /// Whether the ray reached its point.
    hit: bool,
}

impl ScanCells {
    pub(crate) fn trace(
        grid: &Grid,
        origin_world: &Point,
        points_world: &[Point],
        max_range_m: Option<f64>,
    ) -> Result<Self, MapError> {
        Self::trace_within(
            grid,
            origin_world,
            points_world,
            max_range_m,
            [DENSE_LIMIT, SPARSE_LIMIT],
        )
    }

    fn trace_within(
        grid: &Grid,
        origin_world: &Point,
        points_world: &[Point],
        max_range_m: Option<f64>,
        [dense_limit, sparse_limit]: [usize; 2],
    ) -> Result<Self, MapError> {
        let finite = |p: &Point| p.iter().all(|c| c.is_finite());
        if let Some(value) = max_range_m.filter(|r| !(r.is_finite() && *r > 0.0)) {
            let name = "max_range_m";
            return Err(MapError::NotPositive { name, value });
        }
        if !finite(origin_world) {
            let name = "origin_world";
            return Err(InvalidInput::NonFinitePoint { name, index: 0 }.into());
        }
        if let Some(index) = points_world.iter().position(|p| !finite(p)) {
            let name = "points_world";
            return Err(InvalidInput::NonFinitePoint { name, index }.into());
        }
        let origin = to_f32(origin_world);
        let Some(origin_keys) = grid.axes_of(origin) else {
            return Err(MapError::SensorOutside {
                origin: (*origin_world).into(),
                reach_m: grid.reach_m(),
            });
        };

        let rays: Vec<Ray> = points_world
            .par_iter()
            .filter_map(|point| cut(grid, origin, to_f32(point), max_range_m))
            .collect();
        let points_outside = points_world.len() - rays.len();
        let mut low = origin_keys;
        let mut high = origin_keys;
        for ray in &rays {
            for axis in 0..3 {
                low[axis] = low[axis].min(ray.keys[axis]);
                high[axis] = high[axis].max(ray.keys[axis]);
            }
        }

        let start = (origin, origin_keys);
        let mut blocks = if let Some(marks) = DenseMarks::new(low, high, dense_limit) {
            rays.par_iter().for_each(|ray| {
                ray::trace(grid, start, (ray.end, ray.keys), &mut &marks);
                if ray.hit {
                    marks.end(ray.keys);
                }
            });
            marks.into_blocks()
        } else {
            let mut marks = SparseMarks::new(sparse_limit);
            for ray in &rays {
                ray::trace(grid, start, (ray.end, ray.keys), &mut marks);
                if ray.hit {
                    marks.end(ray.keys);
                }
                if marks.is_full() {
                    return Err(MapError::ScanTooLarge {
                        limit: sparse_limit,
                    });
                }
            }
            marks.into_blocks()
        };
        blocks.sort_unstable_by_key(|b| b.code);
        for block in &mut blocks {
            block.free &= !block.occupied;
        }
        Ok(Self {
            blocks,
            points_outside,
        })
    }

    pub(crate) fn blocks(&self) -> &[Cells] {
        &self.blocks
    }

    /// Whether a ray passed through the voxel and none ended there.
    pub(crate) fn is_free(&self, key: VoxelKey) -> bool {
        let code = key.morton();
        self.blocks
            .binary_search_by_key(&(code >> 6), |b| b.code)
            .is_ok_and(|i| self.blocks[i].free >> (code & 63) & 1 == 1)
    }

    pub(crate) fn update(&self) -> ScanUpdate {
        let count = |bits: fn(&Cells) -> u64| {
            let ones = self.blocks.iter().map(|b| bits(b).count_ones() as usize);
            ones.sum()
        };
        ScanUpdate {
            free_voxels: count(|b| b.free),
            occupied_voxels: count(|b| b.occupied),
            points_outside: self.points_outside,
        }
    }
}

/// Morton code of a block; `None` outside the volume, where rounding may carry a ray.
fn block_code(block: [i32; 3]) -> Option<u64> {
    let inside = block.iter().all(|b| (0..KEYS >> BLOCK_BITS).contains(b));
    let [x, y, z] = block.map(|b| spread(b as u16));
    inside.then_some(x | y << 1 | z << 2)
}

/// Bit of a voxel in its block's words, from the low two bits of its keys: its Morton code.
fn bit_of([x, y, z]: [u64; 3]) -> u32 {
    let pair = |v: u64| v & 1 | (v & 2) << 2;
    (pair(x) | pair(y) << 1 | pair(z) << 2) as u32
}

/// The voxel in which a ray to a point ends; `None` beyond the range or outside the volume.
pub(crate) fn end_key(
    grid: &Grid,
    origin_world: &Point,
    point_world: &Point,
    max_range_m: Option<f64>,
) -> Option<VoxelKey> {
    cut(grid, to_f32(origin_world), to_f32(point_world), max_range_m)
        .filter(|ray| ray.hit)
        .map(|ray| VoxelKey::from_axes(ray.keys))
}

/// The ray to a point, cut at the range as `OctoMap` does; `None` if it ends outside the volume.
fn cut(grid: &Grid, origin: [f32; 3], point: [f32; 3], max_range_m: Option<f64>) -> Option<Ray> {
    let offset = [0, 1, 2].map(|i| point[i] - origin[i]);
    let length = ray::norm(offset);
    let (end, hit) = match max_range_m {
        Some(range) if length > range => {
            let scale = |i: usize| origin[i] + offset[i] / length as f32 * range as f32;
            ([0, 1, 2].map(scale), false)
        }
        _ => (point, true),
    };
    grid.axes_of(end).map(|keys| Ray { end, keys, hit })
}
