//! What can be wrong with a log.

use bevy::reflect::Reflect;
use std::path::Path;

/// Why a log cannot be written or read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Reflect)]
pub enum LogError {
    /// There is such a file already; runs are not written over.
    #[error("{file}: there is such a file already, and runs are not written over: choose another name")]
    Exists {
        /// The file.
        file: String,
    },
    /// The system says no.
    #[error("{file}: {reason}")]
    Io {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// It is no log of a run.
    #[error("{file}: not a log of a run: {reason}")]
    NotALog {
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// A later version of the crate wrote it.
    #[error(
        "{file}: field `version`: written as version {version}, and this program reads up to {known}: use a newer one"
    )]
    Newer {
        /// The file.
        file: String,
        /// Its version.
        version: u32,
        /// The newest that can be read.
        known: u32,
    },
}

impl LogError {
    pub(super) fn io(file: &Path, error: &std::io::Error) -> Self {
        let file = file.display().to_string();
        match error.kind() {
            std::io::ErrorKind::AlreadyExists => Self::Exists { file },
            _ => Self::Io { file, reason: error.to_string() },
        }
    }
}
