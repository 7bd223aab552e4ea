//! The pictures that `harness training-pictures` renders, read one at a time.

use std::{
    fs::{self, File},
    io::{self, Read as _, Seek as _, SeekFrom},
    path::{Path, PathBuf},
};

use credence_nn::rgbd::{HEIGHT, RgbdImage, WIDTH};
use credence_types::Category;
use safetensors::{Dtype, tensor::Metadata};
use serde::Deserialize;

use crate::TrainError;

/// Version of the files that this reads.
const FORMAT: u64 = 1;
/// Objects that a picture may hold.
const MOST_OBJECTS: usize = 16;
const PIXELS: usize = WIDTH * HEIGHT;
/// Metres of the unit of depth.
const DEPTH_UNIT_M: f32 = 1e-4;
/// Largest header that is believed.
const MOST_HEADER: u64 = 1 << 20;

/// A picture with what it truly shows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LabelledPicture {
    pub(crate) image: RgbdImage,
    /// Number of the object that each pixel shows, from 1; 0 for none.
    pub(crate) owners: Vec<u8>,
    /// Category of each object, by its number.
    pub(crate) categories: Vec<Option<Category>>,
}

/// A folder of pictures.
#[derive(Debug)]
pub(crate) struct PictureSet {
    shards: Vec<Shard>,
    manifest: Manifest,
}

#[derive(Debug, Deserialize)]
struct Manifest {
    format: u64,
    seed: u64,
    count: usize,
    pictures_per_shard: usize,
    objects: Objects,
    git: Git,
}

#[derive(Debug, Deserialize)]
struct Objects {
    sha256: String,
}

#[derive(Debug, Deserialize)]
struct Git {
    revision: Option<String>,
}

/// A file of pictures and where its tensors begin.
#[derive(Debug)]
struct Shard {
    path: PathBuf,
    starts: [u64; TENSORS.len()],
}

/// Names, types and bytes per picture of a shard's tensors.
const TENSORS: [(&str, Dtype, usize); 4] = [
    ("rgb", Dtype::U8, 3 * PIXELS),
    ("depth", Dtype::U16, 2 * PIXELS),
    ("instances", Dtype::U8, PIXELS),
    ("classes", Dtype::U8, MOST_OBJECTS),
];
/// Shapes of a picture's part of them.
const SHAPES: [&[usize]; TENSORS.len()] = [
    &[HEIGHT, WIDTH, 3],
    &[HEIGHT, WIDTH],
    &[HEIGHT, WIDTH],
    &[MOST_OBJECTS],
];

impl PictureSet {
    /// Opens a folder; every file's layout is checked.
    ///
    /// # Errors
    /// No folder of pictures, or one with a file missing or damaged.
    pub(crate) fn open(folder: &Path) -> Result<Self, TrainError> {
        let path = folder.join("manifest.json");
        let refused = |why: String| TrainError::Pictures {
            path: path.clone(),
            why,
        };
        let text = fs::read_to_string(&path).map_err(|error| refused(error.to_string()))?;
        let manifest: Manifest =
            serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
        if manifest.format != FORMAT {
            let found = manifest.format;
            return Err(refused(format!("it has format {found}, not {FORMAT}")));
        }
        let (count, per_shard) = (manifest.count, manifest.pictures_per_shard);
        if count == 0 || per_shard == 0 {
            return Err(refused("it tells of no pictures".to_owned()));
        }
        let shards = (0..count.div_ceil(per_shard)).map(|number| {
            let pictures = per_shard.min(count - number * per_shard);
            Shard::open(
                folder.join(format!("shard-{number:05}.safetensors")),
                pictures,
            )
        });
        Ok(Self {
            shards: shards.collect::<Result<_, _>>()?,
            manifest,
        })
    }

    /// What the pictures are, for the provenance: their number, their seed, the hash of the meshes'
    /// manifest, the revision that rendered them.
    pub(crate) fn description(&self) -> [(&'static str, String); 4] {
        let Manifest {
            seed,
            count,
            objects,
            git,
            ..
        } = &self.manifest;
        let revision = git.revision.as_deref().unwrap_or("unknown");
        [
            ("count", count.to_string()),
            ("seed", seed.to_string()),
            ("meshes_sha256", objects.sha256.clone()),
            ("git_revision", revision.to_owned()),
        ]
    }

    /// Number of pictures.
    pub(crate) const fn len(&self) -> usize {
        self.manifest.count
    }

    /// Reads a picture.
    ///
    /// # Errors
    /// No such picture, a file that cannot be read, a category that is none.
    pub(crate) fn get(&self, index: usize) -> Result<LabelledPicture, TrainError> {
        let (count, per_shard) = (self.len(), self.manifest.pictures_per_shard);
        let shard = self.shards.get(index / per_shard);
        let shard = shard
            .filter(|_| index < count)
            .ok_or(TrainError::PictureIndex { index, count })?;
        shard.read(index % per_shard)
    }
}

impl Shard {
    fn open(path: PathBuf, pictures: usize) -> Result<Self, TrainError> {
        match starts(&path, pictures) {
            Ok(starts) => Ok(Self { path, starts }),
            Err(why) => Err(TrainError::Pictures { path, why }),
        }
    }

