//! The log of a run: an [MCAP](https://mcap.dev) file, whose messages are JSON, in chunks compressed with LZ4.
//!
//! The first message, of the topic `/header`, is a [`LogHeader`]; the others are [`LogEntry`]s, each with the topic of its kind of
//! [`LogRecord`]. A message's time is the simulation's, in nanoseconds from the run's beginning. [`LogWriter`] writes off the main
//! thread, [`RunLog::read`] reads. `docs/run-log.md` says all that is in it, for who reads it without this crate.

mod error;
mod read;
mod record;
mod write;

pub use error::LogError;
pub use record::{
    BleedingRecord, CameraRecord, ContactRecord, EndReason, EndRecord, GoalRecord, HashRecord, LOG_VERSION, LogBranch,
    LogEntry, LogHeader, LogRecord, LoggedBody, LoggedTool, ReactionRecord, RemovalRecord, RunLog, ToolSample,
    ViolationRecord,
};
pub use write::LogWriter;

/// The topics: of the header, and of every kind of record.
const TOPICS: [&str; 11] = [
    "/header",
    "/sample",
    "/contact",
    "/removal",
    "/reaction",
    "/bleeding",
    "/camera",
    "/goal",
    "/violation",
    "/hash",
    "/end",
];

/// The place of a record's topic in [`TOPICS`].
fn topic(record: &LogRecord) -> usize {
    match record {
        LogRecord::Sample(_) => 1,
        LogRecord::Contact(_) => 2,
        LogRecord::Removal(_) => 3,
        LogRecord::Reaction(_) => 4,
        LogRecord::Bleeding(_) => 5,
        LogRecord::Camera(_) => 6,
        LogRecord::Goal(_) => 7,
        LogRecord::Violation(_) => 8,
        LogRecord::Hash(_) => 9,
        LogRecord::End(_) => 10,
    }
}
