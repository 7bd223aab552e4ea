//! Laws that hold for any tree and any bytes.

use credence_types::{OccupancyNode, OccupancyTree};
use proptest::prelude::*;

use super::{bt, inner, leaf, ot, read, tree};
use crate::octomap::{
    DEPTH,
    likelihood::{is_occupied, max_likelihood},
};

/// A tree with its branches in place, as `OctoMap` holds it.
#[derive(Debug, Clone)]
enum Branch {
    Leaf(f32),
    Inner(Vec<Option<Self>>),
}

impl Branch {
    fn flatten(&self, nodes: &mut Vec<OccupancyNode>) {
        match self {
            Self::Leaf(log_odds) => nodes.push(leaf(*log_odds)),
            Self::Inner(children) => {
                let present = (0..8).filter(|&i| children[i].is_some());
                nodes.push(inner(present.fold(0, |mask, i| mask | 1 << i)));
                for child in children.iter().flatten() {
                    child.flatten(nodes);
                }
            }
        }
    }

    /// `OctoMap`'s `pruneRecurs`: merges at one depth, returns how many.
    fn prune(&mut self, depth: u32, at: u32) -> usize {
        let Self::Inner(children) = self else {
            return 0;
        };
        if depth < at {
            let present = children.iter_mut().flatten();
            return present.map(|child| child.prune(depth + 1, at)).sum();
        }
        let occupied = |child: &Option<Self>| match child {
            Some(Self::Leaf(log_odds)) => Some(is_occupied(*log_odds)),
            _ => None,
        };
        let first = occupied(&children[0]);
        if first.is_none() || children.iter().any(|child| occupied(child) != first) {
            return 0;
        }
        if let Some(Some(child)) = children.pop() {
            *self = child;
        }
        1
    }
}

fn flat(branch: &Branch) -> Vec<OccupancyNode> {
    let mut nodes = Vec::new();
    branch.flatten(&mut nodes);
    nodes
}

/// Branches that are often full, so that they merge; the root lies `above` levels higher up.
fn branches() -> impl Strategy<Value = Branch> {
    let leaf = prop_oneof![Just(-1.0_f32), Just(-0.5), Just(0.0), -1.0..1.0_f32];
    let full = |branch: BoxedStrategy<Branch>| {
        prop::collection::vec(branch.prop_map(Some), 8).prop_map(Branch::Inner)
    };
    let sparse = |branch: BoxedStrategy<Branch>| {
        prop::collection::vec(prop::option::of(branch), 8).prop_filter_map("no child", |children| {
            let any = children.iter().any(Option::is_some);
            any.then_some(Branch::Inner(children))
        })
    };
    let alike = prop_oneof![-1.0..-0.1_f32, 0.0..1.0_f32].prop_map(|value| {
        let sign = |i: usize| value * (1.0 + i as f32);
        Branch::Inner((0..8).map(|i| Some(Branch::Leaf(sign(i)))).collect())
    });
    let branch =
        prop_oneof![leaf.prop_map(Branch::Leaf), alike].prop_recursive(3, 80, 8, move |branch| {
            prop_oneof![full(branch.clone()), sparse(branch)]
        });
    (branch, 0_usize..13).prop_map(|(branch, above)| {
        (0..above).fold(branch, |branch, level| {
            let mut children = vec![None; 8];
            children[level % 8] = Some(branch);
            Branch::Inner(children)
        })
    })
}

fn states(nodes: &[OccupancyNode]) -> Vec<(u8, Option<bool>)> {
    let state = |n: &OccupancyNode| (n.children == 0).then(|| is_occupied(n.log_odds));
    nodes.iter().map(|n| (n.children, state(n))).collect()
}

proptest! {
    #[test]
    fn full_files_give_the_same_tree(branch in branches(), resolution_m in 1e-6..1e6_f64) {
        let tree = OccupancyTree { resolution_m, nodes: flat(&branch) };
        prop_assert_eq!(read(&ot(&tree)).unwrap(), tree);
    }

    #[test]
    fn binary_files_give_the_most_likely_tree(branch in branches()) {
        let nodes = max_likelihood(&flat(&branch));
        let read = read(&bt(&tree(flat(&branch)))).unwrap().nodes;
        prop_assert_eq!(states(&read), states(&nodes));
    }

    #[test]
    fn prunes_as_octomap_does(mut branch in branches()) {
        let nodes = max_likelihood(&flat(&branch));
        for depth in (1..DEPTH).rev() {
            if branch.prune(0, depth) == 0 {
                break;
            }
        }
        // A lone free root is the one case where the two differ on purpose.
        let lone = matches!(branch, Branch::Leaf(log_odds) if !is_occupied(log_odds));
        prop_assert!(lone || states(&nodes) == states(&flat(&branch)));
    }

    #[test]
    fn no_bytes_panic(
        branch in branches(),
        binary: bool,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let tree = tree(flat(&branch));
        let mut bytes = if binary { bt(&tree) } else { ot(&tree) };
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        if let Ok(tree) = read(&bytes) {
            prop_assert_eq!(read(&ot(&tree)).unwrap(), tree);
        }
    }
}
