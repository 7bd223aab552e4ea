use std::{
    fmt::Write as _,
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

use credence_nn::weights;

use crate::TrainError;

/// A table in a file, a row per logged step, that survives a kill.
///
/// Rows after the step that a run resumes at are dropped, so that the file does not tell how often
/// the run was interrupted.
pub(super) struct Log {
    path: PathBuf,
}

impl Log {
    /// Opens the file, keeping the header and the whole rows up to a step.
    ///
    /// # Errors
    /// Rows of a run that is resumed which cannot be read; a file that cannot be written.
    pub(super) fn resume(path: PathBuf, columns: &[&str], step: u64) -> Result<Self, TrainError> {
        let mut text = format!("step,{}\n", columns.join(","));
        if step > 0 {
            let old = fs::read_to_string(&path).map_err(|source| TrainError::Read {
                path: path.clone(),
                source,
            })?;
            for line in old.split_inclusive('\n').skip(1) {
                let at = line
                    .split(',')
                    .next()
                    .and_then(|cell| cell.parse::<u64>().ok());
                if line.ends_with('\n') && at.is_some_and(|at| at <= step) {
                    text.push_str(line);
                }
            }
        }
        weights::write_file(&path, text.as_bytes())?;
        Ok(Self { path })
    }

    /// Adds a row.
    pub(super) fn add(&self, step: u64, values: &[f64]) -> Result<(), TrainError> {
        let mut line = step.to_string();
        for value in values {
            // Six digits: what differs beyond them is noise, and the file stays readable.
            let _infallible = write!(line, ",{value:.6}");
        }
        line.push('\n');
        let add = || {
            let mut file = fs::OpenOptions::new().append(true).open(&self.path)?;
            file.write_all(line.as_bytes())
        };
        add().map_err(|source| TrainError::Write {
            path: self.path.clone(),
            source,
        })
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resuming_drops_later_rows_and_half_lines() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("loss.csv");
        let log = Log::resume(path.clone(), &["lr", "loss"], 0).unwrap();
        for step in [10, 20, 30] {
            log.add(step, &[0.5, 1.25]).unwrap();
        }
        let mut text = fs::read_to_string(log.path()).unwrap();
        text.push_str("40,0.5");
        fs::write(&path, text).unwrap();
        let _log = Log::resume(path.clone(), &["lr", "loss"], 20).unwrap();
        let expected = "step,lr,loss\n10,0.500000,1.250000\n20,0.500000,1.250000\n";
        assert_eq!(fs::read_to_string(&path).unwrap(), expected);
    }
}
