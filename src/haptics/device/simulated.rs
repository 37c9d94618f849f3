//! A model of a device in a hand: what hardware does to a force law, without hardware.
//!
//! A mass at the end of a spring and a damper, which are the hand; viscous and Coulomb friction of the mechanism; a force that
//! is held between ticks; a position that comes in steps of the encoder. That is what makes stiff walls hum on real devices.

use super::scripted::ScriptedPath;
use super::serial;
use super::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use bevy::reflect::Reflect;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, PoisonError};

/// The hand that holds a simulated device: a spring and a damper towards where it wants to be.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SimulatedHand {
    /// Where it wants the handle, device space, metres.
    pub target_m: DVec3,
    /// Its stiffness, newtons per metre. 100 to 500 is a grip of fingers.
    pub stiffness_n_per_m: f64,
    /// Its damping, newton seconds per metre.
    pub damping_n_s_per_m: f64,
    /// Greatest force of the hand, newtons.
    pub max_force_n: f64,
}

impl Default for SimulatedHand {
    fn default() -> Self {
        Self { target_m: DVec3::ZERO, stiffness_n_per_m: 200.0, damping_n_s_per_m: 2.0, max_force_n: 10.0 }
    }
}

impl SimulatedHand {
    /// A hand that has let go.
    pub const LET_GO: Self =
        Self { target_m: DVec3::ZERO, stiffness_n_per_m: 0.0, damping_n_s_per_m: 0.0, max_force_n: 0.0 };
}

/// What a simulated device really does, before the encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SimulatedTruth {
    /// Seconds since the beginning.
    pub time_s: f64,
    /// Where the handle is, metres.
    pub position_m: DVec3,
    /// How it moves.
    pub velocity_m_per_s: DVec3,
    /// The force that the motors hold.
    pub motor_force_n: DVec3,
    /// Work that the motors have done on the handle, joules.
    pub motor_work_j: f64,
}

/// The program's end of a [`SimulatedDevice`]: moves the hand, and sees what is true.
#[derive(Clone, Default)]
pub struct SimulatedDeviceHandle(Arc<Mutex<(SimulatedHand, SimulatedTruth)>>);

impl SimulatedDeviceHandle {
    /// Lets the hand do something else.
    pub fn set_hand(&self, hand: SimulatedHand) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).0 = hand;
    }

    /// What the device did last.
    pub fn truth(&self) -> SimulatedTruth {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).1
    }
}

/// The model. Each read is one tick later; between ticks it moves under the force that was written last.
pub struct SimulatedDevice {
    info: DeviceInfo,
    handle: SimulatedDeviceHandle,
    path: Option<ScriptedPath>,
    coulomb_n: f64,
    period_s: f64,
    started: bool,
    truth: SimulatedTruth,
}

/// Longest step of the integration: a tenth of a tick of the loop.
const STEP_S: f64 = 1e-4;

impl SimulatedDevice {
    /// A model of a device with these limits, for a loop with this period.
    pub fn new(limits: DeviceLimits, period_s: f64) -> Self {
        let info = DeviceInfo {
            id: "simulated:device".into(),
            name: "simulated device".into(),
            kind: DeviceKind::Simulated,
            limits,
            has_force: limits.max_force_n > 0.0,
            has_rotation: false,
            has_grip: false,
            buttons: 0,
        };
        let period_s = if period_s.is_finite() { period_s.clamp(1e-6, 1.0) } else { 1e-3 };
        Self {
            info,
            handle: SimulatedDeviceHandle::default(),
            path: None,
            coulomb_n: 0.0,
            period_s,
            started: false,
            truth: SimulatedTruth::default(),
        }
    }

    /// Dry friction of the mechanism, newtons.
    pub fn with_coulomb_friction_n(mut self, coulomb_n: f64) -> Self {
        self.coulomb_n = if coulomb_n.is_finite() { coulomb_n.max(0.0) } else { 0.0 };
        self
    }

    /// The hand that holds it at the beginning.
    pub fn with_hand(self, hand: SimulatedHand) -> Self {
        self.handle.set_hand(hand);
        self
    }

    /// Lets the hand's target follow a path; buttons, rotation and gripper come from it too.
    pub fn with_path(mut self, path: ScriptedPath) -> Self {
        self.info.has_rotation = true;
        self.truth.position_m = path.sample(0.0).position_m;
        self.path = Some(path);
        self
    }

    /// Where it begins, at rest.
    pub fn with_position_m(mut self, position_m: DVec3) -> Self {
        if position_m.is_finite() {
            self.truth.position_m = position_m;
        }
        self
    }

