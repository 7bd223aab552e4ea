use std::collections::BTreeMap;

use credence_types::{OccupancyNode, OccupancyTree};
use proptest::prelude::*;

use super::{
    log_odds::{HIT, MAX, MIN, MISS, updated},
    *,
};
use crate::Aabb;

fn map(resolution_m: f64) -> OccupancyMap {
    OccupancyMap::new(resolution_m).unwrap()
}

/// A scan that touches only the voxels of its points: each ray starts in its own voxel.
fn occupy(map: &mut OccupancyMap, points: &[[f64; 3]]) {
    for point in points {
        let point = Point::from(*point);
        map.insert_scan(&point, &[point], None).unwrap();
    }
}

/// Centres of the eight voxels next to the origin's corner at resolution 1.
fn octet() -> Vec<[f64; 3]> {
    let offset = |i: u32, bit: u32| f64::from(i >> bit & 1) + 0.5;
    (0..8)
        .map(|i| [offset(i, 0), offset(i, 1), offset(i, 2)])
        .collect()
}

#[test]
fn evidence_adds_up() {
    let mut map = map(1.0);
    let sensor = Point::new(0.5, 0.5, 0.5);
    let seen = Point::new(2.5, 0.5, 0.5);
    assert_eq!(map.occupancy(&seen), Occupancy::Unknown);
    map.insert_scan(&sensor, &[seen], None).unwrap();
    assert_eq!(map.log_odds(&sensor), Some(MISS));
    assert_eq!(map.log_odds(&seen), Some(HIT));
    assert_eq!(map.occupancy(&sensor), Occupancy::Free);
    assert_eq!(map.occupancy(&seen), Occupancy::Occupied);
    for _ in 0..9 {
        map.insert_scan(&sensor, &[seen], None).unwrap();
    }
    assert_eq!(map.log_odds(&sensor), Some(MIN));
    assert_eq!(map.log_odds(&seen), Some(MAX));
    assert_eq!(map.log_odds(&Point::new(3.5, 0.5, 0.5)), None);
    assert_eq!(map.log_odds(&Point::new(1e9, 0.5, 0.5)), None);
}

#[test]
fn equal_siblings_merge_and_part_again() {
    let mut map = map(1.0);
    occupy(&mut map, &octet());
    let merged = Leaf {
        centre: Point::new(1.0, 1.0, 1.0),
        size_m: 2.0,
        log_odds: HIT,
    };
    assert_eq!(map.leaves().collect::<Vec<_>>(), [merged]);
    occupy(&mut map, &[[1.5, 0.5, 0.5]]);
    let leaves: Vec<Leaf> = map.leaves().collect();
    let log_odds: Vec<f32> = leaves.iter().map(|l| l.log_odds).collect();
    assert_eq!(log_odds, [HIT, HIT + HIT, HIT, HIT, HIT, HIT, HIT, HIT]);
    assert_eq!(leaves[1].centre, Point::new(1.5, 0.5, 0.5));
    assert_eq!(leaves[1].size_m, 1.0);
}

#[test]
fn freed_blocks_are_used_again() {
    let mut map = map(1.0);
    for _ in 0..100 {
        occupy(&mut map, &octet());
    }
    // One block per level of one path, rounded up by the vector's growth.
    assert!(map.memory_bytes() < 100 * 64, "{}", map.memory_bytes());
}

#[test]
fn leaves_in_a_box() {
    let mut map = map(1.0);
    occupy(&mut map, &[[0.5; 3], [1.5, 0.5, 0.5], [-4.5, 0.5, 0.5]]);
    let within = |min: [f64; 3], max: [f64; 3]| {
        let within = Aabb::new(min.into(), max.into()).unwrap();
        let leaves = map.leaves_within(within);
        leaves.map(|l| l.centre.x).collect::<Vec<_>>()
    };
    assert_eq!(within([-9.0; 3], [9.0; 3]), [-4.5, 0.5, 1.5]);
    assert_eq!(within([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]), [1.5]);
    assert_eq!(within([0.9, 0.9, 0.9], [1.1, 1.1, 1.1]), [0.5, 1.5]);
    assert!(within([0.0, 1.0, 0.0], [2.0, 2.0, 1.0]).is_empty());
}

fn node(log_odds: f32, children: u8) -> OccupancyNode {
    OccupancyNode { log_odds, children }
}

fn tree(nodes: Vec<OccupancyNode>) -> OccupancyTree {
    OccupancyTree {
        resolution_m: 0.5,
        nodes,
    }
}