    fn read(&self, picture: usize) -> Result<LabelledPicture, TrainError> {
        let refused = |why: String| TrainError::Pictures {
            path: self.path.clone(),
            why,
        };
        let [rgb, depth, owners, classes] =
            self.bytes(picture).map_err(|e| refused(e.to_string()))?;
        let depth_m = depth.as_chunks::<2>().0.iter().map(|unit| {
            let unit = u16::from_le_bytes(*unit);
            if unit == 0 {
                f32::NAN
            } else {
                f32::from(unit) * DEPTH_UNIT_M
            }
        });
        if let Some(class) = classes
            .iter()
            .find(|c| usize::from(**c) > Category::ALL.len())
        {
            return Err(refused(format!("it has the class {class}")));
        }
        if let Some(owner) = owners.iter().find(|o| usize::from(**o) > MOST_OBJECTS) {
            return Err(refused(format!("it has an object {owner}")));
        }
        Ok(LabelledPicture {
            image: RgbdImage {
                rgb: rgb.as_chunks::<3>().0.to_vec(),
                depth_m: depth_m.collect(),
            },
            owners,
            categories: classes.into_iter().map(Category::from_class).collect(),
        })
    }

    /// A picture's bytes of each tensor.
    fn bytes(&self, picture: usize) -> io::Result<[Vec<u8>; TENSORS.len()]> {
        let mut file = File::open(&self.path)?;
        let mut all = [const { Vec::new() }; TENSORS.len()];
        for ((bytes, start), (_, _, size)) in all.iter_mut().zip(self.starts).zip(TENSORS) {
            file.seek(SeekFrom::Start(start + (picture * size) as u64))?;
            bytes.resize(size, 0);
            file.read_exact(bytes)?;
        }
        Ok(all)
    }
}

/// Where a file's tensors begin, if they are what they should be.
fn starts(path: &Path, pictures: usize) -> Result<[u64; TENSORS.len()], String> {
    let said = |error: io::Error| error.to_string();
    let mut file = File::open(path).map_err(said)?;
    let length = file.metadata().map_err(said)?.len();
    let mut size = [0; 8];
    file.read_exact(&mut size).map_err(said)?;
    let header = u64::from_le_bytes(size);
    if header > MOST_HEADER.min(length) {
        return Err(format!("its header claims {header} bytes"));
    }
    let mut bytes = Vec::new();
    file.take(header).read_to_end(&mut bytes).map_err(said)?;
    // The crate's own reader wants the whole file in memory.
    let metadata: Metadata = serde_json::from_slice(&bytes).map_err(|e| e.to_string())?;
    let data = 8 + header;
    let mut starts = [0; TENSORS.len()];
    for ((start, (name, dtype, size)), shape) in starts.iter_mut().zip(TENSORS).zip(SHAPES) {
        let info = metadata
            .info(name)
            .ok_or_else(|| format!("it has no tensor '{name}'"))?;
        let shape: Vec<usize> = [pictures].iter().chain(shape).copied().collect();
        let (from, to) = info.data_offsets;
        let bytes = pictures.checked_mul(size);
        if info.dtype != dtype || info.shape != shape || to.checked_sub(from) != bytes {
            return Err(format!(
                "its tensor '{name}' is {:?} of {:?}, not {shape:?} of {dtype:?}",
                info.shape, info.dtype
            ));
        }
        if data.checked_add(to as u64).is_none_or(|end| end > length) {
            return Err(format!("it ends before the end of its tensor '{name}'"));
        }
        *start = data + from as u64;
    }
    Ok(starts)
}

#[cfg(test)]
pub(super) mod tests {
    use std::collections::HashMap;

    use safetensors::tensor::{TensorView, serialize};

    use super::*;

