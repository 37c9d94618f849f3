//! Records a device while it is used.

use super::RecordingError;
use super::format::{CHUNK_EVENTS, RecordedEvent, events_chunk, head};
use crate::haptics::device::{DeviceFault, DeviceInfo, DeviceOutput, DeviceSample, HapticDevice};
use bevy::reflect::Reflect;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// How far a recording is.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct RecordingProgress {
    /// Events in the file.
    pub events: u64,
    /// Its length.
    pub bytes: u64,
    /// Why it does not go on. The device does.
    pub error: Option<RecordingError>,
    /// Whether all is written and the file closed.
    pub is_finished: bool,
}

/// Tells how far a recording is, from any thread.
#[derive(Clone, Default)]
pub struct RecorderHandle(Arc<Mutex<RecordingProgress>>);

impl RecorderHandle {
    /// How far it is.
    pub fn progress(&self) -> RecordingProgress {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn change(&self, change: impl FnOnce(&mut RecordingProgress)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// A device that is recorded. A thread of its own packs and writes: the loop only notes what happens.
pub struct RecordingDevice {
    device: Box<dyn HapticDevice>,
    events: Vec<RecordedEvent>,
    full: Option<Sender<Vec<RecordedEvent>>>,
    empty: Receiver<Vec<RecordedEvent>>,
    writer: Option<JoinHandle<()>>,
    handle: RecorderHandle,
}

impl RecordingDevice {
    /// Begins to record a device. A file that is there is overwritten.
    ///
    /// # Errors
    /// [`RecordingError::File`]
    pub fn new(device: Box<dyn HapticDevice>, path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let name = path.as_ref().display().to_string();
        let failed = |error: std::io::Error| RecordingError::File { file: name.clone(), reason: error.to_string() };
        let mut file = File::create(path).map_err(failed)?;
        let head = head(device.info());
        file.write_all(&head).map_err(failed)?;
        let handle = RecorderHandle::default();
        handle.change(|progress| progress.bytes = head.len() as u64);
        let ((full, filled), (emptied, empty)) = (channel(), channel());
        // Two lists wait besides the one at hand, so that the loop takes memory only if the disk is slower than that.
        for _ in 0..2 {
            let _ = emptied.send(Vec::with_capacity(CHUNK_EVENTS));
        }
        let told = handle.clone();
        let writer = std::thread::Builder::new().name("haptics-recorder".into());
        let writer = writer.spawn(move || write_all(file, &name, &filled, &emptied, &told));
        let writer =
            writer.map_err(|error| RecordingError::File { file: "recorder".into(), reason: error.to_string() })?;
        Ok(Self {
            device,
            events: Vec::with_capacity(CHUNK_EVENTS),
            full: Some(full),
            empty,
            writer: Some(writer),
            handle,
        })
    }

    /// Tells how far the recording is, when the device is with the loop.
    pub fn handle(&self) -> RecorderHandle {
        self.handle.clone()
    }

    fn note(&mut self, event: RecordedEvent) {
        self.events.push(event);
        if self.events.len() >= CHUNK_EVENTS {
            self.pass_on();
        }
    }

    fn pass_on(&mut self) {
        let next = self.empty.try_recv().unwrap_or_else(|_| Vec::with_capacity(CHUNK_EVENTS));
        let events = std::mem::replace(&mut self.events, next);
        if let Some(full) = &self.full {
            let _ = full.send(events);
        }
    }
}

fn write_all(
    mut file: File,
    name: &str,
    filled: &Receiver<Vec<RecordedEvent>>,
    emptied: &Sender<Vec<RecordedEvent>>,
    handle: &RecorderHandle,
) {
    let mut failed = false;
    while let Ok(mut events) = filled.recv() {
        if !failed && !events.is_empty() {
            let chunk = events_chunk(&events);
            match file.write_all(&chunk) {
                Ok(()) => handle.change(|progress| {
                    progress.events += events.len() as u64;
                    progress.bytes += chunk.len() as u64;
                }),
                Err(error) => {
                    failed = true;
                    let error = RecordingError::File { file: name.into(), reason: error.to_string() };
                    tracing::error!("the recording ends here: {error}");
                    handle.change(|progress| progress.error = Some(error));
                }
            }
        }
        events.clear();
        let _ = emptied.send(events);
    }
    let synced = file.sync_all();
    handle.change(|progress| {
        if let (Err(error), None) = (synced, &progress.error) {
            progress.error = Some(RecordingError::File { file: name.into(), reason: error.to_string() });
        }
        progress.is_finished = true;
    });
}

impl HapticDevice for RecordingDevice {
    fn info(&self) -> &DeviceInfo {
        self.device.info()
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let read = self.device.read();
        self.note(match &read {
            Ok(sample) => RecordedEvent::Read(*sample),
            Err(fault) => RecordedEvent::ReadFault(fault.clone()),
        });
        read
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        let written = self.device.write(output);
        self.note(match &written {
            Ok(()) => RecordedEvent::Write(*output),
            Err(fault) => RecordedEvent::WriteFault(*output, fault.clone()),
        });
        written
    }
}

impl Drop for RecordingDevice {
    /// Writes the rest and waits until it is there.
    fn drop(&mut self) {
        self.pass_on();
        self.full = None;
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}
