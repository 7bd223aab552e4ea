mod laws;

use std::path::Path;

use credence_types::OccupancyNode;

use super::*;
use crate::octomap::likelihood::{LOG_ODDS_FREE, LOG_ODDS_OCCUPIED};

const fn leaf(log_odds: f32) -> OccupancyNode {
    OccupancyNode {
        log_odds,
        children: 0,
    }
}

const fn inner(children: u8) -> OccupancyNode {
    OccupancyNode {
        log_odds: 0.5,
        children,
    }
}

fn tree(nodes: Vec<OccupancyNode>) -> OccupancyTree {
    OccupancyTree {
        resolution_m: 0.1,
        nodes,
    }
}

/// The bytes that a writer makes of a tree.
fn bytes(tree: &OccupancyTree, write: fn(&OccupancyTree, &Path) -> Result<(), IoError>) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree");
    write(tree, &path).unwrap();
    std::fs::read(path).unwrap()
}

fn bt(tree: &OccupancyTree) -> Vec<u8> {
    bytes(tree, |tree, path| write_bt(tree, path))
}

fn ot(tree: &OccupancyTree) -> Vec<u8> {
    bytes(tree, |tree, path| write_ot(tree, path))
}

fn data(bytes: &[u8]) -> &[u8] {
    let start = bytes.windows(6).position(|w| w == b"\ndata\n").unwrap();
    &bytes[start + 6..]
}

fn read(mut bytes: &[u8]) -> Result<OccupancyTree, String> {
    parse(&mut bytes).map_err(|fault| fault.in_file(Path::new("map.bt")).to_string())
}

fn fault(bytes: &[u8]) -> String {
    let message = read(bytes).unwrap_err();
    assert!(message.starts_with("map.bt "), "{message}");
    message
}

fn file(kind: &str, header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = format!("# Octomap OcTree {kind}\n{header}\ndata\n").into_bytes();
    bytes.extend(data);
    bytes
}

fn refusal(tree: &OccupancyTree) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree");
    let message = write_ot(tree, &path).unwrap_err().to_string();
    assert_eq!(write_bt(tree, &path).unwrap_err().to_string(), message);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    assert!(message.contains("tree was not written: "), "{message}");
    message
}

#[test]
fn clamps_are_those_of_octomap() {
    for (log_odds, p) in [(LOG_ODDS_FREE, 0.1192), (LOG_ODDS_OCCUPIED, 0.971_f64)] {
        assert_eq!(log_odds, (p / (1.0 - p)).ln() as f32);
    }
}

#[test]
fn two_bits_a_child() {
    // Child 0 free, child 1 at the threshold, child 7 an inner node whose child 4 is occupied.
    let tree = tree(vec![
        inner(0b1000_0011),
        leaf(-0.4),
        leaf(0.0),
        inner(0b1_0000),
        leaf(2.0),
    ]);
    let bytes = bt(&tree);
    assert_eq!(data(&bytes), [0b1001, 0b1100_0000, 0, 0b10]);
    let nodes = read(&bytes).unwrap().nodes;
    let high = |children| OccupancyNode {
        log_odds: LOG_ODDS_OCCUPIED,
        children,
    };
    assert_eq!(
        nodes,
        [
            high(0b1000_0011),
            leaf(LOG_ODDS_FREE),
            high(0),
            high(0b1_0000),
            high(0)
        ]
    );
}

#[test]
fn an_inner_node_has_the_highest_log_odds_of_its_children() {
    let nodes = read(&bt(&tree(vec![inner(0b11), leaf(-1.0), leaf(-2.0)]))).unwrap();
    assert_eq!(nodes.nodes[0].log_odds, LOG_ODDS_FREE);
}

#[test]
fn a_lone_root_keeps_its_state() {
    let occupied = bt(&tree(vec![leaf(1.0)]));
    assert_eq!(data(&occupied), [0, 0]);
    assert_eq!(read(&occupied).unwrap().nodes, [leaf(LOG_ODDS_OCCUPIED)]);

    let free = read(&bt(&tree(vec![leaf(-1.0)]))).unwrap().nodes;
    assert_eq!(free[0].children, 0xff);
    assert_eq!(free[1..], [leaf(LOG_ODDS_FREE); 8]);
}

#[test]
fn an_empty_map_has_no_data() {
    for bytes in [bt(&tree(vec![])), ot(&tree(vec![]))] {
        assert_eq!(data(&bytes), b"");
        assert_eq!(read(&bytes).unwrap(), tree(vec![]));
    }
}

/// Nodes from the root to a leaf `depth` levels down.
fn chain(depth: usize) -> Vec<OccupancyNode> {
    let mut nodes = vec![inner(1); depth];
    nodes.push(leaf(1.0));
    nodes
}

