//! A hand that follows a path, with the tremor of a person's.

use super::{DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice};
use bevy::reflect::Reflect;
use glam::{DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Where a scripted hand is at a time.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct KeyPose {
    /// Seconds after the beginning.
    pub time_s: f64,
    /// Where the handle is, device space, metres.
    pub position_m: DVec3,
    /// How it is turned.
    pub device_from_handle: DQuat,
    /// Which buttons are held from here on.
    pub buttons: u32,
    /// How far the gripper is open, radians.
    pub grip_rad: Option<f64>,
    /// Pedals and triggers, from 0 to 1.
    pub axes: [f32; 2],
}

impl KeyPose {
    /// A pose at a time, not turned, with nothing pressed.
    pub const fn at(time_s: f64, position_m: DVec3) -> Self {
        Self { time_s, position_m, device_from_handle: DQuat::IDENTITY, buttons: 0, grip_rad: None, axes: [0.0; 2] }
    }

    fn is_valid(&self) -> bool {
        self.sample().is_valid()
    }

    fn sample(&self) -> DeviceSample {
        DeviceSample {
            time_s: self.time_s,
            position_m: self.position_m,
            device_from_handle: self.device_from_handle,
            velocity_m_per_s: None,
            buttons: self.buttons,
            grip_rad: self.grip_rad,
            axes: self.axes,
        }
    }
}

/// Physiological tremor: noise between two frequencies, along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Tremor {
    /// Root mean square along each axis, metres. A rested surgeon's is about 50 micrometres.
    pub amplitude_m: f64,
    /// Lowest frequency, hertz.
    pub lowest_hz: f64,
    /// Highest frequency, hertz.
    pub highest_hz: f64,
    /// Other seeds, other tremors.
    pub seed: u64,
}

impl Default for Tremor {
    fn default() -> Self {
        Self { amplitude_m: 50e-6, lowest_hz: 8.0, highest_hz: 12.0, seed: 1 }
    }
}

/// So many waves make noise that one does not see repeat itself.
const WAVES: usize = 16;

/// A path of key poses, smooth in between: no jerk of the hand at a key, and none beyond it.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct ScriptedPath {
    keys: Vec<KeyPose>,
    /// Frequency, phase along each axis.
    waves: Vec<[f64; 4]>,
    amplitude_m: f64,
}

impl ScriptedPath {
    /// A path through poses, in the order of their times. Poses that are no numbers, and tremors of none, are left out.
    pub fn new(mut keys: Vec<KeyPose>, tremor: Option<Tremor>) -> Self {
        keys.retain(KeyPose::is_valid);
        keys.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let is_sound = |tremor: &Tremor| {
            let ends = [tremor.amplitude_m, tremor.lowest_hz, tremor.highest_hz];
            ends.iter().all(|end| end.is_finite() && *end >= 0.0) && tremor.lowest_hz <= tremor.highest_hz
        };
        let Some(tremor) = tremor.filter(is_sound) else { return Self { keys, waves: Vec::new(), amplitude_m: 0.0 } };
        let mut random = Pcg64Mcg::seed_from_u64(tremor.seed);
        let width_hz = (tremor.highest_hz - tremor.lowest_hz) / WAVES as f64;
        let wave = |wave| {
            // One wave in each slice of the band, so that all of it is heard.
            let frequency_hz = tremor.lowest_hz + (wave as f64 + random.random::<f64>()) * width_hz;
            let mut phase = || random.random::<f64>() * TAU;
            [frequency_hz, phase(), phase(), phase()]
        };
        Self { keys, waves: (0..WAVES).map(wave).collect(), amplitude_m: tremor.amplitude_m }
    }

    /// When the last pose is reached, seconds.
    pub fn end_s(&self) -> f64 {
        self.keys.last().map_or(0.0, |key| key.time_s)
    }

    /// The hand at a time; before the first and after the last pose it stays there, trembling.
    pub fn sample(&self, time_s: f64) -> DeviceSample {
        let mut sample = self.steady(time_s);
        let strength_m = self.amplitude_m * (2.0 / self.waves.len().max(1) as f64).sqrt();
        let mut velocity_m_per_s = DVec3::ZERO;
        for &[frequency_hz, x, y, z] in &self.waves {
            let angle = TAU * frequency_hz * time_s;
            let along = |wave: fn(f64) -> f64| DVec3::new(wave(angle + x), wave(angle + y), wave(angle + z));
            sample.position_m += strength_m * along(f64::sin);
            velocity_m_per_s += strength_m * TAU * frequency_hz * along(f64::cos);
        }
        sample.velocity_m_per_s = sample.velocity_m_per_s.map(|steady| steady + velocity_m_per_s);
        sample
    }

    fn steady(&self, time_s: f64) -> DeviceSample {
        let next = self.keys.partition_point(|key| key.time_s <= time_s);
        let still = |key: &KeyPose| DeviceSample { time_s, velocity_m_per_s: Some(DVec3::ZERO), ..key.sample() };
        let (from, to) = match (next.checked_sub(1).map(|last| &self.keys[last]), self.keys.get(next)) {
            (Some(from), Some(to)) => (from, to),
            (Some(only), None) | (None, Some(only)) => return still(only),
            (None, None) => return still(&KeyPose::at(time_s, DVec3::ZERO)),
        };
        let length_s = to.time_s - from.time_s;
        let share = (time_s - from.time_s) / length_s;
        // The way of least jerk between two rests, as people reach.
        let way = share * share * share * (10.0 + share * (6.0 * share - 15.0));
        let slope = 30.0 * share * share * (1.0 - share) * (1.0 - share) / length_s;
        let span_m = to.position_m - from.position_m;
        DeviceSample {
            time_s,
            position_m: from.position_m + way * span_m,
            device_from_handle: from.device_from_handle.slerp(to.device_from_handle, way).normalize(),
            velocity_m_per_s: Some(slope * span_m),
            buttons: from.buttons,
            grip_rad: match (from.grip_rad, to.grip_rad) {
                (Some(a), Some(b)) => Some(a + way * (b - a)),
                (from, _) => from,
            },
            axes: [0, 1].map(|axis| from.axes[axis] + way as f32 * (to.axes[axis] - from.axes[axis])),
        }
    }
}

/// A device on a [`ScriptedPath`]; each read is one tick later. It takes any force and does not give way.
pub struct ScriptedDevice {
    info: DeviceInfo,
    path: ScriptedPath,
    period_s: f64,
    ticks: u64,
}

impl ScriptedDevice {
    /// A device on a path, for a loop with this period. What it is said to bear is that of a given device.
    pub fn new(path: ScriptedPath, period_s: f64, limits: DeviceLimits) -> Self {
        let info = DeviceInfo {
            id: "scripted:path".into(),
            name: "scripted hand".into(),
            kind: DeviceKind::Scripted,
            limits,
            has_force: true,
            has_rotation: true,
            has_grip: path.keys.iter().any(|key| key.grip_rad.is_some()),
            buttons: 32,
        };
        Self { info, path, period_s, ticks: 0 }
    }
}

impl HapticDevice for ScriptedDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let sample = self.path.sample(self.ticks as f64 * self.period_s);
        self.ticks += 1;
        Ok(sample)
    }

    fn write(&mut self, _: &DeviceOutput) -> Result<(), DeviceFault> {
        Ok(())
    }
}
