use credence_types::Point;

use super::{Arena, Kind, Node, OccupancyMap};
use crate::{
    Aabb, VoxelKey,
    key::{DEPTH, Grid},
};

/// A cube of known occupancy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leaf {
    /// Centre, metres.
    pub centre: Point,
    /// Edge, metres.
    pub size_m: f64,
    /// Log-odds of being occupied.
    pub log_odds: f32,
}

impl Leaf {
    /// The cube.
    pub fn aabb(&self) -> Aabb {
        let half = nalgebra::Vector3::repeat(self.size_m / 2.0);
        Aabb::around(self.centre, half)
    }

    /// Whether rays pass through rather than end here.
    pub fn is_free(&self) -> bool {
        self.log_odds < 0.0
    }
}

/// Leaves in depth-first order; made by [`OccupancyMap::leaves`].
#[derive(Debug, Clone)]
pub struct Leaves<'a> {
    arena: &'a Arena,
    grid: &'a Grid,
    within: Option<Aabb>,
    stack: Vec<(Node, u64, u32)>,
}

impl OccupancyMap {
    /// All leaves in depth-first order.
    pub fn leaves(&self) -> Leaves<'_> {
        self.iterate(None)
    }

    /// The leaves that share volume with a box, in depth-first order.
    pub fn leaves_within(&self, within: Aabb) -> Leaves<'_> {
        self.iterate(Some(within))
    }

    fn iterate(&self, within: Option<Aabb>) -> Leaves<'_> {
        Leaves {
            arena: &self.arena,
            grid: &self.grid,
            within,
            stack: vec![(self.root, 0, 0)],
        }
    }
}

impl Iterator for Leaves<'_> {
    type Item = Leaf;

    fn next(&mut self) -> Option<Leaf> {
        while let Some((node, code, depth)) = self.stack.pop() {
            let kind = node.kind();
            if kind == Kind::Unknown {
                continue;
            }
            let leaf = Leaf {
                centre: self.grid.centre_of(VoxelKey::from_morton(code), depth),
                size_m: self.grid.size_m(depth),
                log_odds: node.log_odds,
            };
            if self.within.is_some_and(|b| !b.overlaps(&leaf.aabb())) {
                continue;
            }
            match kind {
                Kind::Inner(block) => {
                    let level = DEPTH - 1 - depth;
                    for (i, child) in self.arena.block(block).iter().enumerate().rev() {
                        let code = code | (i as u64) << (3 * level);
                        self.stack.push((*child, code, depth + 1));
                    }
                }
                _ => return Some(leaf),
            }
        }
        None
    }
}
