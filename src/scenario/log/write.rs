//! Writing a log, in a thread of its own.

use super::{LogEntry, LogError, LogHeader, TOPICS, topic};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Steps that wait to be written, at most; who writes more waits for the disk. Samples may not be lost: without them there is no
/// replay.
const WAITING_STEPS: usize = 4096;
/// What was written so far is made readable so often.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// Writes a run into an MCAP file. What is given to it is on the disk a second later, also if the program then ends at once; dropped,
/// it ends the file as it should.
#[derive(Debug)]
pub struct LogWriter {
    file: PathBuf,
    steps: Option<SyncSender<Vec<LogEntry>>>,
    thread: Option<JoinHandle<Result<(), LogError>>>,
}

impl LogWriter {
    /// Begins a file.
    ///
    /// # Errors
    /// There is such a file already, or the system says no.
    pub fn create(file: &Path, header: &LogHeader) -> Result<Self, LogError> {
        let opened = File::options().write(true).create_new(true).open(file);
        let opened = opened.map_err(|error| LogError::io(file, &error))?;
        let mut open = OpenLog::begin(file, opened, header)?;
        let (sender, receiver) = sync_channel(WAITING_STEPS);
        let thread = std::thread::Builder::new()
            .name("scenario-log".into())
            .spawn(move || open.live(&receiver))
            .map_err(|error| LogError::io(file, &error))?;
        Ok(Self { file: file.into(), steps: Some(sender), thread: Some(thread) })
    }

    /// The file.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Takes what happened in a step. Waits where the disk is more than a minute behind.
    ///
    /// # Errors
    /// What could not be written: once, after that nothing is written any more.
    pub fn write(&mut self, step: Vec<LogEntry>) -> Result<(), LogError> {
        let is_taken = self.steps.as_ref().is_none_or(|steps| steps.send(step).is_ok());
        if is_taken { Ok(()) } else { self.end() }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What could not be written.
    pub fn finish(mut self) -> Result<(), LogError> {
        self.end()
    }

    fn end(&mut self) -> Result<(), LogError> {
        self.steps = None;
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let file = || self.file.display().to_string();
        thread.join().unwrap_or_else(|_| Err(LogError::Io { file: file(), reason: "its writer has panicked".into() }))
    }
}

impl Drop for LogWriter {
    fn drop(&mut self) {
        if let Err(error) = self.end() {
            tracing::error!("{error}");
        }
    }
}

struct OpenLog {
    file: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: Vec<u16>,
    steps_per_second: f64,
    written: u32,
}

impl OpenLog {
    fn begin(file: &Path, opened: File, header: &LogHeader) -> Result<Self, LogError> {
        let options = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .profile("bevy_surgery")
            .library(concat!("bevy_surgery ", env!("CARGO_PKG_VERSION")));
        let failed =
            |error: mcap::McapError| LogError::Io { file: file.display().to_string(), reason: error.to_string() };
        let mut writer = options.create(BufWriter::new(opened)).map_err(failed)?;
        let mut channels = Vec::new();
        for topic in TOPICS {
            let schema = format!(r#"{{"title":"{topic}","type":"object"}}"#);
            let schema = writer.add_schema(topic, "jsonschema", schema.as_bytes()).map_err(failed)?;
            let channel = writer.add_channel(schema, topic, "json", &Default::default()).map_err(failed)?;
            channels.push(channel);
        }
        let mut open =
            Self { file: file.into(), writer, channels, steps_per_second: header.steps_per_second, written: 0 };
        open.message(0, 0, header)?;
        open.flush()?;
        Ok(open)
    }

    fn failed(&self, reason: impl ToString) -> LogError {
        LogError::Io { file: self.file.display().to_string(), reason: reason.to_string() }
    }

    fn message(&mut self, topic: usize, step: u64, what: &impl serde::Serialize) -> Result<(), LogError> {
        let data = serde_json::to_vec(what).map_err(|error| self.failed(error))?;
        let time_ns = (step as f64 / self.steps_per_second * 1e9) as u64;
        self.written = self.written.wrapping_add(1);
        let header = MessageHeader {
            channel_id: self.channels[topic],
            sequence: self.written,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.writer.write_to_known_channel(&header, &data).map_err(|error| self.failed(error))
    }

    fn entry(&mut self, entry: &LogEntry) -> Result<(), LogError> {
        self.message(topic(&entry.record), entry.step, entry)
    }

    fn flush(&mut self) -> Result<(), LogError> {
        self.writer.flush().map_err(|error| self.failed(error))
    }

    fn live(&mut self, steps: &Receiver<Vec<LogEntry>>) -> Result<(), LogError> {
        let mut flushed = Instant::now();
        loop {
            match steps.recv_timeout(FLUSH_EVERY.saturating_sub(flushed.elapsed())) {
                Ok(step) => step.iter().try_for_each(|entry| self.entry(entry))?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if flushed.elapsed() >= FLUSH_EVERY {
                self.flush()?;
                flushed = Instant::now();
            }
        }
        self.writer.finish().map_err(|error| self.failed(error))?;
        Ok(())
    }
}