    /// Writes a folder of pictures as the generator does, in files of two: on a plain table the
    /// `k`-th shows a square of 60 pixels, of category `k`, which gets darker from picture to picture.
    pub(in crate::segment) fn write(folder: &Path, count: usize) {
        let manifest = format!(
            r#"{{"format": 1, "seed": 7, "count": {count}, "pictures_per_shard": 2,
                "objects": {{"folder": "train", "sha256": "ab12"}}, "git": {{"revision": null}}}}"#
        );
        fs::write(folder.join("manifest.json"), manifest).unwrap();
        for first in (0..count).step_by(2) {
            let numbers: Vec<usize> = (first..(first + 2).min(count)).collect();
            let name = format!("shard-{:05}.safetensors", first / 2);
            fs::write(folder.join(name), shard(&numbers)).unwrap();
        }
    }

    fn shard(numbers: &[usize]) -> Vec<u8> {
        let (mut rgb, mut depth) = (Vec::new(), Vec::new());
        let (mut owners, mut classes) = (Vec::new(), Vec::new());
        for number in numbers {
            for pixel in 0..PIXELS {
                let (column, row) = (pixel % WIDTH, pixel / WIDTH);
                let inside = (100..160).contains(&column) && (80..140).contains(&row);
                owners.push(u8::from(inside));
                rgb.extend(if inside {
                    [200 - *number as u8, 10, 10]
                } else {
                    [90; 3]
                });
                let depth_m: u16 = if pixel == 0 { 0 } else { 5000 };
                depth.extend(depth_m.to_le_bytes());
            }
            classes.push((number % 6) as u8 + 1);
            classes.extend([0; MOST_OBJECTS - 1]);
        }
        let n = numbers.len();
        let view = |dtype, shape: Vec<usize>, data| TensorView::new(dtype, shape, data).unwrap();
        let tensors = HashMap::from([
            ("rgb", view(Dtype::U8, vec![n, HEIGHT, WIDTH, 3], &rgb)),
            ("depth", view(Dtype::U16, vec![n, HEIGHT, WIDTH], &depth)),
            (
                "instances",
                view(Dtype::U8, vec![n, HEIGHT, WIDTH], &owners),
            ),
            ("classes", view(Dtype::U8, vec![n, MOST_OBJECTS], &classes)),
        ]);
        serialize(tensors, None).unwrap()
    }

    #[test]
    fn every_picture_is_read_from_its_place() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), 5);
        let set = PictureSet::open(folder.path()).unwrap();
        assert_eq!(set.len(), 5);
        for number in 0..5 {
            let picture = set.get(number).unwrap();
            assert_eq!(
                picture.categories[0],
                Category::from_class(number as u8 + 1)
            );
            assert_eq!(picture.categories[1..], [None; 15]);
            let inside = 80 * WIDTH + 100;
            assert_eq!(picture.image.rgb[inside], [200 - number as u8, 10, 10]);
            assert_eq!(picture.owners[inside - 1..=inside], [0, 1]);
            assert!(picture.image.depth_m[0].is_nan());
            assert!((picture.image.depth_m[1] - 0.5).abs() < 1e-6);
        }
        let message = set.get(5).unwrap_err().to_string();
        assert!(message.contains("there is no picture 5"), "{message}");
    }

    #[test]
    fn what_is_missing_or_damaged_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let message = || PictureSet::open(folder.path()).unwrap_err().to_string();
        assert!(message().contains("manifest.json"), "{}", message());
        write(folder.path(), 3);
        let last = folder.path().join("shard-00001.safetensors");
        let bytes = fs::read(&last).unwrap();
        for length in [0, 7, 8, 100, bytes.len() - 1] {
            fs::write(&last, &bytes[..length]).unwrap();
            assert!(
                message().contains("shard-00001.safetensors"),
                "{}",
                message()
            );
        }
        for hostile in [u64::MAX, 1 << 19] {
            let mut bytes = bytes.clone();
            bytes[..8].copy_from_slice(&hostile.to_le_bytes());
            fs::write(&last, &bytes).unwrap();
            assert!(message().contains("shard-00001"), "{}", message());
        }
        // A file of two pictures where one is told of.
        fs::copy(folder.path().join("shard-00000.safetensors"), &last).unwrap();
        assert!(
            message().contains("not [1, 240, 320, 3] of U8"),
            "{}",
            message()
        );
        fs::remove_file(&last).unwrap();
        assert!(
            message().contains("harness training-pictures"),
            "{}",
            message()
        );
        fs::write(folder.path().join("manifest.json"), "{\"format\": 9}").unwrap();
        assert!(message().contains("manifest.json"), "{}", message());
    }
}
