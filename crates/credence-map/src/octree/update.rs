//! One scan into the tree.
//!
//! `OctoMap` descends from the root once per voxel. Here the scan's voxels come as 4 x 4 x 4
//! blocks in Morton order, so one recursion visits every node of the union of their paths once,
//! updates the leaves below it and prunes on the way back. The result is the same: each voxel is
//! updated once whatever the order, and a tree that was pruned before is pruned after.

use super::{
    Arena, Kind, Node, OccupancyMap,
    arena::Block,
    log_odds::{HIT, MAX, MIN, MISS, updated},
};
use crate::scan::{BLOCK_DEPTH, Cells, ScanCells};

impl OccupancyMap {
    pub(crate) fn apply(&mut self, cells: &ScanCells) {
        if !cells.blocks().is_empty() {
            self.root = update_inner(&mut self.arena, self.root, 0, cells.blocks());
        }
    }
}

/// Updates the node at `depth`, an ancestor of all `blocks`, which is not empty.
fn update_inner(arena: &mut Arena, node: Node, depth: u32, blocks: &[Cells]) -> Node {
    if depth == BLOCK_DEPTH {
        let Cells { free, occupied, .. } = blocks[0];
        return update_bits(arena, node, free, occupied, 8);
    }
    let only = |occupied: bool| {
        blocks
            .iter()
            .all(|b| 0 == if occupied { b.free } else { b.occupied })
    };
    if stays(node, || only(false), || only(true)) {
        return node;
    }
    let (index, mut children) = open(arena, node);
    let octant = |b: &Cells| ((b.code >> (3 * (BLOCK_DEPTH - 1 - depth))) & 7) as usize;
    for group in blocks.chunk_by(|a, b| octant(a) == octant(b)) {
        let i = octant(&group[0]);
        children[i] = update_inner(arena, children[i], depth + 1, group);
    }
    arena.close(index, children)
}

/// Updates a node whose voxels are the low bits of `free` and `occupied` in Morton order, `width`
/// of them to a child: 8 at the second level from below, 1 at the lowest.
fn update_bits(arena: &mut Arena, node: Node, free: u64, occupied: u64, width: u32) -> Node {
    if stays(node, || occupied == 0, || free == 0) {
        return node;
    }
    let (index, mut children) = open(arena, node);
    for (i, child) in children.iter_mut().enumerate() {
        let part = |word: u64| (word >> (i as u32 * width)) & ((1 << width) - 1);
        let (free, occupied) = (part(free), part(occupied));
        if free | occupied == 0 {
            continue;
        }
        *child = if width == 1 {
            let observation = if occupied == 0 { MISS } else { HIT };
            Node::leaf(updated(child.log_odds, observation))
        } else {
            update_bits(arena, *child, free, occupied, width / 8)
        };
    }
    arena.close(index, children)
}

/// Whether a saturated leaf gets only more of the same: the usual case in free space.
fn stays(node: Node, only_free: impl Fn() -> bool, only_occupied: impl Fn() -> bool) -> bool {
    node.kind() == Kind::Leaf
        && ((node.log_odds <= MIN && only_free()) || (node.log_odds >= MAX && only_occupied()))
}

/// The children of a node, made where there were none: unknown ones for a new node, copies of the
/// value for a pruned one.
fn open(arena: &mut Arena, node: Node) -> (u32, Block) {
    match node.kind() {
        Kind::Inner(index) => (index, *arena.block(index)),
        Kind::Leaf => {
            let children = [node; 8];
            (arena.allocate(children), children)
        }
        Kind::Unknown => {
            let children = [Node::UNKNOWN; 8];
            (arena.allocate(children), children)
        }
    }
}