#[test]
fn a_flat_tree_is_depth_first() {
    let mut map = map(0.5);
    assert_eq!(map.to_tree(), tree(vec![]));
    occupy(&mut map, &[[0.25; 3]]);
    // Child 7 of the root, then child 0 fifteen times.
    let mut nodes = vec![node(HIT, 1 << 7)];
    nodes.extend([node(HIT, 1); 15]);
    nodes.push(node(HIT, 0));
    assert_eq!(map.to_tree(), tree(nodes));
}

#[test]
fn a_single_leaf_fills_the_volume() {
    let map = OccupancyMap::from_tree(&tree(vec![node(-1.0, 0)])).unwrap();
    assert_eq!(map.log_odds(&Point::new(-9000.0, 4.0, 0.0)), Some(-1.0));
    let leaves: Vec<Leaf> = map.leaves().collect();
    assert_eq!(
        (leaves[0].centre, leaves[0].size_m),
        (Point::origin(), 32768.0)
    );
}

#[test]
fn inner_nodes_are_recomputed() {
    let map = OccupancyMap::from_tree(&tree(vec![node(9.0, 3), node(-1.0, 0), node(-2.0, 0)]));
    assert_eq!(map.unwrap().to_tree().nodes[0], node(-1.0, 3));
}

#[test]
fn refuses_broken_trees() {
    let message = |nodes| {
        OccupancyMap::from_tree(&tree(nodes))
            .unwrap_err()
            .to_string()
    };
    assert!(
        message(vec![node(0.0, 3), node(0.0, 0)])
            .contains("node 2 of the occupancy tree is missing")
    );
    assert!(
        message(vec![node(0.0, 0); 2])
            .contains("node 1 of the occupancy tree belongs to no parent")
    );
    assert!(message(vec![node(f32::NAN, 0)]).contains("not finite"));
    assert!(message(vec![node(0.0, 1); 40]).contains("below the 16th level"));
    let zero = OccupancyTree {
        resolution_m: 0.0,
        nodes: vec![],
    };
    assert!(
        OccupancyMap::from_tree(&zero)
            .unwrap_err()
            .to_string()
            .contains("resolution_m is 0")
    );
}

/// The model in its plainest form: a log-odds value per voxel.
fn reference(scans: &[ScanCells]) -> BTreeMap<VoxelKey, f32> {
    let mut voxels = BTreeMap::new();
    for block in scans.iter().flat_map(ScanCells::blocks) {
        for bit in 0..64 {
            let observation = if block.occupied >> bit & 1 == 1 {
                HIT
            } else if block.free >> bit & 1 == 1 {
                MISS
            } else {
                continue;
            };
            let value = voxels
                .entry(VoxelKey::from_morton(block.code << 6 | bit))
                .or_insert(0.0);
            *value = updated(*value, observation);
        }
    }
    voxels
}

/// Whether no eight leaves could be pruned and every inner node holds its children's highest value.
fn is_canonical(map: &OccupancyMap) -> bool {
    let mut blocks = vec![map.root];
    while let Some(node) = blocks.pop() {
        if let Kind::Inner(index) = node.kind() {
            let block = map.arena.block(index);
            let equal = block
                .iter()
                .all(|c| c.kind() == Kind::Leaf && *c == block[0]);
            if equal || map.arena.inner(index) != node {
                return false;
            }
            blocks.extend(block);
        }
    }
    true
}

fn cloud(half_m: f64) -> impl Strategy<Value = Vec<Point>> {
    let coordinate = move || -half_m..half_m;
    prop::collection::vec(
        [coordinate(), coordinate(), coordinate()].prop_map(Point::from),
        1..30,
    )
}

proptest! {
    #[test]
    fn every_voxel_gets_its_own_evidence(
        scans in prop::collection::vec((cloud(0.3), cloud(1.0)), 1..12),
    ) {
        let mut map = map(0.125);
        let cells: Vec<ScanCells> = scans
            .iter()
            .map(|(origin, points)| ScanCells::trace(&map.grid, &origin[0], points, None).unwrap())
            .collect();
        for cells in &cells {
            map.apply(cells);
        }
        let voxels = reference(&cells);
        for (key, log_odds) in &voxels {
            prop_assert_eq!(map.log_odds_at(*key), Some(*log_odds));
        }
        let volume: f64 = map.leaves().map(|l| (l.size_m / 0.125).powi(3)).sum();
        prop_assert_eq!(volume, voxels.len() as f64);
        prop_assert!(is_canonical(&map));
    }

    #[test]
    fn export_and_import_are_inverse(points in cloud(1.0)) {
        let mut map = map(0.125);
        map.insert_scan(&Point::origin(), &points, None).unwrap();
        let tree = map.to_tree();
        let read = OccupancyMap::from_tree(&tree).unwrap();
        prop_assert!(read.leaves().eq(map.leaves()));
        prop_assert_eq!(read.to_tree(), tree);
    }
}
