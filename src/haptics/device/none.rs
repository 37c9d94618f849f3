//! No device: the handle stands still.

use super::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use super::{device_clock_s, serial};

/// Stands still in the middle of its workspace and feels nothing.
pub struct NoDevice(DeviceInfo);

impl Default for NoDevice {
    fn default() -> Self {
        Self(DeviceInfo {
            id: "none:none".into(),
            name: "no device".into(),
            kind: DeviceKind::None,
            limits: DeviceLimits::NO_FORCE,
            has_force: false,
            has_rotation: false,
            has_grip: false,
            buttons: 0,
        })
    }
}

impl HapticDevice for NoDevice {
    fn info(&self) -> &DeviceInfo {
        &self.0
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        Ok(DeviceSample { time_s: device_clock_s(), ..DeviceSample::default() })
    }

    fn write(&mut self, _: &DeviceOutput) -> Result<(), DeviceFault> {
        Ok(())
    }
}

/// Has one device: none.
#[derive(Default)]
pub struct NoBackend;

impl DeviceBackend for NoBackend {
    fn name(&self) -> &'static str {
        "none"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        Ok(vec![NoDevice::default().0])
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        match serial(id, "none") {
            "" | "none" => Ok(Box::new(NoDevice::default())),
            _ => Err(DeviceFault::NotFound { id: id.into(), there: "none:none".into() }),
        }
    }
}
