//! A hand that a program moves: mouse, keyboard and gamepad.
//!
//! Two ends: [`HandDevice`] is for the servo loop; [`Hand`] is for whoever knows where the handle is, and shows what it feels.

use super::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use super::{device_clock_s, serial};
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

/// The program's end of a [`HandDevice`]. Clones speak for the same hand.
#[derive(Clone, Default)]
pub struct Hand(Arc<HandMailbox>);

#[derive(Default)]
struct HandMailbox {
    sample: Mutex<DeviceSample>,
    output: Mutex<DeviceOutput>,
}

impl Hand {
    /// Says where the handle is now, in device space. The time is set here.
    pub fn set(&self, sample: DeviceSample) {
        *self.0.sample.lock().unwrap_or_else(PoisonError::into_inner) =
            DeviceSample { time_s: device_clock_s(), ..sample };
    }

    /// Where the handle is.
    pub fn sample(&self) -> DeviceSample {
        *self.0.sample.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the handle would feel: an arrow on the screen, or a rumble.
    pub fn output(&self) -> DeviceOutput {
        *self.0.output.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How strongly a gamepad should rumble, from 0 to 1: what was asked for, or else the share of a force that counts as full.
    pub fn rumble(&self, full_force_n: f64) -> f32 {
        let output = self.output();
        let share = (output.force_n.length() / full_force_n.max(1e-9)) as f32;
        let strength = output.rumble.max(share);
        if strength.is_finite() { strength.clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// The servo loop's end of a [`Hand`].
pub struct HandDevice {
    info: DeviceInfo,
    hand: Hand,
    last: DeviceSample,
}

impl HandDevice {
    /// A device that shows what a hand says. Its force is shown, not felt, so that its limits are those of a strong device.
    pub fn new(kind: DeviceKind, serial: &str, hand: Hand) -> Self {
        let name = match kind {
            DeviceKind::Mouse => "mouse and keyboard",
            DeviceKind::Gamepad => "gamepad",
            _ => "hand of the program",
        };
        let info = DeviceInfo {
            id: format!("hand:{serial}"),
            name: name.into(),
            kind,
            limits: DeviceLimits::SIGMA,
            has_force: false,
            has_rotation: true,
            has_grip: false,
            buttons: 8,
        };
        Self { info, last: hand.sample(), hand }
    }
}

impl HapticDevice for HandDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        // Whoever holds the mailbox is copying at this moment: what was there before serves for one more tick.
        match self.hand.0.sample.try_lock() {
            Ok(sample) => self.last = *sample,
            Err(TryLockError::Poisoned(sample)) => self.last = *sample.into_inner(),
            Err(TryLockError::WouldBlock) => {}
        }
        Ok(self.last)
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        match self.hand.0.output.try_lock() {
            Ok(mut held) => *held = *output,
            Err(TryLockError::Poisoned(held)) => *held.into_inner() = *output,
            Err(TryLockError::WouldBlock) => {}
        }
        Ok(())
    }
}

impl Drop for HandDevice {
    fn drop(&mut self) {
        *self.hand.0.output.lock().unwrap_or_else(PoisonError::into_inner) = DeviceOutput::default();
    }
}

/// Hands that a program offers, by name. `mouse` and `gamepad` are there from the start.
pub struct HandBackend(Vec<(String, DeviceKind, Hand)>);

impl Default for HandBackend {
    fn default() -> Self {
        Self(vec![
            ("mouse".into(), DeviceKind::Mouse, Hand::default()),
            ("gamepad".into(), DeviceKind::Gamepad, Hand::default()),
        ])
    }
}

impl HandBackend {
    /// Offers one more hand, or another one by this name.
    pub fn with(mut self, serial: &str, kind: DeviceKind, hand: Hand) -> Self {
        self.0.retain(|(name, ..)| name != serial);
        self.0.push((serial.into(), kind, hand));
        self
    }

    /// The program's end of a hand.
    pub fn hand(&self, serial: &str) -> Option<Hand> {
        self.0.iter().find(|(name, ..)| name == serial).map(|(_, _, hand)| hand.clone())
    }
}

impl DeviceBackend for HandBackend {
    fn name(&self) -> &'static str {
        "hand"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        Ok(self.0.iter().map(|(name, kind, hand)| HandDevice::new(*kind, name, hand.clone()).info.clone()).collect())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        let wanted = serial(id, "hand");
        match self.0.iter().find(|(name, ..)| name == wanted) {
            Some((name, kind, hand)) => Ok(Box::new(HandDevice::new(*kind, name, hand.clone()))),
            None => {
                let there: Vec<_> = self.0.iter().map(|(name, ..)| format!("hand:{name}")).collect();
                Err(DeviceFault::NotFound { id: id.into(), there: there.join(", ") })
            }
        }
    }
}
