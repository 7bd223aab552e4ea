//! Scenes on disk and in memory.

use std::{
    fs, io,
    ops::Range,
    path::Path,
    sync::atomic::{AtomicUsize, Ordering},
};

use credence_nn::weights::write_file;
use rayon::prelude::*;

use super::{
    Scene, codec,
    mesh_set::{Fingerprint, MeshSet},
};
use crate::TrainError;

/// Scenes per file.
const SHARD_SCENES: usize = 1000;
const MAGIC: [u8; 8] = *b"CRDSCENE";
/// Rises with every change of what a scene holds or how it is drawn.
const VERSION: u64 = 2;
/// Magic, version, seed, the meshes' fingerprint, first scene, number of scenes.
const HEADER_BYTES: usize = 6 * 8;
/// The checksum at a file's end.
const CHECKSUM_BYTES: usize = 8;

/// Scenes 0 to `count` of a seed, held in memory as they are on disk: about 45 kB each.
///
/// Coordinates and distances are rounded to 0.05 mm. The files are the same, byte for byte, for
/// any number of threads, and whether they were made at once or after an interruption.
#[derive(Debug)]
pub struct SceneCache {
    shards: Vec<Shard>,
    per_shard: usize,
    count: usize,
}

/// A file's scenes: where each begins and ends in its bytes.
#[derive(Debug)]
struct Shard {
    bytes: Vec<u8>,
    scenes: Vec<Range<usize>>,
}

impl SceneCache {
    /// Loads the scenes from a folder; those that are missing there, or in files cut short, are
    /// generated and written first. `progress` is told, from any thread, how many of them exist.
    ///
    /// # Errors
    /// Files of another seed, other meshes or another version; a folder that cannot be read or
    /// written; meshes that no scene can be made of.
    pub fn open_or_generate(
        folder: &Path,
        meshes: &MeshSet,
        count: usize,
        seed: u64,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Self, TrainError> {
        Self::with_shards_of(SHARD_SCENES, folder, meshes, count, seed, progress)
    }

    pub(super) fn with_shards_of(
        per_shard: usize,
        folder: &Path,
        meshes: &MeshSet,
        count: usize,
        seed: u64,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Self, TrainError> {
        fs::create_dir_all(folder).map_err(|source| TrainError::Write {
            path: folder.to_path_buf(),
            source,
        })?;
        let mut shards = Vec::new();
        for (number, first) in (0..count).step_by(per_shard).enumerate() {
            let header = Header {
                seed,
                meshes: meshes.fingerprint(),
                first,
                count: per_shard.min(count - first),
            };
            let path = folder.join(format!("scenes-{number:05}.bin"));
            let shard = match load(&path, &header)? {
                Some(shard) => shard,
                None => generate(&path, &header, meshes, &|done| progress(first + done))?,
            };
            progress(first + header.count);
            shards.push(shard);
        }
        Ok(Self {
            shards,
            per_shard,
            count,
        })
    }

    /// Number of scenes.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether it was made for no scenes.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// One scene.
    ///
    /// # Errors
    /// An index past the last scene.
    pub fn get(&self, index: usize) -> Result<Scene, TrainError> {
        let scene = (index < self.count)
            .then(|| &self.shards[index / self.per_shard])
            .and_then(|shard| {
                shard
                    .bytes
                    .get(shard.scenes[index % self.per_shard].clone())
            });
        scene.and_then(codec::decode).ok_or(TrainError::SceneIndex {
            index,
            count: self.count,
        })
    }
}

/// What a file must be.
struct Header {
    seed: u64,
    meshes: u64,
    first: usize,
    count: usize,
}

impl Header {
    /// All but the number of scenes.
    fn identity(&self) -> [u64; 5] {
        let magic = u64::from_le_bytes(MAGIC);
        [magic, VERSION, self.seed, self.meshes, self.first as u64]
    }
}

/// Reads a file; `None` when it is missing, damaged or has too few scenes.
fn load(path: &Path, header: &Header) -> Result<Option<Shard>, TrainError> {
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(err) if err.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(source) => {
            let path = path.to_path_buf();
            return Err(TrainError::Read { path, source });
        }
    };
    let (words, _) = bytes.as_chunks::<8>();
    let words = words.iter().map(|word| u64::from_le_bytes(*word));
    let found: Vec<u64> = words.take(HEADER_BYTES / 8).collect();
    let &[magic, version, seed, of_meshes, first, count] = found.as_slice() else {
        return Ok(None);
    };
    if [magic, version, seed, of_meshes, first] != header.identity() {
        return Err(TrainError::OtherCache {
            path: path.to_path_buf(),
        });
    }
    if count < header.count as u64 || !is_whole(&bytes) {
        return Ok(None);
    }
    Ok(Shard::new(bytes, header.count))
}

impl Shard {
    /// Finds the first `count` scenes in a file's bytes: each after its length as u32.
    fn new(bytes: Vec<u8>, count: usize) -> Option<Self> {
        let mut scenes = Vec::with_capacity(count);
        let mut at = HEADER_BYTES;
        for _ in 0..count {
            let length = bytes.get(at..)?.first_chunk::<4>()?;
            let begin = at + 4;
            at = begin.checked_add(u32::from_le_bytes(*length) as usize)?;
            scenes.push(begin..at);
        }
        (at + CHECKSUM_BYTES <= bytes.len()).then_some(Self { bytes, scenes })
    }
}

fn is_whole(bytes: &[u8]) -> bool {
    bytes
        .split_last_chunk::<CHECKSUM_BYTES>()
        .is_some_and(|(content, sum)| checksum(content) == *sum)
}

fn checksum(content: &[u8]) -> [u8; CHECKSUM_BYTES] {
    let mut sum = Fingerprint::default();
    sum.add(content);
    sum.0.to_le_bytes()
}

/// Makes a file's scenes and writes it.
fn generate(
    path: &Path,
    header: &Header,
    meshes: &MeshSet,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Shard, TrainError> {
    let done = AtomicUsize::new(0);
    let scenes: Vec<Vec<u8>> = (0..header.count)
        .into_par_iter()
        .map(|index| {
            let scene = Scene::generate(meshes, header.seed, (header.first + index) as u64)?;
            let mut bytes = Vec::new();
            codec::encode(&scene, &mut bytes);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(bytes)
        })
        .collect::<Result<_, TrainError>>()?;
    let mut bytes = Vec::with_capacity(scenes.iter().map(|scene| scene.len() + 4).sum());
    for word in header.identity().into_iter().chain([header.count as u64]) {
        bytes.extend(word.to_le_bytes());
    }
    for scene in scenes {
        bytes.extend((scene.len() as u32).to_le_bytes());
        bytes.extend(scene);
    }
    bytes.extend(checksum(&bytes));
    write_file(path, &bytes)?;
    Shard::new(bytes, header.count).ok_or(TrainError::SceneIndex {
        index: header.first,
        count: header.count,
    })
}
