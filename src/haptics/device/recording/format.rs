//! The file.
//!
//! 7 bytes of magic, a byte of version, then chunks: length of what follows the checksum (u32, little endian), the first 8
//! bytes of its blake3, then deflated data. The first chunk is what the device is ([`DeviceInfo`]), the others are events, all
//! in postcard's format. A number in an event is the exclusive-or of its bits with those of the same number of the event
//! before: near numbers share their upper bits, so that little is left. Each chunk begins from nothing, so that what is
//! complete can be read when the program ended in the midst of a later one.

use super::RecordingError;
use crate::haptics::device::{DeviceFault, DeviceInfo, DeviceOutput, DeviceSample};
use bevy::reflect::Reflect;
use flate2::{Compression, read::DeflateDecoder, write::DeflateEncoder};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::path::Path;

pub(super) const MAGIC: [u8; 7] = *b"BSURDEV";
pub(super) const VERSION: u8 = 1;
const CHUNK_HEADER: usize = 4 + 8;
/// Events in a chunk at most; the writer keeps to it, so that the reader knows how much memory a chunk may ask for.
pub(super) const CHUNK_EVENTS: usize = 1024;
/// No chunk is longer than this when it is inflated.
const CHUNK_BYTES: u64 = 1 << 20;

/// One thing that happened between a loop and its device.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub enum RecordedEvent {
    /// The loop read, and this is what it got.
    Read(DeviceSample),
    /// The loop read, and got a fault.
    ReadFault(DeviceFault),
    /// The loop wrote this.
    Write(DeviceOutput),
    /// The loop wrote this and got a fault.
    WriteFault(DeviceOutput, DeviceFault),
}

/// A whole recording.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct Recording {
    /// What was recorded.
    pub info: DeviceInfo,
    /// What happened, in order.
    pub events: Vec<RecordedEvent>,
    /// Whether the file ends in the midst of a chunk: the program that wrote it did not end as it should have.
    pub ended_early: bool,
}

/// An event as it is stored.
#[derive(Serialize, Deserialize)]
enum Stored {
    Read(StoredSample),
    ReadFault(DeviceFault),
    Write(StoredOutput),
    WriteFault(StoredOutput, DeviceFault),
}

#[derive(Serialize, Deserialize)]
struct StoredSample {
    /// Time, position, rotation.
    pose: [u64; 8],
    velocity: Option<[u64; 3]>,
    buttons: u32,
    grip: Option<u64>,
    axes: [u32; 2],
}

#[derive(Serialize, Deserialize)]
struct StoredOutput {
    force_torque: [u64; 6],
    rumble: u32,
}

/// The bits of the event before.
#[derive(Default)]
struct Before {
    pose: [u64; 8],
    velocity: [u64; 3],
    grip: u64,
    axes: [u32; 2],
    force_torque: [u64; 6],
    rumble: u32,
}

/// Differences of bits. Where sign, exponent and upper digits are the same, zeros are left at the upper end, which postcard leaves out.
fn differ<const N: usize>(before: &mut [u64; N], now: [u64; N]) -> [u64; N] {
    std::array::from_fn(|i| std::mem::replace(&mut before[i], now[i]) ^ now[i])
}

fn restore<const N: usize>(before: &mut [u64; N], difference: [u64; N]) -> [f64; N] {
    std::array::from_fn(|i| {
        before[i] ^= difference[i];
        f64::from_bits(before[i])
    })
}

impl Before {
    fn store(&mut self, event: &RecordedEvent) -> Stored {
        match event {
            RecordedEvent::Read(sample) => Stored::Read(self.store_sample(sample)),
            RecordedEvent::ReadFault(fault) => Stored::ReadFault(fault.clone()),
            RecordedEvent::Write(output) => Stored::Write(self.store_output(output)),
            RecordedEvent::WriteFault(output, fault) => Stored::WriteFault(self.store_output(output), fault.clone()),
        }
    }

