//! Haply Inverse3 and Minverse, with VerseGrip, through the service that Haply installs.
//!
//! The service speaks JSON over a WebSocket. One connection serves all devices: each message of ours carries the newest forces,
//! and is answered with the newest states. A grip's rotation and buttons join the arm of the same session.
//!
//! The service's space is right-handed, X to the right, Y away from the person, Z up, and a grip points along its Y. Ours is
//! turned by a quarter about X. From version 3.5 on, the service is asked to put its origin into the middle of the reach; of
//! older ones the middle is known only roughly ([`HaplySettings::middle_before_3_5_m`]).

mod session;
mod wire;

use super::link::Linked;
use super::serial;
use super::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use bevy::reflect::Reflect;
use glam::{DQuat, DVec3};
use session::Session;
use std::f64::consts::FRAC_PI_2;

/// How forces are spelled in messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub enum HaplyFormat {
    /// As the service's version demands; one that does not tell its version is taken for an old one.
    #[default]
    Auto,
    /// As from 3.5 on: `vector`.
    Vector,
    /// As before 3.5: `values`.
    Values,
}

/// Where the service is, and how it is used.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct HaplySettings {
    /// Its machine.
    pub host: String,
    /// Its port for states and commands.
    pub port: u16,
    /// How forces are spelled.
    pub format: HaplyFormat,
    /// Name of this program in Haply's own windows.
    pub profile: String,
    /// Named workspace, for services from 3.5 on.
    pub preset: String,
    /// Middle of the reach in the service's space, metres, for services before 3.5.
    pub middle_before_3_5_m: DVec3,
    /// From the service's space to ours.
    pub device_from_haply: DQuat,
    /// Pairs of arm and grip by their ids; others are paired in the order in which the service has them.
    pub grips: Vec<(String, String)>,
    /// How long a force is held when the loop is silent, seconds.
    pub hold_s: f64,
    /// A device or service that is silent for this long is gone, seconds.
    pub lost_after_s: f64,
    /// Least time from one message to the next, seconds.
    pub exchange_period_s: f64,
}

impl Default for HaplySettings {
    fn default() -> Self {
        Self {
            host: "localhost".into(),
            port: 10001,
            format: HaplyFormat::Auto,
            profile: "bevy_surgery".into(),
            preset: "arm_front_centered".into(),
            middle_before_3_5_m: DVec3::new(0.0, -0.14, 0.2),
            device_from_haply: DQuat::from_rotation_x(-FRAC_PI_2),
            grips: Vec::new(),
            hold_s: 0.05,
            lost_after_s: 1.0,
            exchange_period_s: 0.0005,
        }
    }
}

/// Haply's service.
#[derive(Default)]
pub struct HaplyBackend {
    settings: HaplySettings,
    session: Option<Session>,
}

impl HaplyBackend {
    /// A service somewhere else than usual, or used otherwise.
    pub fn new(settings: HaplySettings) -> Self {
        Self { settings, session: None }
    }

    /// The session, a new one if there is none or it has ended.
    fn session(&mut self) -> Result<&Session, DeviceFault> {
        if self.session.as_ref().is_none_or(Session::has_ended) {
            self.session = None;
            self.session = Some(Session::connect(&self.settings)?);
        }
        self.session.as_ref().ok_or_else(|| session::unanswered(&self.settings, "there is no session".into()))
    }
}

fn info(id: &str, is_minverse: bool, has_grip: bool) -> DeviceInfo {
    let workspace_radius_m = if is_minverse { 0.04 } else { DeviceLimits::INVERSE3.workspace_radius_m };
    DeviceInfo {
        id: format!("haply:{id}"),
        name: if is_minverse { "Haply Minverse" } else { "Haply Inverse3" }.into(),
        kind: DeviceKind::Haply,
        limits: DeviceLimits { workspace_radius_m, ..DeviceLimits::INVERSE3 },
        has_force: true,
        has_rotation: has_grip,
        has_grip: false,
        buttons: if has_grip { 3 } else { 0 },
    }
}

impl DeviceBackend for HaplyBackend {
    fn name(&self) -> &'static str {
        "haply"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        Ok(self.session()?.devices())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        let id = serial(id, "haply");
        let session = self.session()?;
        let there = session.devices();
        let Some(info) = there.iter().find(|info| serial(&info.id, "haply") == id) else {
            let there: Vec<_> = there.into_iter().map(|info| info.id).collect();
            return Err(DeviceFault::NotFound { id: format!("haply:{id}"), there: there.join(", ") });
        };
        let link = session.open(id);
        Ok(Box::new(HaplyDevice { linked: Linked::new(link, &info.id), info: info.clone() }))
    }
}

/// An arm.
struct HaplyDevice {
    linked: Linked,
    info: DeviceInfo,
}

impl HapticDevice for HaplyDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        self.linked.read()
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        self.linked.link.write(output, self.info.limits.max_force_n)
    }
}
