//! The data of a `.ot` file: per node its log-odds as f32, little endian, and a byte whose bit i
//! says whether child i follows.

use std::io::{self, BufRead, Write};

use credence_types::OccupancyNode;

use super::DEPTH;
use crate::{bytes::exact, error::Fault};

pub(super) fn encode(nodes: &[OccupancyNode], out: &mut dyn Write) -> io::Result<()> {
    for node in nodes {
        let [a, b, c, d] = node.log_odds.to_le_bytes();
        out.write_all(&[a, b, c, d, node.children])?;
    }
    Ok(())
}

pub(super) fn decode(
    source: &mut impl BufRead,
    declared: u64,
) -> Result<Vec<OccupancyNode>, Fault> {
    let mut nodes = Vec::new();
    read(source, &mut nodes, declared, 0)?;
    Ok(nodes)
}

fn read(
    source: &mut impl BufRead,
    nodes: &mut Vec<OccupancyNode>,
    declared: u64,
    depth: u32,
) -> Result<(), Fault> {
    let index = nodes.len();
    if index as u64 == declared {
        let what = format!("the tree has more than the {declared} nodes that the header says");
        return Fault::damaged(what);
    }
    let [a, b, c, d, children] = exact(source)?;
    let log_odds = f32::from_le_bytes([a, b, c, d]);
    if !log_odds.is_finite() {
        return Fault::damaged(format!("node {index} has log-odds {log_odds}"));
    }
    if children != 0 && depth == DEPTH {
        let what = format!("node {index} has children below the {DEPTH}th level");
        return Fault::damaged(what);
    }
    nodes.push(OccupancyNode { log_odds, children });
    for _ in 0..children.count_ones() {
        read(source, nodes, declared, depth + 1)?;
    }
    Ok(())
}
