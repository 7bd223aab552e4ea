//! The data of a `.bt` file: per inner node 16 bits, little endian, of which bits 2i and 2i + 1
//! describe child i. Leaves have no bytes of their own.

use std::io::BufRead;

use credence_types::OccupancyNode;

use super::{
    DEPTH,
    likelihood::{LOG_ODDS_FREE, LOG_ODDS_OCCUPIED, is_occupied},
};
use crate::{bytes::exact, error::Fault};

const UNKNOWN: u16 = 0b00;
const FREE: u16 = 0b01;
const OCCUPIED: u16 = 0b10;
const INNER: u16 = 0b11;

/// The data of a tree that is known to be one.
pub(super) fn encode(nodes: &[OccupancyNode]) -> Vec<u8> {
    let mut data = Vec::new();
    let mut nodes = nodes.iter();
    if let Some(root) = nodes.next() {
        write(*root, &mut nodes, &mut data);
    }
    data
}

fn write<'a>(
    node: OccupancyNode,
    rest: &mut impl Iterator<Item = &'a OccupancyNode>,
    data: &mut Vec<u8>,
) {
    let at = data.len();
    data.extend([0; 2]);
    let mut bits = UNKNOWN;
    for i in (0..8).filter(|i| node.children & 1 << i != 0) {
        let Some(child) = rest.next() else { break };
        let state = if child.children != 0 {
            write(*child, rest, data);
            INNER
        } else if is_occupied(child.log_odds) {
            OCCUPIED
        } else {
            FREE
        };
        bits |= state << (2 * i);
    }
    data[at..at + 2].copy_from_slice(&bits.to_le_bytes());
}

pub(super) fn decode(
    source: &mut impl BufRead,
    declared: u64,
) -> Result<Vec<OccupancyNode>, Fault> {
    let mut nodes = Vec::new();
    read(source, &mut nodes, declared, 0)?;
    Ok(nodes)
}

/// Appends an inner node and all below it; returns its log-odds.
fn read(
    source: &mut impl BufRead,
    nodes: &mut Vec<OccupancyNode>,
    declared: u64,
    depth: u32,
) -> Result<f32, Fault> {
    let index = nodes.len();
    if depth == DEPTH {
        let what = format!("node {index} has children below the {DEPTH}th level");
        return Fault::damaged(what);
    }
    let bits = u16::from_le_bytes(exact(source)?);
    let state = |i: u32| bits >> (2 * i) & INNER;
    // A root without children stands for a single leaf, which OctoMap reads as occupied.
    if bits == 0 && depth > 0 {
        return Fault::damaged(format!("inner node {index} has no children"));
    }
    nodes.push(OccupancyNode {
        log_odds: LOG_ODDS_OCCUPIED,
        children: (0..8).fold(0, |mask, i| mask | u8::from(state(i) != UNKNOWN) << i),
    });
    let mut highest: Option<f32> = None;
    for i in 0..8 {
        let log_odds = match state(i) {
            UNKNOWN => continue,
            INNER => read(source, nodes, declared, depth + 1)?,
            leaf => {
                let log_odds = if leaf == OCCUPIED {
                    LOG_ODDS_OCCUPIED
                } else {
                    LOG_ODDS_FREE
                };
                nodes.push(OccupancyNode {
                    log_odds,
                    children: 0,
                });
                log_odds
            }
        };
        highest = Some(highest.map_or(log_odds, |h| h.max(log_odds)));
    }
    if nodes.len() as u64 > declared {
        let what = format!("the tree has more than the {declared} nodes that the header says");
        return Fault::damaged(what);
    }
    let log_odds = highest.unwrap_or(LOG_ODDS_OCCUPIED);
    nodes[index].log_odds = log_odds;
    Ok(log_odds)
}
