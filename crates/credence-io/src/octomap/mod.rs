//! `OctoMap` 1.9 files: a text header, then the tree depth first.

mod binary;
mod full;
mod header;
mod likelihood;
#[cfg(test)]
mod tests;

use std::{io::BufRead, path::Path};

use credence_types::OccupancyTree;
use header::{Header, Kind};

use crate::{
    IoError,
    atomic::write_file,
    bytes::{end, read_file},
    error::Fault,
};

const DEPTH: u32 = OccupancyTree::DEPTH;

/// Reads a `.bt` or `.ot` file; the header tells which it is.
///
/// A `.bt` file says only which leaves are occupied and which are free: they get `OctoMap`'s
/// clamps, ln(p/(1-p)) of 0.971 and 0.1192, and an inner node the highest of its children. A `.ot`
/// file gives every node's log-odds as they are.
///
/// # Errors
/// A file that cannot be read, is of another kind (a `ColorOcTree`, say), is cut off, goes on after
/// the tree or contradicts its header; a resolution that is not positive, log-odds that are not
/// finite, more than 16 levels.
pub fn read_octomap(path: impl AsRef<Path>) -> Result<OccupancyTree, IoError> {
    read_file(path.as_ref(), parse)
}

/// Writes which leaves are occupied and which are free: the `.bt` file that `OctoMap`'s
/// `writeBinary` makes of the same tree, byte for byte.
///
/// As there, a leaf of log-odds 0 is occupied, and equal siblings are pruned level by level up to
/// the first level where there are none, never into the root. Unlike there, a resolution is written
/// in full where six digits would change it, and a tree of a single free leaf is written as eight,
/// because `OctoMap` would read it back as occupied.
///
/// # Errors
/// A tree that is not one (see [`read_octomap`]); a file that cannot be written. Nothing is left
/// then.
pub fn write_bt(tree: &OccupancyTree, path: impl AsRef<Path>) -> Result<(), IoError> {
    let path = path.as_ref();
    check(tree, path)?;
    let nodes = likelihood::max_likelihood(&tree.nodes);
    let data = binary::encode(&nodes);
    write_file(path, |out| {
        Header::new(Kind::Binary, nodes.len(), tree.resolution_m).write(out)?;
        out.write_all(&data)
    })
}

/// Writes all log-odds: the `.ot` file that `OctoMap`'s `write` makes of the same tree, byte for
/// byte, except that a resolution is written in full where six digits would change it.
///
/// # Errors
/// A tree that is not one (see [`read_octomap`]); a file that cannot be written. Nothing is left
/// then.
pub fn write_ot(tree: &OccupancyTree, path: impl AsRef<Path>) -> Result<(), IoError> {
    let path = path.as_ref();
    check(tree, path)?;
    write_file(path, |out| {
        Header::new(Kind::Full, tree.nodes.len(), tree.resolution_m).write(out)?;
        full::encode(&tree.nodes, out)
    })
}

/// Refuses a tree that no reader would take back.
fn check(tree: &OccupancyTree, path: &Path) -> Result<(), IoError> {
    tree.check().map_err(|source| IoError::Invalid {
        path: path.to_path_buf(),
        source,
    })
}

fn parse(source: &mut impl BufRead) -> Result<OccupancyTree, Fault> {
    let header = Header::read(source)?;
    let nodes = match (header.nodes, header.kind) {
        (0, _) => Vec::new(),
        (declared, Kind::Binary) => binary::decode(source, declared)?,
        (declared, Kind::Full) => full::decode(source, declared)?,
    };
    if nodes.len() as u64 != header.nodes {
        let (found, declared) = (nodes.len(), header.nodes);
        let what = format!("the tree has {found} nodes, but the header says {declared}");
        return Fault::damaged(what);
    }
    end(source)?;
    Ok(OccupancyTree {
        resolution_m: header.resolution_m,
        nodes,
    })
}
