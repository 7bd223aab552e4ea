//! Files of weights: safetensors, written whole or not at all, read only if they fit.

use std::{
    collections::BTreeMap,
    io::{self, Write as _},
    path::Path,
};

use burn::{
    module::Module,
    store::{FloatCastAdapter, ModuleSnapshot as _, ModuleStore as _, SafetensorsStore},
    tensor::DType,
};
use tempfile::Builder;

use crate::{NnError, provenance};

/// Names and shapes of a network's tensors.
type Layout = BTreeMap<String, Vec<usize>>;

/// The network's weights as the bytes of a safetensors file.
///
/// # Errors
/// A tensor that the format cannot hold.
pub fn to_bytes<M: Module>(module: &M) -> Result<Vec<u8>, NnError> {
    bytes_as(module, DType::F32)
}

/// The same in half precision: half the bytes, three significant digits.
///
/// # Errors
/// A tensor that the format cannot hold.
pub fn to_half_bytes<M: Module>(module: &M) -> Result<Vec<u8>, NnError> {
    bytes_as(module, DType::F16)
}

fn bytes_as<M: Module>(module: &M, precision: DType) -> Result<Vec<u8>, NnError> {
    let corrupt = |error: &dyn std::fmt::Display| NnError::Corrupt {
        name: "the network in memory".to_owned(),
        why: error.to_string(),
    };
    // The format's own remarks are written in the order of a hash map: one is enough, and none of
    // them is read.
    let mut store = SafetensorsStore::from_bytes(None)
        .clear_metadata()
        .with_to_adapter(FloatCastAdapter::to(precision));
    store.collect_from(module).map_err(|e| corrupt(&e))?;
    store.get_bytes().map_err(|e| corrupt(&e))
}

/// Fills a network with the weights in `bytes`, of either precision; `name` says in messages what
/// they are.
///
/// # Errors
/// Bytes that are no whole safetensors file, weights of another network (by name or shape), or
/// weights that are not finite.
pub fn from_bytes<M: Module>(mut module: M, bytes: Vec<u8>, name: &str) -> Result<M, NnError> {
    let corrupt = |error: &dyn std::fmt::Display| NnError::Corrupt {
        name: name.to_owned(),
        why: error.to_string(),
    };
    let mut store = SafetensorsStore::from_bytes(Some(bytes))
        .with_from_adapter(FloatCastAdapter::to(DType::F32));
    let stored = store.get_all_tensors().map_err(|e| corrupt(&e))?;
    let mut found = Layout::new();
    for (tensor, values) in stored {
        found.insert(tensor.clone(), values.shape.to_vec());
        let data = burn::store::bridge::to_data(values).map_err(|e| corrupt(&e))?;
        let finite = |value: f32| value.is_finite();
        if !data.iter::<f32>().all(finite) {
            return Err(NnError::NonFiniteWeight {
                name: name.to_owned(),
                tensor: tensor.clone(),
            });
        }
    }
    let expected: Layout = module
        .collect(None, None, false)
        .into_iter()
        .map(|tensor| (tensor.name.clone(), tensor.shape.to_vec()))
        .collect();
    if let Some(why) = difference(&expected, &found) {
        return Err(NnError::OtherNetwork {
            name: name.to_owned(),
            why,
        });
    }
    module.load_from(&mut store).map_err(|e| corrupt(&e))?;
    Ok(module)
}

/// Writes the network's weights; a file of that name is replaced.
///
/// # Errors
/// The file cannot be written.
pub fn save<M: Module>(module: &M, path: &Path) -> Result<(), NnError> {
    write_file(path, &to_bytes(module)?)
}

/// Fills a network with the weights of a file, which must be the one that its
/// [`Provenance`](crate::Provenance) tells of, if that lies beside it.
///
/// # Errors
/// A missing file or another one, with the command that restores it; whatever [`from_bytes`]
/// refuses.
pub fn load<M: Module>(module: M, path: &Path) -> Result<M, NnError> {
    let bytes = provenance::read_checked(path)?;
    from_bytes(module, bytes, &path.display().to_string())
}

