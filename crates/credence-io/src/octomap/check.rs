//! Whether a flat tree is one.

use std::path::Path;

use credence_types::{OccupancyNode, OccupancyTree};

use super::DEPTH;
use crate::IoError;

/// Refuses a tree that no reader would take back.
pub(super) fn tree(tree: &OccupancyTree, path: &Path) -> Result<(), IoError> {
    let refused = |what, remedy| {
        Err(IoError::Refused {
            path: path.to_path_buf(),
            what,
            remedy,
        })
    };
    let resolution = tree.resolution_m;
    if !resolution.is_finite() || resolution <= 0.0 {
        let what = format!("the resolution is {resolution}");
        return refused(what, "give the voxel edge in metres, positive and finite");
    }
    if let Err((index, why)) = nodes(&tree.nodes) {
        let what = format!("node {index} of the occupancy tree {why}");
        return refused(what, "export the tree again from its map");
    }
    Ok(())
}

fn nodes(nodes: &[OccupancyNode]) -> Result<(), (usize, &'static str)> {
    if nodes.is_empty() {
        return Ok(());
    }
    let next = subtree(nodes, 0, 0)?;
    if next < nodes.len() {
        return Err((next, "belongs to no parent"));
    }
    Ok(())
}

/// Index after the subtree that starts at `index`.
fn subtree(
    nodes: &[OccupancyNode],
    index: usize,
    depth: u32,
) -> Result<usize, (usize, &'static str)> {
    let Some(node) = nodes.get(index) else {
        return Err((index, "is missing"));
    };
    if !node.log_odds.is_finite() {
        return Err((index, "has log-odds that are not finite"));
    }
    if node.children != 0 && depth == DEPTH {
        return Err((index, "has children below the 16th level"));
    }
    (0..node.children.count_ones()).try_fold(index + 1, |next, _| subtree(nodes, next, depth + 1))
}
