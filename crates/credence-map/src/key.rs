use std::fmt;

use credence_types::{OccupancyTree, Point};

use crate::MapError;

/// Levels below the root: a voxel at the lowest level has one key in 0..65536 per axis.
pub(crate) const DEPTH: u32 = OccupancyTree::DEPTH;
/// Key whose voxel starts at coordinate 0.
const CENTRE: i32 = 1 << (DEPTH - 1);
/// Keys per axis.
pub(crate) const KEYS: i32 = 1 << DEPTH;
/// Voxel edges outside this range overflow or underflow the f32 ray arithmetic.
const RESOLUTION_M: std::ops::RangeInclusive<f64> = 1e-5..=1e3;

/// A voxel at the lowest level, ordered as the octree lays its leaves out (Morton order).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VoxelKey(u64);

impl VoxelKey {
    /// The voxel with these keys along x, y and z.
    pub const fn from_axes([x, y, z]: [u16; 3]) -> Self {
        Self(spread(x) | spread(y) << 1 | spread(z) << 2)
    }

    /// Keys along x, y and z.
    pub const fn axes(self) -> [u16; 3] {
        [gather(self.0), gather(self.0 >> 1), gather(self.0 >> 2)]
    }

    pub(crate) const fn from_morton(code: u64) -> Self {
        Self(code)
    }

    /// Bits of the three keys interleaved, x lowest: three bits per level, the root's octant first.
    pub const fn morton(self) -> u64 {
        self.0
    }
}

impl fmt::Debug for VoxelKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "VoxelKey({:?})", self.axes())
    }
}

/// Moves bit i of a key to bit 3i.
pub(crate) const fn spread(key: u16) -> u64 {
    let mut v = key as u64;
    v = (v | v << 16) & 0xff00_00ff;
    v = (v | v << 8) & 0x00f0_0f00_f00f;
    v = (v | v << 4) & 0x0c30_c30c_30c3;
    (v | v << 2) & 0x2492_4924_9249
}

/// Moves bit 3i back to bit i, for the 16 bits of a key.
const fn gather(code: u64) -> u16 {
    let mut key = 0;
    let mut bit = 0;
    while bit < DEPTH {
        key |= ((code >> (3 * bit)) & 1) << bit;
        bit += 1;
    }
    key as u16
}

/// How coordinates become keys: `OctoMap`'s arithmetic, on coordinates rounded to f32 as there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Grid {
    resolution_m: f64,
    voxels_per_m: f64,
}

impl Grid {
    pub(crate) fn new(resolution_m: f64) -> Result<Self, MapError> {
        if !RESOLUTION_M.contains(&resolution_m) {
            return Err(MapError::Resolution {
                value: resolution_m,
                min: *RESOLUTION_M.start(),
                max: *RESOLUTION_M.end(),
            });
        }
        Ok(Self {
            resolution_m,
            voxels_per_m: 1.0 / resolution_m,
        })
    }

    pub(crate) const fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Half the edge of the whole volume, metres.
    pub(crate) fn reach_m(&self) -> f64 {
        f64::from(CENTRE) * self.resolution_m
    }

    /// Key of a coordinate along one axis; `None` outside the volume or if it is not finite.
    fn axis_key(&self, coordinate: f32) -> Option<u16> {
        let scaled = (self.voxels_per_m * f64::from(coordinate)).floor() + f64::from(CENTRE);
        (0.0..f64::from(KEYS))
            .contains(&scaled)
            .then_some(scaled as u16)
    }

    pub(crate) fn axes_of(&self, point: [f32; 3]) -> Option<[u16; 3]> {
        let [x, y, z] = point;
        Some([self.axis_key(x)?, self.axis_key(y)?, self.axis_key(z)?])
    }

    pub(crate) fn key_of(&self, point_world: &Point) -> Option<VoxelKey> {
        self.axes_of(to_f32(point_world)).map(VoxelKey::from_axes)
    }

    /// Centre of a lowest-level voxel along one axis, metres.
    pub(crate) fn axis_centre(&self, key: u16) -> f64 {
        (f64::from(i32::from(key) - CENTRE) + 0.5) * self.resolution_m
    }

    /// Edge of a node `depth` levels below the root, metres.
    pub(crate) fn size_m(&self, depth: u32) -> f64 {
        self.resolution_m * f64::from(1 << (DEPTH - depth))
    }

    /// Centre of the node at `depth` that holds the voxel `key`.
    pub(crate) fn centre_of(&self, key: VoxelKey, depth: u32) -> Point {
        let level = DEPTH - depth;
        let centre = |k: u16| match depth {
            0 => 0.0,
            DEPTH => self.axis_centre(k),
            _ => (f64::from((i32::from(k) - CENTRE) >> level) + 0.5) * self.size_m(depth),
        };
        let [x, y, z] = key.axes();
        Point::new(centre(x), centre(y), centre(z))
    }
}

/// The point as `OctoMap` stores it.
pub(crate) fn to_f32(point: &Point) -> [f32; 3] {
    [point.x as f32, point.y as f32, point.z as f32]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn keys_follow_octomaps_convention() {
        let grid = Grid::new(0.5).unwrap();
        let key = |x, y, z| grid.key_of(&Point::new(x, y, z)).map(VoxelKey::axes);
        assert_eq!(key(0.0, 0.49, 0.5), Some([32768, 32768, 32769]));
        assert_eq!(key(-0.01, -0.5, -0.51), Some([32767, 32767, 32766]));
        assert_eq!(key(16384.0, 0.0, 0.0), None);
        assert_eq!(key(-16384.0, 0.0, 0.0), Some([0, 32768, 32768]));
        assert_eq!(key(f64::NAN, 0.0, 0.0), None);
        assert_eq!(key(1e300, 0.0, 0.0), None);
    }

    #[test]
    fn centres_of_nodes() {
        let grid = Grid::new(0.5).unwrap();
        let key = VoxelKey::from_axes([32768, 32767, 32770]);
        assert_eq!(grid.centre_of(key, 16), Point::new(0.25, -0.25, 1.25));
        assert_eq!(grid.centre_of(key, 15), Point::new(0.5, -0.5, 1.5));
        assert_eq!(grid.centre_of(key, 0), Point::origin());
    }

    #[test]
    fn refuses_resolutions_that_break_the_arithmetic() {
        for value in [0.0, -0.005, f64::NAN, f64::INFINITY, 1e-9, 1e9] {
            let error = Grid::new(value).unwrap_err().to_string();
            assert!(
                error.contains(&format!("resolution_m is {value}")),
                "{error}"
            );
        }
    }

    proptest! {
        #[test]
        fn axes_and_morton_code_are_one(axes: [u16; 3]) {
            prop_assert_eq!(VoxelKey::from_axes(axes).axes(), axes);
        }

        #[test]
        fn morton_order_compares_octants_from_the_root(a: [u16; 3], b: [u16; 3]) {
            let octant = |k: [u16; 3], bit: u32| (k[0] >> bit & 1) | (k[1] >> bit & 1) << 1 | (k[2] >> bit & 1) << 2;
            let path = |k| (0..DEPTH).rev().map(|bit| octant(k, bit)).collect::<Vec<_>>();
            prop_assert_eq!(
                VoxelKey::from_axes(a).cmp(&VoxelKey::from_axes(b)),
                path(a).cmp(&path(b))
            );
        }
    }
}