    fn store_sample(&mut self, sample: &DeviceSample) -> StoredSample {
        let ([px, py, pz], [x, y, z, w]) = (sample.position_m.to_array(), sample.device_from_handle.to_array());
        let axes = sample.axes.map(f32::to_bits);
        let before = std::mem::replace(&mut self.axes, axes);
        StoredSample {
            pose: differ(&mut self.pose, [sample.time_s, px, py, pz, x, y, z, w].map(f64::to_bits)),
            velocity: sample.velocity_m_per_s.map(|v| differ(&mut self.velocity, v.to_array().map(f64::to_bits))),
            buttons: sample.buttons,
            grip: sample.grip_rad.map(|grip| std::mem::replace(&mut self.grip, grip.to_bits()) ^ grip.to_bits()),
            axes: [axes[0] ^ before[0], axes[1] ^ before[1]],
        }
    }

    fn store_output(&mut self, output: &DeviceOutput) -> StoredOutput {
        let ([fx, fy, fz], [tx, ty, tz]) = (output.force_n.to_array(), output.torque_n_m.to_array());
        StoredOutput {
            force_torque: differ(&mut self.force_torque, [fx, fy, fz, tx, ty, tz].map(f64::to_bits)),
            rumble: std::mem::replace(&mut self.rumble, output.rumble.to_bits()) ^ output.rumble.to_bits(),
        }
    }

    fn event(&mut self, stored: Stored) -> RecordedEvent {
        match stored {
            Stored::Read(sample) => RecordedEvent::Read(self.sample(sample)),
            Stored::ReadFault(fault) => RecordedEvent::ReadFault(fault),
            Stored::Write(output) => RecordedEvent::Write(self.output(&output)),
            Stored::WriteFault(output, fault) => RecordedEvent::WriteFault(self.output(&output), fault),
        }
    }

    fn sample(&mut self, stored: StoredSample) -> DeviceSample {
        let [time_s, px, py, pz, x, y, z, w] = restore(&mut self.pose, stored.pose);
        for (before, difference) in self.axes.iter_mut().zip(stored.axes) {
            *before ^= difference;
        }
        DeviceSample {
            time_s,
            position_m: DVec3::new(px, py, pz),
            device_from_handle: DQuat::from_xyzw(x, y, z, w),
            velocity_m_per_s: stored.velocity.map(|v| DVec3::from_array(restore(&mut self.velocity, v))),
            buttons: stored.buttons,
            grip_rad: stored.grip.map(|difference| {
                self.grip ^= difference;
                f64::from_bits(self.grip)
            }),
            axes: self.axes.map(f32::from_bits),
        }
    }

    fn output(&mut self, stored: &StoredOutput) -> DeviceOutput {
        let [fx, fy, fz, tx, ty, tz] = restore(&mut self.force_torque, stored.force_torque);
        self.rumble ^= stored.rumble;
        DeviceOutput {
            force_n: DVec3::new(fx, fy, fz),
            torque_n_m: DVec3::new(tx, ty, tz),
            rumble: f32::from_bits(self.rumble),
        }
    }
}

/// How a file begins: magic, version, what the device is.
pub(super) fn head(info: &DeviceInfo) -> Vec<u8> {
    let mut bytes = Vec::from(MAGIC);
    bytes.push(VERSION);
    bytes.extend(chunk(&postcard::to_stdvec(info).unwrap_or_default()));
    bytes
}

/// Events as a chunk; at most [`CHUNK_EVENTS`] of them.
pub(super) fn events_chunk(events: &[RecordedEvent]) -> Vec<u8> {
    let mut before = Before::default();
    let stored: Vec<_> = events.iter().map(|event| before.store(event)).collect();
    chunk(&postcard::to_stdvec(&stored).unwrap_or_default())
}

fn chunk(plain: &[u8]) -> Vec<u8> {
    let mut deflated = DeflateEncoder::new(Vec::new(), Compression::new(4));
    // Writing to memory does not fail.
    let _ = deflated.write_all(plain);
    let data = deflated.finish().unwrap_or_default();
    let mut bytes = Vec::with_capacity(CHUNK_HEADER + data.len());
    bytes.extend((data.len() as u32).to_le_bytes());
    bytes.extend(&blake3::hash(&data).as_bytes()[..8]);
    bytes.extend(data);
    bytes
}

/// Reads chunks one after another.
struct Chunks<'a> {
    bytes: &'a [u8],
    at: usize,
    file: &'a str,
}

