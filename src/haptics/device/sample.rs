//! What goes from a device to the loop, and back.

use bevy::reflect::Reflect;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// The state of a handle, in device space.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct DeviceSample {
    /// When it was taken, seconds on the loop's clock.
    pub time_s: f64,
    /// Where the handle is, metres.
    pub position_m: DVec3,
    /// How it is turned: from the handle's space (pointing along -Z) to the device's.
    pub device_from_handle: DQuat,
    /// As the device measures it; the loop estimates it where there is none.
    pub velocity_m_per_s: Option<DVec3>,
    /// Button `n` is bit `n`.
    pub buttons: u32,
    /// How far a gripper is open, radians; `None` without one.
    pub grip_rad: Option<f64>,
    /// Pedals and triggers, from 0 to 1.
    pub axes: [f32; 2],
}

impl Default for DeviceSample {
    fn default() -> Self {
        Self {
            time_s: 0.0,
            position_m: DVec3::ZERO,
            device_from_handle: DQuat::IDENTITY,
            velocity_m_per_s: None,
            buttons: 0,
            grip_rad: None,
            axes: [0.0; 2],
        }
    }
}

impl DeviceSample {
    /// Whether all its numbers are numbers, and the rotation is one.
    pub fn is_valid(&self) -> bool {
        self.time_s.is_finite()
            && self.position_m.is_finite()
            && self.velocity_m_per_s.is_none_or(DVec3::is_finite)
            && self.grip_rad.is_none_or(f64::is_finite)
            && self.axes.iter().all(|axis| axis.is_finite())
            && (self.device_from_handle.length_squared() - 1.0).abs() < 1e-3
    }
}

/// What a device is told to do, in device space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct DeviceOutput {
    /// Force on the handle, newtons.
    pub force_n: DVec3,
    /// Torque on the handle, newton metres; devices without motors for it leave it out.
    pub torque_n_m: DVec3,
    /// Strength of a rumble from 0 to 1, for what has no other way to be felt.
    pub rumble: f32,
}
