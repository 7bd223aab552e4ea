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
/// The tree is 16 levels deep and centred on the origin: a leaf at the lowest level has an edge of
/// `resolution_m`, and key 32768 along an axis starts at coordinate 0.
#[derive(Debug, Clone, PartialEq)]
pub struct OccupancyTree {
    /// Edge of the smallest voxel, metres.
    pub resolution_m: f64,
    /// Nodes in depth-first order, children by rising index; empty for an empty map.
    pub nodes: Vec<OccupancyNode>,
}
