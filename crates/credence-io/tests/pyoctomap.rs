//! Files that pyoctomap wrote (see `data/README.md`), against ours of the same trees.

use std::{fs, path::PathBuf};

use credence_io::{read_octomap, read_point_cloud, write_bt, write_ot};
use credence_types::OccupancyNode;

fn data(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data");
    folder.join(name)
}

/// Number of nodes in the `.ot` and the `.bt` file, by pyoctomap's count.
const TREES: [(&str, usize, usize); 5] = [
    ("empty", 0, 0),
    ("one", 17, 17),
    ("scan", 540, 516),
    ("merging", 46, 30),
    ("stopping", 39, 39),
];

#[test]
fn one_voxel_lies_where_it_was_seen() {
    // The voxel at key (32768, 32768, 32768): the root's upper child, then always the lower ones.
    let node = |children| OccupancyNode {
        log_odds: (0.7_f64 / 0.3).ln() as f32,
        children,
    };
    let mut nodes = vec![node(0x80)];
    nodes.extend([node(0x01); 15]);
    nodes.push(node(0));
    let tree = read_octomap(data("one.ot")).unwrap();
    assert_eq!(tree.resolution_m, 0.1);
    assert_eq!(tree.nodes, nodes);
}

#[test]
fn our_files_are_those_of_pyoctomap() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ours");
    for (name, full_nodes, binary_nodes) in TREES {
        let full = read_octomap(data(&format!("{name}.ot"))).unwrap();
        let binary = read_octomap(data(&format!("{name}.bt"))).unwrap();
        assert_eq!(full.nodes.len(), full_nodes, "{name}");
        assert_eq!(binary.nodes.len(), binary_nodes, "{name}");
        let theirs = |ending: &str| fs::read(data(&format!("{name}.{ending}"))).unwrap();
        write_ot(&full, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), theirs("ot"), "{name}.ot");
        write_bt(&full, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), theirs("bt"), "{name}.bt");
        write_bt(&binary, &path).unwrap();
        assert_eq!(
            fs::read(&path).unwrap(),
            theirs("bt"),
            "{name}.bt from itself"
        );
    }
}

#[test]
fn faults_of_the_system_name_the_file() {
    let missing = data("missing.bt");
    for message in [
        read_octomap(&missing).unwrap_err().to_string(),
        read_point_cloud(&missing).unwrap_err().to_string(),
    ] {
        assert!(message.starts_with("cannot read "), "{message}");
        assert!(message.contains("missing.bt"), "{message}");
        assert!(message.contains("check that the file exists"), "{message}");
    }
}
