//! To and from the flat, depth-first tree that files hold.

use credence_types::{OccupancyNode, OccupancyTree};

use super::{Arena, Grid, Kind, Node, OccupancyMap};
use crate::{MapError, key::DEPTH};

impl OccupancyMap {
    /// The whole tree, depth first.
    pub fn to_tree(&self) -> OccupancyTree {
        let mut nodes = Vec::new();
        push(&self.arena, self.root, &mut nodes);
        OccupancyTree {
            resolution_m: self.resolution_m(),
            nodes,
        }
    }

    /// The map that a flat tree describes. Leaves are taken as they are, pruned or not; inner
    /// nodes get the highest log-odds of their children.
    ///
    /// # Errors
    /// A resolution outside the allowed range, log-odds that are not finite, more than 16 levels,
    /// missing or surplus nodes.
    pub fn from_tree(tree: &OccupancyTree) -> Result<Self, MapError> {
        let mut map = Self {
            grid: Grid::new(tree.resolution_m)?,
            arena: Arena::default(),
            root: Node::UNKNOWN,
        };
        if tree.nodes.is_empty() {
            return Ok(map);
        }
        let mut next = 0;
        map.root = read(&mut map.arena, &tree.nodes, &mut next, 0)?;
        if next < tree.nodes.len() {
            let why = "belongs to no parent";
            return Err(MapError::Tree { index: next, why });
        }
        Ok(map)
    }
}

fn push(arena: &Arena, node: Node, nodes: &mut Vec<OccupancyNode>) {
    match node.kind() {
        Kind::Unknown => {}
        Kind::Leaf => nodes.push(OccupancyNode {
            log_odds: node.log_odds,
            children: 0,
        }),
        Kind::Inner(block) => {
            let block = arena.block(block);
            let present = block.iter().enumerate().filter(|(_, c)| c.is_known());
            nodes.push(OccupancyNode {
                log_odds: node.log_odds,
                children: present.fold(0, |mask, (i, _)| mask | 1 << i),
            });
            for child in block {
                push(arena, *child, nodes);
            }
        }
    }
}

fn read(
    arena: &mut Arena,
    nodes: &[OccupancyNode],
    next: &mut usize,
    depth: u32,
) -> Result<Node, MapError> {
    let index = *next;
    let fail = |why| Err(MapError::Tree { index, why });
    let Some(node) = nodes.get(index) else {
        return fail("is missing");
    };
    *next += 1;
    if !node.log_odds.is_finite() {
        return fail("has log-odds that are not finite");
    }
    if node.children == 0 {
        return Ok(Node::leaf(node.log_odds));
    }
    if depth == DEPTH {
        return fail("has children below the 16th level");
    }
    let mut children = [Node::UNKNOWN; 8];
    for (i, child) in children.iter_mut().enumerate() {
        if node.children & 1 << i != 0 {
            *child = read(arena, nodes, next, depth + 1)?;
        }
    }
    let block = arena.allocate(children);
    Ok(arena.inner(block))
}
