use std::{
    io,
    path::{Path, PathBuf},
};

use credence_types::InvalidInput;
use thiserror::Error;

/// A file that cannot be read or written. The message names the file, the fault and the remedy.
#[derive(Debug, Error)]
pub enum IoError {
    /// The system refuses to open or read the file.
    #[error("cannot read {}: {source}; check that the file exists and may be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The system refuses to write the file; what stood under its name before is untouched.
    #[error(
        "cannot write {}: {source}; check that the folder exists, may be written to and has room",
        path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Bytes that contradict the format.
    #[error("{} is damaged: {what}; write or copy it again from its source", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// A file of another kind, or one that lacks what is needed.
    #[error("{} cannot be used: {what}; {remedy}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// What helps.
        remedy: &'static str,
    },
    /// Data that are not what they should be; nothing was written.
    #[error("{} was not written: {source}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: InvalidInput,
    },
    /// Data that the format cannot hold; nothing was written.
    #[error("{} was not written: {what}; {remedy}", path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
        /// What helps.
        remedy: &'static str,
    },
}

/// What is wrong with a stream of bytes, whichever file it comes from.
#[derive(Debug)]
pub(crate) enum Fault {
    Io(io::Error),
    Damaged(String),
    Unsupported { what: String, remedy: &'static str },
}

impl Fault {
    pub(crate) fn damaged<T>(what: impl Into<String>) -> Result<T, Self> {
        Err(Self::Damaged(what.into()))
    }

    pub(crate) fn unsupported<T>(what: impl Into<String>, remedy: &'static str) -> Result<T, Self> {
        let what = what.into();
        Err(Self::Unsupported { what, remedy })
    }

    pub(crate) fn in_file(self, path: &Path) -> IoError {
        let path = path.to_path_buf();
        match self {
            Self::Io(source) => IoError::Read { path, source },
            Self::Damaged(what) => IoError::Damaged { path, what },
            Self::Unsupported { what, remedy } => IoError::Unsupported { path, what, remedy },
        }
    }
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::UnexpectedEof {
            Self::Damaged("it ends too early".to_owned())
        } else {
            Self::Io(error)
        }
    }
}
