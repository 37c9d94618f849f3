//! Plays a recording as if the device were there.

use super::{RecordedEvent, Recording};
use crate::haptics::device::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceOutput, DeviceSample, HapticDevice, serial,
};
use bevy::reflect::Reflect;
use std::sync::{Arc, Mutex, PoisonError};

/// How far a replay is, and whether the loop does again what it did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub struct ReplayProgress {
    /// Events played.
    pub events: u64,
    /// Events there are.
    pub of: u64,
    /// Forces that were not the same, bit for bit, as in the recording.
    pub other_forces: u64,
}

/// Tells how far a replay is, from any thread.
#[derive(Clone, Default)]
pub struct ReplayHandle(Arc<Mutex<ReplayProgress>>);

impl ReplayHandle {
    /// How far it is.
    pub fn progress(&self) -> ReplayProgress {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A recording as a device: each read gives the next that was read, to the bit, faults as well. After the last every read is
/// [`DeviceFault::Ended`]: a loop then stays where the recording left it, without force; it does not begin anew.
pub struct ReplayDevice {
    info: DeviceInfo,
    events: Vec<RecordedEvent>,
    next: usize,
    other_forces: u64,
    handle: ReplayHandle,
}

impl ReplayDevice {
    /// Plays a recording from its beginning. What it bears is what the recorded device bore.
    pub fn new(recording: Recording, id: &str) -> Self {
        let name = format!("recording of {}", recording.info.name);
        let handle = ReplayHandle::default();
        handle.0.lock().unwrap_or_else(PoisonError::into_inner).of = recording.events.len() as u64;
        let info = DeviceInfo { id: id.into(), name, kind: DeviceKind::Replay, ..recording.info };
        Self { info, events: recording.events, next: 0, other_forces: 0, handle }
    }

    /// Tells how far the replay is, when the device is with the loop.
    pub fn handle(&self) -> ReplayHandle {
        self.handle.clone()
    }

    /// Notes how far it is; whoever asks at this moment waits, the loop does not.
    fn tell(&self) {
        if let Ok(mut progress) = self.handle.0.try_lock() {
            progress.events = self.next as u64;
            progress.other_forces = self.other_forces;
        }
    }
}

impl HapticDevice for ReplayDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        while let Some(event) = self.events.get(self.next) {
            self.next += 1;
            let read = match event {
                RecordedEvent::Read(sample) => Ok(*sample),
                RecordedEvent::ReadFault(fault) => Err(fault.clone()),
                _ => continue,
            };
            self.tell();
            return read;
        }
        Err(DeviceFault::Ended { id: self.info.id.clone() })
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        let (recorded, answer) = match self.events.get(self.next) {
            Some(RecordedEvent::Write(recorded)) => (recorded, Ok(())),
            Some(RecordedEvent::WriteFault(recorded, fault)) => (recorded, Err(fault.clone())),
            // The loop writes where it did not: nothing to compare with.
            _ => return Ok(()),
        };
        let bits = |output: &DeviceOutput| {
            (output.force_n.to_array().map(f64::to_bits), output.torque_n_m.to_array().map(f64::to_bits))
        };
        let is_other = bits(recorded) != bits(output);
        self.next += 1;
        self.other_forces += u64::from(is_other);
        self.tell();
        answer
    }
}

/// Opens recordings by their paths: `replay:drilling.bsurdev`.
#[derive(Default)]
pub struct ReplayBackend;

impl DeviceBackend for ReplayBackend {
    fn name(&self) -> &'static str {
        "replay"
    }

    /// Nothing: what could be played is wherever the person keeps it.
    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        Ok(Vec::new())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        match Recording::load(serial(id, "replay")) {
            Ok(recording) => Ok(Box::new(ReplayDevice::new(recording, id))),
            Err(error) => Err(DeviceFault::Gone { id: id.into(), reason: error.to_string() }),
        }
    }
}
