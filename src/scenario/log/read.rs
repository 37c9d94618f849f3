//! Reading a log, also one that does not end as it should.

use super::{LOG_VERSION, LogEntry, LogError, LogHeader, RunLog, TOPICS};
use crate::files::excerpt;
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::path::Path;

/// Longest record that is read, bytes: the longest that is written is a header with a large scenario.
const MOST_RECORD_BYTES: usize = 32 << 20;

impl RunLog {
    /// Reads a run. Of a file that was cut off or spoilt, all that comes before that is there, and
    /// [`is_complete`](RunLog::is_complete) is false.
    ///
    /// # Errors
    /// There is no such file, it is no log, or a later version wrote it.
    pub fn read(file: &Path) -> Result<Self, LogError> {
        let bytes = std::fs::read(file).map_err(|error| LogError::io(file, &error))?;
        Self::from_bytes(&bytes, &file.display().to_string())
    }

    /// The same from memory; `file` is what errors call it.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn from_bytes(bytes: &[u8], file: &str) -> Result<Self, LogError> {
        let not_a_log = |reason: String| LogError::NotALog { file: file.into(), reason };
        let mut header: Option<LogHeader> = None;
        let mut entries = Vec::new();
        let mut is_complete = bytes.ends_with(mcap::MAGIC);
        for message in Messages::of(bytes) {
            let (topic, data) = match message {
                Ok(message) => message,
                Err(error) if header.is_none() => return Err(not_a_log(error.to_string())),
                Err(_) => {
                    is_complete = false;
                    break;
                }
            };
            if header.is_none() {
                if topic != TOPICS[0] {
                    return Err(not_a_log(format!("its first message is of {}", excerpt(&topic))));
                }
                header = Some(read_header(&data, file)?);
                continue;
            }
            if !TOPICS.contains(&topic.as_str()) {
                // A kind of record that a later program of the same version adds is passed over.
                continue;
            }
            match serde_json::from_slice::<LogEntry>(&data) {
                Ok(entry) => entries.push(entry),
                Err(error) => {
                    tracing::warn!("{file}: message {} is not understood: {error}", entries.len() + 1);
                    is_complete = false;
                    break;
                }
            }
        }
        let header = header.ok_or_else(|| not_a_log("nothing is in it".into()))?;
        Ok(Self { header, entries, is_complete })
    }
}

/// The messages of a file, with their topics. The reader that takes whole files believes the lengths that they claim.
struct Messages<'a> {
    reader: LinearReader,
    left: &'a [u8],
    topics: BTreeMap<u16, String>,
}

impl<'a> Messages<'a> {
    fn of(bytes: &'a [u8]) -> Self {
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(MOST_RECORD_BYTES);
        Self { reader: LinearReader::new_with_options(options), left: bytes, topics: BTreeMap::new() }
    }

    fn take(&mut self) -> Result<Option<(String, Vec<u8>)>, McapError> {
        while let Some(event) = self.reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(wanted) => {
                    let (now, later) = self.left.split_at(wanted.min(self.left.len()));
                    self.reader.insert(now.len()).copy_from_slice(now);
                    self.reader.notify_read(now.len());
                    self.left = later;
                }
                LinearReadEvent::Record { data, opcode } => match mcap::parse_record(opcode, data)? {
                    Record::Channel(channel) => {
                        self.topics.insert(channel.id, channel.topic);
                    }
                    Record::Message { header, data } => {
                        let topic = self.topics.get(&header.channel_id).cloned().unwrap_or_default();
                        return Ok(Some((topic, data.into_owned())));
                    }
                    _ => {}
                },
            }
        }
        Ok(None)
    }
}

impl Iterator for Messages<'_> {
    type Item = Result<(String, Vec<u8>), McapError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.take().transpose()
    }
}

fn read_header(data: &[u8], file: &str) -> Result<LogHeader, LogError> {
    let not_a_log = |reason: String| LogError::NotALog { file: file.into(), reason };
    // The version before all else: what a later one says may not be understood.
    #[derive(serde::Deserialize)]
    struct Versioned {
        version: u32,
    }
    let header = |error: serde_json::Error| not_a_log(format!("its header: {error}"));
    let Versioned { version } = serde_json::from_slice(data).map_err(header)?;
    if version > LOG_VERSION {
        return Err(LogError::Newer { file: file.into(), version, known: LOG_VERSION });
    }
    let read: LogHeader = serde_json::from_slice(data).map_err(header)?;
    if !(read.steps_per_second.is_finite() && read.steps_per_second >= 1.0 && read.steps_per_second <= 1e4) {
        return Err(not_a_log(format!("field `steps_per_second`: {} is not from 1 to 10000", read.steps_per_second)));
    }
    Ok(read)
}