#[test]
fn sixteen_levels_and_not_one_more() {
    let deepest = tree(chain(16));
    assert_eq!(read(&ot(&deepest)).unwrap(), deepest);
    assert_eq!(read(&bt(&deepest)).unwrap().nodes.len(), 17);
    let message = refusal(&tree(chain(17)));
    assert!(
        message.contains("node 16 of the occupancy tree has children below"),
        "{message}"
    );

    let header = "id OcTree\nsize 18\nres 0.1";
    let full: Vec<u8> = [0, 0, 0, 0, 1].repeat(40);
    let message = fault(&file("file", header, &full));
    assert!(
        message.contains("node 16 has children below the 16th level"),
        "{message}"
    );
    let message = fault(&file("binary file", header, &[3, 0].repeat(40)));
    assert!(
        message.contains("node 16 has children below the 16th level"),
        "{message}"
    );
}

#[test]
fn refuses_what_is_no_tree() {
    let message = refusal(&tree(vec![inner(0b11), leaf(1.0)]));
    assert!(
        message.contains("node 2 of the occupancy tree is missing; export"),
        "{message}"
    );
    let message = refusal(&tree(vec![leaf(1.0), leaf(1.0)]));
    assert!(
        message.contains("node 1 of the occupancy tree belongs to no parent"),
        "{message}"
    );
    let message = refusal(&tree(vec![leaf(f32::NAN)]));
    assert!(
        message.contains("log-odds that are not finite"),
        "{message}"
    );
    for resolution_m in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let message = refusal(&OccupancyTree {
            resolution_m,
            nodes: vec![],
        });
        assert!(
            message.contains(&format!("edge is {resolution_m}; give")),
            "{message}"
        );
    }
}

#[test]
fn says_what_is_wrong_with_a_header() {
    let cases: [(&str, &str); 10] = [
        (
            "id ColorOcTree\nsize 0\nres 1",
            "a tree of type 'ColorOcTree'; convert it",
        ),
        ("size 0\nres 1", "no 'id'"),
        ("id OcTree\nres 1", "no 'size'"),
        ("id OcTree\nsize 0", "no 'res'"),
        (
            "id OcTree\nsize -1\nres 1",
            "size '-1' is not a number of nodes",
        ),
        (
            "id OcTree\nsize 0\nres 0",
            "resolution '0' is not a positive",
        ),
        (
            "id OcTree\nsize 0\nres -0.1",
            "resolution '-0.1' is not a positive",
        ),
        (
            "id OcTree\nsize 0\nres nan",
            "resolution 'nan' is not a positive",
        ),
        (
            "id OcTree\nsize 0\nres inf",
            "resolution 'inf' is not a positive",
        ),
        (
            "id OcTree\nsize 0\nresolution 1",
            "header line 'resolution 1' is not understood",
        ),
    ];
    for (header, expected) in cases {
        let message = fault(&file("file", header, b""));
        assert!(message.contains(expected), "{message}");
    }
    for wrong in [&b""[..], b"ply\n", b"# Octomap OcTree", &[0; 10_000]] {
        let message = fault(wrong);
        assert!(
            message.contains("pass an OctoMap .bt or .ot file"),
            "{message}"
        );
    }
    let long = format!("id OcTree\n#{}", " ".repeat(5000));
    let message = fault(&file("file", &long, b""));
    assert!(
        message.contains("a header line is longer than 4096 bytes"),
        "{message}"
    );
}

#[test]
fn says_what_is_wrong_with_the_data() {
    let header = |size: u64| format!("id OcTree\nsize {size}\nres 0.1");
    let full = |size, data: &[u8]| fault(&file("file", &header(size), data));
    let binary = |size, data: &[u8]| fault(&file("binary file", &header(size), data));
    let leaf = [0, 0, 0x80, 0x3f, 0];

    assert!(full(0, &leaf).contains("bytes follow where the data should end"));
    assert!(full(1, &[&leaf[..], b"\n"].concat()).contains("bytes follow"));
    assert!(full(2, &leaf).contains("the tree has 1 nodes, but the header says 2"));
    assert!(full(1, &[0, 0, 0, 0, 1, 0]).contains("more than the 1 nodes"));
    assert!(full(u64::MAX, &leaf[..4]).contains("it ends too early; write or copy it again"));
    let infinite = [f32::INFINITY, f32::NAN];
    for (value, name) in infinite.into_iter().zip(["inf", "NaN"]) {
        let data = [&value.to_le_bytes()[..], &[0]].concat();
        assert!(full(1, &data).contains(&format!("node 0 has log-odds {name}")));
    }

    assert!(binary(0, &[0, 0]).contains("bytes follow"));
    assert!(binary(2, &[1, 0, 0]).contains("bytes follow"));
    assert!(binary(9, &[1, 0]).contains("the tree has 2 nodes, but the header says 9"));
    assert!(binary(2, &[0b101, 0]).contains("more than the 2 nodes"));
    assert!(binary(3, &[3, 0, 0, 0]).contains("inner node 1 has no children"));
    assert!(binary(u64::MAX, &[3, 0]).contains("it ends too early"));
}

#[test]
fn no_prefix_of_a_file_is_one() {
    let nodes = vec![
        inner(0b1000_0011),
        leaf(-0.4),
        leaf(0.0),
        inner(0b1_0000),
        leaf(2.0),
    ];
    for bytes in [bt(&tree(nodes.clone())), ot(&tree(nodes))] {
        assert!(read(&bytes).is_ok());
        for length in 0..bytes.len() {
            fault(&bytes[..length]);
        }
    }
}