/// Writes a file under a temporary name in the same folder, brings it to the disk and renames it,
/// so that a killed process leaves either the old file or the new one.
///
/// # Errors
/// The file cannot be written; what stood under `path` stays.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), NnError> {
    write(path, bytes).map_err(|source| NnError::Write {
        path: path.to_path_buf(),
        source,
    })
}

fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let mut builder = Builder::new();
    builder.prefix(".credence-").suffix(".tmp");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder.unwrap_or_else(|| Path::new(".")))?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// The first difference between two networks, in words.
fn difference(expected: &Layout, found: &Layout) -> Option<String> {
    if let Some(missing) = expected.keys().find(|name| !found.contains_key(*name)) {
        return Some(format!("it has no tensor '{missing}'"));
    }
    found
        .iter()
        .find_map(|(name, shape)| match expected.get(name) {
            None => Some(format!("its tensor '{name}' is none of this network's")),
            Some(wanted) if wanted != shape => Some(format!(
                "its tensor '{name}' has the shape {shape:?} instead of {wanted:?}"
            )),
            Some(_) => None,
        })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use burn::{
        nn::{Linear, LinearConfig},
        tensor::Device,
    };

    use super::*;

    fn layer(inputs: usize) -> Linear {
        LinearConfig::new(inputs, 2).init(&Device::flex())
    }

    fn values(layer: &Linear) -> Vec<f32> {
        layer.weight.val().into_data().iter::<f32>().collect()
    }

    #[test]
    fn weights_come_back_to_the_bit_and_replace_an_older_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("layer.safetensors");
        save(&layer(3), &path).unwrap();
        let saved = layer(3);
        save(&saved, &path).unwrap();
        let loaded = load(layer(3), &path).unwrap();
        assert_eq!(values(&loaded), values(&saved));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn half_precision_takes_half_the_room_and_keeps_three_digits() {
        let network = LinearConfig::new(64, 64).init(&Device::flex());
        let bytes = to_half_bytes(&network).unwrap();
        assert!(bytes.len() < to_bytes(&network).unwrap().len() * 6 / 10);
        let fresh = LinearConfig::new(64, 64).init(&Device::flex());
        let loaded = from_bytes(fresh, bytes, "half").unwrap();
        for (half, whole) in values(&loaded).iter().zip(values(&network)) {
            // Eleven significant bits.
            assert!(
                (half - whole).abs() <= whole.abs() / 2048.0 + 1e-7,
                "{half} {whole}"
            );
        }
    }

    #[test]
    fn each_kind_of_bad_file_has_its_message() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("layer.safetensors");
        let message = |path: &Path| load(layer(3), path).unwrap_err().to_string();
        assert!(message(&path).starts_with("cannot read "));

        save(&layer(3), &path).unwrap();
        let whole = fs::read(&path).unwrap();
        for cut in [0, 4, 20, whole.len() - 1] {
            fs::write(&path, &whole[..cut]).unwrap();
            assert!(
                message(&path).contains("is not a whole safetensors file"),
                "{cut}"
            );
        }
        fs::write(&path, [0xa5; 4096]).unwrap();
        assert!(message(&path).contains("is not a whole safetensors file"));

        save(&layer(4), &path).unwrap();
        let text = message(&path);
        assert!(
            text.contains("another network") && text.contains("[4, 2] instead of [3, 2]"),
            "{text}"
        );

        let bare = LinearConfig::new(3, 2)
            .with_bias(false)
            .init(&Device::flex());
        save(&bare, &path).unwrap();
        assert!(message(&path).contains("it has no tensor 'bias'"));

        let mut nan = whole;
        let end = nan.len();
        nan[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        fs::write(&path, &nan).unwrap();
        assert!(message(&path).contains("not finite"), "{}", message(&path));

        let nowhere = folder.path().join("none/layer.safetensors");
        let text = save(&layer(3), &nowhere).unwrap_err().to_string();
        assert!(text.contains("check that the folder exists"), "{text}");
    }
}
