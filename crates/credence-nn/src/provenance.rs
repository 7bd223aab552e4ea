use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::{NnError, weights};

/// Where a file of weights comes from: enough to train it again and to know what to expect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// The command that trained it.
    pub command: String,
    /// Seed of the data and of the training.
    pub seed: u64,
    /// Revision of the source, if the training knew it.
    pub git_revision: Option<String>,
    /// Optimiser steps.
    pub steps: u64,
    /// Parameters of the network.
    pub parameters: u64,
    /// What it was trained on.
    pub data: BTreeMap<String, String>,
    /// Where the curve of the loss was written.
    pub loss_curve: String,
    /// Figures on the validation data, by name.
    pub figures: BTreeMap<String, f64>,
    /// Of the file of weights, lower-case hexadecimal; provenances of older files lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

impl Provenance {
    /// The file beside a file of weights: `x.json` for `x.safetensors`.
    pub fn path_of(weights: &Path) -> PathBuf {
        weights.with_extension("json")
    }

    /// Writes the provenance beside the weights, with their sha256 as they are now.
    ///
    /// # Errors
    /// The weights cannot be read, or the file cannot be written.
    pub fn save(&self, weights_path: &Path) -> Result<(), NnError> {
        let path = Self::path_of(weights_path);
        let bytes = fs::read(weights_path).map_err(|source| NnError::Read {
            path: weights_path.to_path_buf(),
            source,
        })?;
        let hashed = Self {
            sha256: Some(sha256(&bytes)),
            ..self.clone()
        };
        let mut text =
            serde_json::to_vec_pretty(&hashed).map_err(|source| NnError::Provenance {
                path: path.clone(),
                source,
            })?;
        text.push(b'\n');
        weights::write_file(&path, &text)
    }

    /// Reads the provenance beside the weights.
    ///
    /// # Errors
    /// The file cannot be read or is no provenance.
    pub fn load(weights_path: &Path) -> Result<Self, NnError> {
        let path = Self::path_of(weights_path);
        let text = fs::read(&path).map_err(|source| NnError::Read {
            path: path.clone(),
            source,
        })?;
        serde_json::from_slice(&text).map_err(|source| NnError::Provenance { path, source })
    }
}

/// Reads a file of weights; if its provenance lies beside it and names a hash, it must be that
/// file's.
///
/// # Errors
/// A file that is missing or not the one that the provenance tells of, with the command that
/// restores it; a provenance that is no such thing.
pub(crate) fn read_checked(path: &Path) -> Result<Vec<u8>, NnError> {
    let bytes = fs::read(path);
    let told = Provenance::path_of(path)
        .exists()
        .then(|| Provenance::load(path))
        .transpose()?;
    if let Some(Provenance {
        sha256: Some(expected),
        command,
        ..
    }) = told
    {
        let found = match &bytes {
            Ok(bytes) => sha256(bytes),
            Err(source) if source.kind() == io::ErrorKind::NotFound => "missing".to_owned(),
            Err(source) => source.to_string(),
        };
        if found != expected {
            let found = if bytes.is_ok() {
                format!("damaged or others: sha256 {found} is found")
            } else {
                found
            };
            return Err(NnError::Weights {
                path: path.to_path_buf(),
                expected,
                found,
                command,
            });
        }
    }
    bytes.map_err(|source| NnError::Read {
        path: path.to_path_buf(),
        source,
    })
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .fold(String::new(), |mut text, byte| {
            let _infallible = write!(text, "{byte:02x}");
            text
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn provenance() -> Provenance {
        Provenance {
            command: "credence-train query".to_owned(),
            seed: 3,
            git_revision: None,
            steps: 10,
            parameters: 4,
            data: BTreeMap::from([("meshes".to_owned(), "train".to_owned())]),
            loss_curve: "loss.csv".to_owned(),
            figures: BTreeMap::from([("bce".to_owned(), 0.25)]),
            sha256: None,
        }
    }

    #[test]
    fn is_read_back_as_written_with_the_hash_of_the_weights() {
        let folder = tempfile::tempdir().unwrap();
        let weights = folder.path().join("net.safetensors");
        let message = provenance().save(&weights).unwrap_err().to_string();
        assert!(message.starts_with("cannot read "), "{message}");
        fs::write(&weights, "abc").unwrap();
        provenance().save(&weights).unwrap();
        let expected = Provenance {
            // The example of FIPS 180-2, appendix B.1.
            sha256: Some(
                "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad".to_owned(),
            ),
            ..provenance()
        };
        assert_eq!(Provenance::load(&weights).unwrap(), expected);
        let message = Provenance::load(Path::new("none.safetensors"))
            .unwrap_err()
            .to_string();
        assert!(message.starts_with("cannot read none.json"), "{message}");
        fs::write(folder.path().join("net.json"), "{").unwrap();
        let message = Provenance::load(&weights).unwrap_err().to_string();
        assert!(message.contains("is not valid"), "{message}");
    }

    #[test]
    fn a_missing_or_changed_file_is_told_with_both_hashes_and_the_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let weights = folder.path().join("net.safetensors");
        fs::write(&weights, "abc").unwrap();
        assert_eq!(
            read_checked(&weights).unwrap(),
            b"abc",
            "nothing is told of it"
        );
        provenance().save(&weights).unwrap();
        assert_eq!(read_checked(&weights).unwrap(), b"abc");

        fs::write(&weights, "abd").unwrap();
        let message = read_checked(&weights).unwrap_err().to_string();
        for part in [
            weights.to_str().unwrap(),
            "sha256 a52d159f262b2c6ddb724a61840befc36eb30c88877a4030b65cbe86298449c9 is found",
            "sha256 ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad is expected",
            "`git checkout -- ",
            "`credence-train query`",
        ] {
            assert!(message.contains(part), "{part} is not in: {message}");
        }

        fs::remove_file(&weights).unwrap();
        let message = read_checked(&weights).unwrap_err().to_string();
        assert!(
            message.contains("net.safetensors are missing, sha256 ba78"),
            "{message}"
        );

        // A provenance from before hashes were kept.
        let text = serde_json::to_string(&provenance()).unwrap();
        assert!(!text.contains("sha256"));
        fs::write(folder.path().join("net.json"), text).unwrap();
        fs::write(&weights, "abd").unwrap();
        assert_eq!(read_checked(&weights).unwrap(), b"abd");
    }
}