impl Chunks<'_> {
    fn damaged(&self, reason: impl Into<String>) -> RecordingError {
        RecordingError::Damaged { file: self.file.into(), place: self.at as u64, reason: reason.into() }
    }

    /// The next chunk, inflated; `None` where the file ends within it.
    fn next(&self) -> Result<Option<(Vec<u8>, usize)>, RecordingError> {
        let rest = &self.bytes[self.at..];
        let Some((length, after)) = rest.split_first_chunk::<4>() else { return Ok(None) };
        let length = u32::from_le_bytes(*length) as usize;
        let Some((checksum, after)) = after.split_first_chunk::<8>() else { return Ok(None) };
        let Some(data) = after.get(..length) else { return Ok(None) };
        if blake3::hash(data).as_bytes()[..8] != checksum[..] {
            return Err(self.damaged("the checksum of this chunk does not match"));
        }
        let mut plain = Vec::new();
        match DeflateDecoder::new(data).take(CHUNK_BYTES + 1).read_to_end(&mut plain) {
            Ok(_) if plain.len() as u64 > CHUNK_BYTES => {
                Err(self.damaged("this chunk inflates to more than a chunk holds"))
            }
            Ok(_) => Ok(Some((plain, self.at + CHUNK_HEADER + length))),
            Err(error) => Err(self.damaged(format!("this chunk does not inflate ({error})"))),
        }
    }
}

impl Recording {
    /// Reads a file.
    ///
    /// # Errors
    /// [`RecordingError`]
    pub fn load(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let file = path.as_ref().display().to_string();
        match std::fs::read(path) {
            Ok(bytes) => Self::read(&bytes, &file),
            Err(error) => Err(RecordingError::File { file, reason: error.to_string() }),
        }
    }

    /// Reads a file's bytes; `file` is its name for messages. What a chunk claims takes no memory until it is there.
    ///
    /// # Errors
    /// [`RecordingError`]; a file that ends in the midst of a chunk is no error but for the first.
    pub fn read(bytes: &[u8], file: &str) -> Result<Self, RecordingError> {
        if bytes.first_chunk() != Some(&MAGIC) {
            return Err(RecordingError::NotARecording { file: file.into() });
        }
        let mut chunks = Chunks { bytes, at: MAGIC.len() + 1, file };
        match bytes.get(MAGIC.len()) {
            Some(&VERSION) => {}
            Some(&version) => return Err(RecordingError::Version { file: file.into(), version }),
            None => return Err(RecordingError::NotARecording { file: file.into() }),
        }
        let Some((plain, next)) = chunks.next()? else {
            return Err(chunks.damaged("it ends before it says what was recorded"));
        };
        let info = postcard::from_bytes(&plain).map_err(|error| chunks.damaged(error.to_string()))?;
        chunks.at = next;
        let mut recording = Self { info, events: Vec::new(), ended_early: false };
        while chunks.at < bytes.len() {
            let Some((plain, next)) = chunks.next()? else {
                recording.ended_early = true;
                break;
            };
            let (count, mut rest): (u32, _) =
                postcard::take_from_bytes(&plain).map_err(|error| chunks.damaged(error.to_string()))?;
            if count as usize > CHUNK_EVENTS {
                return Err(chunks.damaged(format!("{count} events in a chunk that holds {CHUNK_EVENTS}")));
            }
            let mut before = Before::default();
            for _ in 0..count {
                let (stored, after) =
                    postcard::take_from_bytes(rest).map_err(|error| chunks.damaged(error.to_string()))?;
                recording.events.push(before.event(stored));
                rest = after;
            }
            if !rest.is_empty() {
                return Err(chunks.damaged("something follows the events of this chunk"));
            }
            chunks.at = next;
        }
        Ok(recording)
    }

    /// The recording as a file's bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = head(&self.info);
        self.events.chunks(CHUNK_EVENTS).for_each(|events| bytes.extend(events_chunk(events)));
        bytes
    }

    /// The states that were read, in order.
    pub fn samples(&self) -> impl Iterator<Item = &DeviceSample> {
        self.events.iter().filter_map(|event| match event {
            RecordedEvent::Read(sample) => Some(sample),
            _ => None,
        })
    }

    /// The forces that were written, in order.
    pub fn outputs(&self) -> impl Iterator<Item = &DeviceOutput> {
        self.events.iter().filter_map(|event| match event {
            RecordedEvent::Write(output) | RecordedEvent::WriteFault(output, _) => Some(output),
            _ => None,
        })
    }
}
