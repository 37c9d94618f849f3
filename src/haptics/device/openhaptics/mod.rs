//! 3D Systems Touch, Phantom Omni and Desktop, through OpenHaptics' HD library.
//!
//! The library is looked for when the program runs, and stays loaded: the driver does not bear being loaded twice. States are
//! read and forces set in a callback of the driver's own scheduler, one for each device: only there does the driver keep its
//! order of frames and watch over its motors. The servo loop exchanges the newest of both with it, one tick late at most; when
//! the loop falls silent, the callback lets go of the force by itself.
//!
//! The driver has the same axes as this crate, X to the right, Y up, Z towards the person, in millimetres. It cannot list its
//! devices: those that its own configuration names have to be named here too.

mod driver;
mod library;

use super::link::Linked;
use super::{DeviceBackend, DeviceFault, DeviceInfo, DeviceOutput, DeviceSample, HapticDevice, serial};
use bevy::reflect::Reflect;
use driver::{Driver, Running};
use std::path::PathBuf;

/// Which library is used, and which devices it is asked for.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct OpenHapticsSettings {
    /// The library: a path, or a name that the system looks for.
    pub library: PathBuf,
    /// Names in the driver's configuration, such as `Left Device`. `default` is the driver's default device.
    pub names: Vec<String>,
    /// How long a force is held when the loop is silent, seconds.
    pub hold_s: f64,
}

impl Default for OpenHapticsSettings {
    fn default() -> Self {
        Self { library: library::usual_name().into(), names: vec!["default".into()], hold_s: 0.05 }
    }
}

/// OpenHaptics' driver.
#[derive(Default)]
pub struct OpenHapticsBackend {
    settings: OpenHapticsSettings,
    driver: Option<Driver>,
}

impl OpenHapticsBackend {
    /// Another library, or other devices.
    pub fn new(settings: OpenHapticsSettings) -> Self {
        Self { settings, driver: None }
    }

    fn driver(&mut self) -> Result<&Driver, DeviceFault> {
        Ok(match &mut self.driver {
            Some(driver) => driver,
            none => none.insert(Driver::load(&self.settings)?),
        })
    }
}

impl DeviceBackend for OpenHapticsBackend {
    fn name(&self) -> &'static str {
        "openhaptics"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        let names = self.settings.names.clone();
        let driver = self.driver()?;
        Ok(names.iter().filter_map(|name| driver.look(name)).collect())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        let name = serial(id, "openhaptics").to_string();
        let there: Vec<_> = self.settings.names.iter().map(|name| format!("openhaptics:{name}")).collect();
        if !self.settings.names.contains(&name) {
            return Err(DeviceFault::NotFound { id: format!("openhaptics:{name}"), there: there.join(", ") });
        }
        let (running, info) = self.driver()?.open(&name)?;
        Ok(Box::new(OpenHapticsDevice { linked: Linked::new(running.link(), &info.id), info, _running: running }))
    }
}

/// A stylus.
struct OpenHapticsDevice {
    // Closed in this order: first the link, so that the callback puts no force out and ends; then the device.
    linked: Linked,
    _running: Running,
    info: DeviceInfo,
}

impl HapticDevice for OpenHapticsDevice {
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
