//! What keeps a file from becoming an object.

use std::path::Path;
use thiserror::Error;

/// Why an import ended without an object.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// What the user gave cannot be used: which file, where in it, what was found and what was expected.
    #[error("{file}: {message}")]
    Refused {
        /// The file.
        file: String,
        /// Where, what, and what was expected.
        message: String,
    },
    /// The work failed: a disk that is full, a folder that cannot be written.
    #[error("{file}: {source}")]
    Io {
        /// The file.
        file: String,
        /// The cause.
        source: std::io::Error,
    },
}

impl Error {
    /// A refusal of what `file` says.
    pub(crate) fn refused(file: impl AsRef<Path>, message: impl Into<String>) -> Self {
        Self::Refused { file: file.as_ref().display().to_string(), message: message.into() }
    }
}
