use std::{
    fs,
    path::{Path, PathBuf},
};

use burn::{module::Module, optim::ModuleOptimizer, tensor::Bytes};
use credence_nn::weights;
use serde::{Deserialize, Serialize};

use crate::TrainError;

/// Checkpoints that are kept: the newest, and one before it should that be damaged.
const KEPT: usize = 2;

/// The line that a checkpoint begins with; the network's and the optimiser's bytes follow.
#[derive(Serialize, Deserialize)]
struct Header {
    step: u64,
    /// What run it belongs to.
    run: String,
    network_bytes: usize,
    optimizer_bytes: usize,
    /// Of both, so that a damaged file is known as such.
    checksum: u64,
}

/// A checkpoint's contents.
struct Parts {
    header: Header,
    network: Vec<u8>,
    optimizer: Vec<u8>,
}

/// Writes the state after a step and drops the oldest files.
pub(super) fn save<M: Module>(
    folder: &Path,
    run: &str,
    step: u64,
    network: &M,
    optimizer: &ModuleOptimizer,
) -> Result<(), TrainError> {
    let path = folder.join(format!("step-{step:08}.checkpoint"));
    // A network under training keeps the newest running statistics of its normalisations aside;
    // what it hands out without its gradients holds them.
    let network = weights::to_bytes(&network.valid())?;
    let optimizer = optimizer.into_bytes().map_err(|e| TrainError::Checkpoint {
        path: path.clone(),
        problem: e.to_string(),
    })?;
    let header = Header {
        step,
        run: run.to_owned(),
        network_bytes: network.len(),
        optimizer_bytes: optimizer.len(),
        checksum: checksum(&[&network, &optimizer]),
    };
    let mut bytes = serde_json::to_vec(&header).map_err(|e| TrainError::Checkpoint {
        path: path.clone(),
        problem: e.to_string(),
    })?;
    bytes.push(b'\n');
    bytes.extend_from_slice(&network);
    bytes.extend_from_slice(&optimizer);
    weights::write_file(&path, &bytes)?;
    for old in newest_first(folder)?.into_iter().skip(KEPT) {
        fs::remove_file(&old).map_err(|source| TrainError::Write { path: old, source })?;
    }
    Ok(())
}

/// Restores the newest whole checkpoint of this run; the step is 0 if there is none.
pub(super) fn resume<M: Module>(
    folder: &Path,
    run: &str,
    network: M,
    optimizer: ModuleOptimizer,
) -> Result<(u64, M, ModuleOptimizer), TrainError> {
    for path in newest_first(folder)? {
        let Some(Parts {
            header,
            network: network_bytes,
            optimizer: optimizer_bytes,
        }) = parts(&path)?
        else {
            super::note(&format!(
                "{} is damaged; trying an older one",
                path.display()
            ));
            continue;
        };
        if header.run != run {
            return Err(TrainError::OtherRun {
                path,
                found: header.run,
                wanted: run.to_owned(),
            });
        }
        let name = path.display().to_string();
        let network = weights::from_bytes(network, network_bytes, &name)?;
        let bytes = Bytes::from_bytes_vec(optimizer_bytes);
        let optimizer = optimizer
            .from_bytes(bytes)
            .map_err(|e| TrainError::Checkpoint {
                path,
                problem: e.to_string(),
            })?;
        return Ok((header.step, network, optimizer));
    }
    Ok((0, network, optimizer))
}

/// The parts of a checkpoint; `None` if it is damaged.
fn parts(path: &Path) -> Result<Option<Parts>, TrainError> {
    let bytes = fs::read(path).map_err(|source| TrainError::Read {
        path: path.to_path_buf(),
        source,
    })?;
    let split = || {
        let end = bytes.iter().position(|b| *b == b'\n')?;
        let header: Header = serde_json::from_slice(&bytes[..end]).ok()?;
        let (network, optimizer) = bytes[end + 1..].split_at_checked(header.network_bytes)?;
        let whole = optimizer.len() == header.optimizer_bytes
            && checksum(&[network, optimizer]) == header.checksum;
        whole.then(|| Parts {
            network: network.to_vec(),
            optimizer: optimizer.to_vec(),
            header,
        })
    };
    Ok(split())
}

fn newest_first(folder: &Path) -> Result<Vec<PathBuf>, TrainError> {
    let read = |source| TrainError::Read {
        path: folder.to_path_buf(),
        source,
    };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        if path.extension().is_some_and(|e| e == "checkpoint") {
            found.push(path);
        }
    }
    found.sort_unstable();
    found.reverse();
    Ok(found)
}

/// The 64-bit FNV-1a hash.
fn checksum(parts: &[&[u8]]) -> u64 {
    let bytes = parts.iter().copied().flatten();
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
