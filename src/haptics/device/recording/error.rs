//! What is wrong with a recording.

use bevy::reflect::Reflect;

/// A recording that cannot be written or played.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, thiserror::Error)]
pub enum RecordingError {
    /// The system refuses.
    #[error("{file}: {reason}")]
    File {
        /// Its path.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// It does not begin as one.
    #[error("{file}: this is no recording of a device")]
    NotARecording {
        /// Its path.
        file: String,
    },
    /// It was written by another version of this crate.
    #[error("{file}: a recording of version {version}; this program reads version {}", super::format::VERSION)]
    Version {
        /// Its path.
        file: String,
        /// What it says.
        version: u8,
    },
    /// Bytes of it have changed.
    #[error("{file}: byte {place}: this recording is damaged: {reason}")]
    Damaged {
        /// Its path.
        file: String,
        /// Where the chunk begins that is damaged.
        place: u64,
        /// What is wrong.
        reason: String,
    },
}
