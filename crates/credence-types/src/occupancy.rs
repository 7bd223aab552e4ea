use crate::InvalidInput;

/// One node of an [`OccupancyTree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OccupancyNode {
    /// Log-odds of the node being occupied.
    pub log_odds: f32,
    /// Bit i is set where child i exists; child i lies in the upper half along x if bit 0 of i is
    /// set, along y if bit 1, along z if bit 2. No bit is set on a leaf.
    pub children: u8,
}

/// An occupancy octree laid out flat, depth first, as `OctoMap`'s files hold it: what a map
/// exports and a file reader yields.
///
/// The tree is [`DEPTH`](Self::DEPTH) levels deep and centred on the origin: a leaf at the lowest
/// level has an edge of `resolution_m`, and key 32768 along an axis starts at coordinate 0.
#[derive(Debug, Clone, PartialEq)]
pub struct OccupancyTree {
    /// Edge of the smallest voxel, metres.
    pub resolution_m: f64,
    /// Nodes in depth-first order, children by rising index; empty for an empty map.
    pub nodes: Vec<OccupancyNode>,
}

impl OccupancyTree {
    /// Levels below the root; a node at the last has no children.
    pub const DEPTH: u32 = 16;
    /// `OctoMap`'s lower clamp, p = 0.1192, as the nearest f32 to ln(p/(1-p)).
    pub const MIN_LOG_ODDS: f32 = -2.000_028;
    /// `OctoMap`'s upper clamp, p = 0.971, likewise.
    pub const MAX_LOG_ODDS: f32 = 3.511_030_7;

    /// Whether the nodes form one tree over voxels of a usable size.
    ///
    /// # Errors
    /// A resolution that is not positive and finite, log-odds that are not finite, children below
    /// the last level, missing or surplus nodes.
    pub fn check(&self) -> Result<(), InvalidInput> {
        let value = self.resolution_m;
        if !(value.is_finite() && value > 0.0) {
            return Err(InvalidInput::TreeResolution { value });
        }
        if self.nodes.is_empty() {
            return Ok(());
        }
        let next = self.after_subtree(0, 0)?;
        if next < self.nodes.len() {
            let why = "belongs to no parent";
            return Err(InvalidInput::Tree { index: next, why });
        }
        Ok(())
    }

    /// Index after the subtree that starts at `index`.
    fn after_subtree(&self, index: usize, depth: u32) -> Result<usize, InvalidInput> {
        let fail = |why| Err(InvalidInput::Tree { index, why });
        let Some(node) = self.nodes.get(index) else {
            return fail("is missing");
        };
        if !node.log_odds.is_finite() {
            return fail("has log-odds that are not finite");
        }
        if node.children != 0 && depth == Self::DEPTH {
            return fail("has children below the 16th level");
        }
        (0..node.children.count_ones())
            .try_fold(index + 1, |next, _| self.after_subtree(next, depth + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(nodes: &[(f32, u8)]) -> Result<(), InvalidInput> {
        let node = |&(log_odds, children)| OccupancyNode { log_odds, children };
        OccupancyTree {
            resolution_m: 0.1,
            nodes: nodes.iter().map(node).collect(),
        }
        .check()
    }

    #[test]
    fn the_clamps_are_the_log_odds_of_octomaps_probabilities() {
        for (constant, p) in [
            (OccupancyTree::MIN_LOG_ODDS, 0.1192),
            (OccupancyTree::MAX_LOG_ODDS, 0.971_f64),
        ] {
            assert_eq!(constant, (p / (1.0 - p)).ln() as f32);
        }
    }

    #[test]
    fn tells_a_tree_from_other_lists() {
        assert_eq!(check(&[]), Ok(()));
        assert_eq!(check(&[(0.5, 0b11), (0.5, 0), (-1.0, 0)]), Ok(()));
        let mut chain = vec![(0.0, 1); 16];
        chain.push((0.0, 0));
        assert_eq!(check(&chain), Ok(()));

        let message = |nodes: &[_]| check(nodes).unwrap_err().to_string();
        assert!(
            message(&[(0.5, 0b11), (0.5, 0)]).contains("node 2 of the occupancy tree is missing")
        );
        assert!(
            message(&[(0.5, 0); 2]).contains("node 1 of the occupancy tree belongs to no parent")
        );
        assert!(message(&[(f32::NAN, 0)]).contains("node 0 of the occupancy tree has log-odds"));
        let too_deep = message(&[(0.0, 1); 18]);
        assert!(
            too_deep.contains("node 16 of the occupancy tree has children below the 16th level")
        );
        for resolution_m in [0.0, -0.1, f64::NAN, f64::INFINITY] {
            let nodes = Vec::new();
            let error = OccupancyTree {
                resolution_m,
                nodes,
            }
            .check()
            .unwrap_err();
            assert!(
                error
                    .to_string()
                    .contains(&format!("edge is {resolution_m}; give"))
            );
        }
    }
}