    /// The program's end.
    pub fn handle(&self) -> SimulatedDeviceHandle {
        self.handle.clone()
    }

    /// Lets time pass under the force that the motors hold.
    pub fn step(&mut self, dt_s: f64) {
        if !(dt_s > 0.0 && dt_s.is_finite()) {
            return;
        }
        let mut hand = self.handle.0.lock().unwrap_or_else(PoisonError::into_inner).0;
        let steps = (dt_s / STEP_S).ceil().max(1.0);
        let step_s = dt_s / steps;
        let truth = &mut self.truth;
        let (mass_kg, viscous) = (self.info.limits.own_mass_kg.max(1e-6), self.info.limits.own_damping_n_s_per_m);
        let begin_s = truth.time_s;
        for step in 0..steps as u64 {
            truth.time_s = begin_s + (step + 1) as f64 * step_s;
            if let Some(path) = &self.path {
                hand.target_m = path.sample(truth.time_s).position_m;
            }
            let pull_n = hand.stiffness_n_per_m * (hand.target_m - truth.position_m)
                - hand.damping_n_s_per_m * truth.velocity_m_per_s;
            let force_n = truth.motor_force_n + pull_n.clamp_length_max(hand.max_force_n);
            // Both frictions act on the velocity at the end of the step, so that they slow and never drive.
            let pushed = truth.velocity_m_per_s + step_s / mass_kg * force_n;
            let (speed, lost) = (pushed.length(), step_s * self.coulomb_n / mass_kg);
            let slowed = if speed <= lost { DVec3::ZERO } else { pushed * (1.0 - lost / speed) };
            truth.velocity_m_per_s = slowed / (1.0 + step_s * viscous / mass_kg);
            let way_m = step_s * truth.velocity_m_per_s;
            truth.position_m += way_m;
            truth.motor_work_j += truth.motor_force_n.dot(way_m);
        }
        self.handle.0.lock().unwrap_or_else(PoisonError::into_inner).1 = *truth;
    }

    /// What the encoder shows.
    fn sample(&self) -> DeviceSample {
        let step_m = self.info.limits.encoder_step_m;
        let counted =
            if step_m > 0.0 { (self.truth.position_m / step_m).round() * step_m } else { self.truth.position_m };
        let held = self.path.as_ref().map(|path| path.sample(self.truth.time_s)).unwrap_or_default();
        DeviceSample { time_s: self.truth.time_s, position_m: counted, velocity_m_per_s: None, ..held }
    }
}

impl HapticDevice for SimulatedDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        if std::mem::replace(&mut self.started, true) {
            self.step(self.period_s);
        }
        Ok(self.sample())
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        let force_n = output.force_n;
        self.truth.motor_force_n =
            if force_n.is_finite() { force_n.clamp_length_max(self.info.limits.max_force_n) } else { DVec3::ZERO };
        Ok(())
    }
}

/// The presets of [`DeviceLimits`] that have a model, by name.
pub const PRESETS: [(&str, DeviceLimits); 7] = [
    ("touch", DeviceLimits::TOUCH),
    ("omni", DeviceLimits::OMNI),
    ("desktop", DeviceLimits::DESKTOP),
    ("falcon", DeviceLimits::FALCON),
    ("omega", DeviceLimits::OMEGA),
    ("sigma", DeviceLimits::SIGMA),
    ("inverse3", DeviceLimits::INVERSE3),
];

/// Simulated devices, one for each preset, for a loop with a given period.
pub struct SimulatedBackend {
    /// Period of the loop, seconds.
    pub period_s: f64,
}

impl Default for SimulatedBackend {
    fn default() -> Self {
        Self { period_s: 1e-3 }
    }
}

impl SimulatedBackend {
    fn make(&self, (name, limits): (&str, DeviceLimits)) -> SimulatedDevice {
        let mut device = SimulatedDevice::new(limits, self.period_s);
        device.info.id = format!("simulated:{name}");
        device.info.name = format!("simulated {name}");
        device
    }
}

impl DeviceBackend for SimulatedBackend {
    fn name(&self) -> &'static str {
        "simulated"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        Ok(PRESETS.iter().map(|preset| self.make(*preset).info).collect())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        match PRESETS.iter().find(|(name, _)| *name == serial(id, "simulated")) {
            Some(preset) => Ok(Box::new(self.make(*preset))),
            None => {
                let there = PRESETS.map(|(name, _)| format!("simulated:{name}")).join(", ");
                Err(DeviceFault::NotFound { id: id.into(), there })
            }
        }
    }
}
