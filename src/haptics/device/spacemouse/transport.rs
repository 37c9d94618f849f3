//! How reports get here: over the system's HID interface, or from a test.

use super::SpaceMouseModel;
use hidapi::{DeviceInfo, HidApi, HidDevice};
use std::time::Duration;

/// Where SpaceMice are found.
pub trait ReportTransport: Send {
    /// Those that are there, by a name that stays the same when they are plugged in again.
    ///
    /// # Errors
    /// Why nothing can be said.
    fn list(&mut self) -> Result<Vec<(String, SpaceMouseModel)>, String>;

    /// Opens one that [`list`](Self::list) named.
    ///
    /// # Errors
    /// Why not.
    fn open(&mut self, serial: &str) -> Result<Box<dyn ReportSource>, String>;
}

/// Where the reports of one SpaceMouse come from.
pub trait ReportSource: Send {
    /// Waits for a report at most so long, and says how many bytes it has; 0 when none came.
    ///
    /// # Errors
    /// Why none will come any more.
    fn read(&mut self, bytes: &mut [u8], patience: Duration) -> Result<usize, String>;
}

/// The system's HID interface.
#[derive(Default)]
pub struct HidTransport(Option<HidApi>);

impl HidTransport {
    /// The interface, looking at what is plugged in now.
    fn api(&mut self) -> Result<&HidApi, String> {
        match &mut self.0 {
            Some(api) => {
                api.refresh_devices().map_err(|error| error.to_string())?;
                Ok(api)
            }
            none => Ok(none.insert(HidApi::new().map_err(|error| error.to_string())?)),
        }
    }
}

/// The SpaceMice of the list, each once: one device may have several interfaces, of which the first speaks of the cap.
fn found(api: &HidApi) -> Vec<(String, SpaceMouseModel, &DeviceInfo)> {
    let mut found: Vec<(String, SpaceMouseModel, &DeviceInfo)> = Vec::new();
    for device in api.device_list() {
        let Some(model) = SpaceMouseModel::of(device.vendor_id(), device.product_id()) else { continue };
        let usb = format!("{:04x}-{:04x}", device.vendor_id(), device.product_id());
        let serial = device.serial_number().filter(|serial| !serial.is_empty()).map_or(usb, Into::into);
        if found.iter().all(|(known, ..)| *known != serial) {
            found.push((serial, model, device));
        }
    }
    found
}

impl ReportTransport for HidTransport {
    fn list(&mut self) -> Result<Vec<(String, SpaceMouseModel)>, String> {
        Ok(found(self.api()?).into_iter().map(|(serial, model, _)| (serial, model)).collect())
    }

    fn open(&mut self, serial: &str) -> Result<Box<dyn ReportSource>, String> {
        let api = self.api()?;
        let found = found(api);
        let Some((.., device)) = found.iter().find(|(known, ..)| known == serial) else {
            return Err("it is not plugged in".into());
        };
        let opened = device.open_device(api).map_err(|error| {
            format!("{error}; on Linux a rule of udev must let you read it, and the maker's driver must not hold it")
        })?;
        Ok(Box::new(HidSource(opened)))
    }
}

struct HidSource(HidDevice);

impl ReportSource for HidSource {
    fn read(&mut self, bytes: &mut [u8], patience: Duration) -> Result<usize, String> {
        let patience_ms = i32::try_from(patience.as_millis()).unwrap_or(i32::MAX);
        self.0.read_timeout(bytes, patience_ms).map_err(|error| error.to_string())
    }
}
