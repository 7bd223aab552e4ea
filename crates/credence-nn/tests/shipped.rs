//! The weights that come with the project.

use std::{fs, path::Path};

use credence_nn::Provenance;
use sha2::{Digest as _, Sha256};

/// Bytes that a file of weights may have.
const MOST: usize = 20_000_000;

#[test]
fn every_file_of_weights_is_small_and_is_the_one_that_its_provenance_tells_of() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/weights");
    let mut files: Vec<_> = fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "safetensors"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    for path in files {
        let name = path.display();
        let bytes = fs::read(&path).unwrap();
        assert!(bytes.len() <= MOST, "{name} has {} bytes", bytes.len());
        let provenance = Provenance::load(&path).unwrap();
        let told = provenance.sha256.unwrap();
        let pairs = told.as_bytes().chunks(2);
        let told: Vec<u8> = pairs
            .map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap())
            .collect();
        assert_eq!(told, Sha256::digest(&bytes).as_slice(), "{name}");
        assert!(folder.join(&provenance.loss_curve).exists(), "{name}");
    }
}
