//! The maximum-likelihood tree: every leaf occupied or free, siblings that have become equal pruned.

use credence_types::{OccupancyNode, OccupancyTree};

use super::DEPTH;

/// Log-odds of a free leaf: the lower clamp.
pub(super) const LOG_ODDS_FREE: f32 = OccupancyTree::MIN_LOG_ODDS;
/// Log-odds of an occupied leaf: the upper clamp.
pub(super) const LOG_ODDS_OCCUPIED: f32 = OccupancyTree::MAX_LOG_ODDS;

/// `OctoMap`'s default threshold, p = 0.5, belongs to the occupied side.
pub(super) const fn is_occupied(log_odds: f32) -> bool {
    log_odds >= 0.0
}

/// What `OctoMap`'s `toMaxLikelihood` and `prune` make of a tree that is known to be one.
pub(super) fn max_likelihood(nodes: &[OccupancyNode]) -> Vec<OccupancyNode> {
    // `prune` goes up one level at a time and stops below the first level where nothing merges. A
    // run without that stop merges the same nodes up to there and so tells where it is.
    let mut pruned = Pruning::run(nodes, 0);
    let stop = (1..DEPTH).rev().find(|&d| pruned.merged[d as usize] == 0);
    if let Some(stop) = stop
        && pruned.merged[..stop as usize]
            .iter()
            .any(|&count| count > 0)
    {
        pruned = Pruning::run(nodes, stop);
    }
    if let [root] = pruned.nodes[..]
        && !is_occupied(root.log_odds)
    {
        // A `.bt` file has no way to say that a lone root is free.
        let inner = OccupancyNode {
            log_odds: root.log_odds,
            children: 0xff,
        };
        return [vec![inner], vec![root; 8]].concat();
    }
    pruned.nodes
}

/// One pass over a tree.
struct Pruning {
    /// Nodes at this depth and above it keep their children.
    stop: u32,
    /// The resulting tree.
    nodes: Vec<OccupancyNode>,
    /// How many nodes of each depth lost their children.
    merged: [usize; DEPTH as usize],
}

impl Pruning {
    fn run(nodes: &[OccupancyNode], stop: u32) -> Self {
        let mut pruning = Self {
            stop,
            nodes: Vec::new(),
            merged: [0; DEPTH as usize],
        };
        let mut nodes = nodes.iter();
        if let Some(root) = nodes.next() {
            pruning.push(*root, &mut nodes, 0);
        }
        pruning
    }

    fn push<'a>(
        &mut self,
        node: OccupancyNode,
        rest: &mut impl Iterator<Item = &'a OccupancyNode>,
        depth: u32,
    ) {
        let at = self.nodes.len();
        self.nodes.push(OccupancyNode {
            log_odds: if is_occupied(node.log_odds) {
                LOG_ODDS_OCCUPIED
            } else {
                LOG_ODDS_FREE
            },
            ..node
        });
        for _ in 0..node.children.count_ones() {
            let Some(child) = rest.next() else { break };
            self.push(*child, rest, depth + 1);
        }
        // Nine nodes from here on are this one and eight children that are leaves.
        if let [parent, children @ ..] = &mut self.nodes[at..]
            && let [first, others @ ..] = children
            && parent.children == 0xff
            && others.len() == 7
            && others.iter().all(|other| other == first)
            && depth > self.stop
        {
            *parent = *first;
            self.nodes.truncate(at + 1);
            self.merged[depth as usize] += 1;
        }
    }
}
