//! To and from the flat, depth-first tree that files hold.

use credence_types::{OccupancyNode, OccupancyTree};

use super::{Arena, Grid, Kind, Node, OccupancyMap};
use crate::MapError;

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
        tree.check()?;
        if !tree.nodes.is_empty() {
            map.root = read(&mut map.arena, &mut tree.nodes.iter());
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

/// Takes the next subtree of nodes that are known to form a tree.
fn read<'a>(arena: &mut Arena, nodes: &mut impl Iterator<Item = &'a OccupancyNode>) -> Node {
    let Some(node) = nodes.next() else {
        return Node::UNKNOWN;
    };
    if node.children == 0 {
        return Node::leaf(node.log_odds);
    }
    let mut children = [Node::UNKNOWN; 8];
    for (i, child) in children.iter_mut().enumerate() {
        if node.children & 1 << i != 0 {
            *child = read(arena, nodes);
        }
    }
    let block = arena.allocate(children);
    arena.inner(block)
}
