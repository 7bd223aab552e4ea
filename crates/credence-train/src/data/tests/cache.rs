//! Scenes on disk.

use std::{
    collections::BTreeMap,
    fs,
    path::Path,
    sync::atomic::{AtomicUsize, Ordering},
};

use super::{
    super::{MeshSet, Scene, SceneCache},
    boxes,
};
use crate::TrainError;

const COUNT: usize = 7;

fn open(
    folder: &Path,
    meshes: &MeshSet,
    count: usize,
    seed: u64,
) -> Result<SceneCache, TrainError> {
    SceneCache::with_shards_of(3, folder, meshes, count, seed, &|_| ())
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let file = |entry: fs::DirEntry| {
        let name = entry.file_name().into_string().unwrap();
        (name, fs::read(entry.path()).unwrap())
    };
    entries.map(file).collect()
}

fn scenes(cache: &SceneCache) -> Vec<Scene> {
    (0..cache.len())
        .map(|index| cache.get(index).unwrap())
        .collect()
}

#[test]
fn a_cache_holds_the_scenes_to_its_resolution() {
    let (_folder, meshes) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let most = AtomicUsize::new(0);
    let progress = |done| {
        most.fetch_max(done, Ordering::Relaxed);
    };
    let cache = SceneCache::with_shards_of(3, folder.path(), &meshes, COUNT, 1, &progress).unwrap();
    assert_eq!((cache.len(), most.into_inner()), (COUNT, COUNT));
    for index in 0..COUNT {
        let (kept, made) = (
            cache.get(index).unwrap(),
            Scene::generate(&meshes, 1, index as u64).unwrap(),
        );
        assert_eq!(kept.category, made.category);
        assert_eq!(kept.viewpoint, made.viewpoint);
        let pairs = kept
            .object
            .iter()
            .zip(&made.object)
            .chain(kept.queries.iter().zip(&made.queries));
        for (kept, made) in pairs {
            assert!(kept.iter().zip(made).all(|(a, b)| (a - b).abs() < 2.6e-5));
        }
    }
    let message = cache.get(COUNT).unwrap_err().to_string();
    assert!(message.starts_with("there is no scene 7; the cache holds scenes 0 to 7"));
    assert!(open(folder.path(), &meshes, 0, 1).unwrap().is_empty());
}

#[test]
fn threads_do_not_change_a_byte() {
    let (_folder, meshes) = boxes();
    let made_by = |threads| {
        let folder = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| open(folder.path(), &meshes, COUNT, 1))
            .unwrap();
        files(folder.path())
    };
    let files = made_by(1);
    assert_eq!(files.len(), 3);
    assert!(files == made_by(3));
}

#[test]
fn what_is_missing_or_damaged_is_made_again() {
    let (_folder, meshes) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let whole = scenes(&open(folder, &meshes, COUNT, 1).unwrap());
    let bytes = files(folder);
    let shard = folder.join("scenes-00001.bin");
    let mut flipped = bytes["scenes-00001.bin"].clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    let length = flipped.len();
    for damaged in [
        None,
        Some(0),
        Some(20),
        Some(60),
        Some(length - 1),
        Some(length),
    ] {
        match damaged {
            None => fs::remove_file(&shard).unwrap(),
            Some(length) => fs::write(&shard, &flipped[..length]).unwrap(),
        }
        let again = open(folder, &meshes, COUNT, 1).unwrap();
        assert!(
            scenes(&again) == whole && files(folder) == bytes,
            "{damaged:?}"
        );
    }
    // Sound files are left alone.
    let written = |path: &Path| fs::metadata(path).unwrap().modified().unwrap();
    let before = written(&shard);
    open(folder, &meshes, COUNT, 1).unwrap();
    assert_eq!(written(&shard), before);
}

#[test]
fn a_longer_cache_begins_with_a_shorter_one() {
    let (_folder, meshes) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let short = scenes(&open(folder.path(), &meshes, 4, 1).unwrap());
    let long = scenes(&open(folder.path(), &meshes, COUNT, 1).unwrap());
    assert!(long[..4] == short);
    let before = files(folder.path());
    assert!(scenes(&open(folder.path(), &meshes, 4, 1).unwrap()) == short);
    assert!(files(folder.path()) == before);
}

#[test]
fn other_scenes_are_refused() {
    let (mesh_folder, meshes) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    open(folder, &meshes, 1, 1).unwrap();
    let message = |meshes: &MeshSet, seed| open(folder, meshes, 1, seed).unwrap_err().to_string();
    let refusal = "scenes-00000.bin holds scenes of another seed, other meshes or another version; \
                   delete its folder or name another one";
    assert!(message(&meshes, 2).ends_with(refusal));
    fs::copy(
        mesh_folder.path().join("mug-0.ply"),
        mesh_folder.path().join("can-0.ply"),
    )
    .unwrap();
    let other = MeshSet::open(mesh_folder.path()).unwrap();
    assert!(message(&other, 1).ends_with(refusal));
    fs::write(folder.join("scenes-00000.bin"), [7; 500]).unwrap();
    assert!(message(&meshes, 1).ends_with(refusal));
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let (_folder, meshes) = boxes();
    let file = tempfile::NamedTempFile::new().unwrap();
    let message = open(&file.path().join("cache"), &meshes, 1, 1)
        .unwrap_err()
        .to_string();
    assert!(message.starts_with("cannot write ") && message.contains("permissions"));
}
