use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

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
}

impl Provenance {
    /// The file beside a file of weights: `x.json` for `x.safetensors`.
    pub fn path_of(weights: &Path) -> PathBuf {
        weights.with_extension("json")
    }

    /// Writes the provenance beside the weights.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, weights_path: &Path) -> Result<(), NnError> {
        let path = Self::path_of(weights_path);
        let mut text = serde_json::to_vec_pretty(self).map_err(|source| NnError::Provenance {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_read_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let weights = folder.path().join("net.safetensors");
        let provenance = Provenance {
            command: "credence-train query".to_owned(),
            seed: 3,
            git_revision: None,
            steps: 10,
            parameters: 4,
            data: BTreeMap::from([("meshes".to_owned(), "train".to_owned())]),
            loss_curve: "loss.csv".to_owned(),
            figures: BTreeMap::from([("bce".to_owned(), 0.25)]),
        };
        provenance.save(&weights).unwrap();
        assert_eq!(Provenance::load(&weights).unwrap(), provenance);
        let message = Provenance::load(Path::new("none.safetensors"))
            .unwrap_err()
            .to_string();
        assert!(message.starts_with("cannot read none.json"), "{message}");
        fs::write(folder.path().join("net.json"), "{").unwrap();
        let message = Provenance::load(&weights).unwrap_err().to_string();
        assert!(message.contains("is not valid"), "{message}");
    }
}
