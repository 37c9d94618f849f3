//! What a device said and was told, as a file: written while it happens, played back bit for bit.

mod device;
mod error;
mod format;
mod replay;

pub use device::{RecorderHandle, RecordingDevice, RecordingProgress};
pub use error::RecordingError;
pub use format::{RecordedEvent, Recording};
pub use replay::{ReplayBackend, ReplayDevice, ReplayHandle, ReplayProgress};
