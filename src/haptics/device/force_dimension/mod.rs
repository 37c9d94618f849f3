//! Force Dimension's devices and the Novint Falcon, through the DHD library.
//!
//! The library is looked for when the program runs, and stays loaded. Each device has a thread that reads and writes as fast as
//! the device answers, at most twice a millisecond; the servo loop exchanges the newest with it.
//!
//! The library's space is right-handed, X towards the person, Y to the right, Z up, in metres.

mod driver;
mod library;

use super::link::{Link, Linked};
use super::serial;
use super::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use bevy::reflect::Reflect;
use driver::Driver;
use library::Dhd;
use std::collections::BTreeMap;
use std::ffi::{c_char, c_int};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Which library is used.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct ForceDimensionSettings {
    /// Libraries, the first that is there is taken: paths, or names that the system looks for.
    pub libraries: Vec<PathBuf>,
    /// How long a force is held when the loop is silent, seconds.
    pub hold_s: f64,
}

impl Default for ForceDimensionSettings {
    fn default() -> Self {
        Self { libraries: library::usual_names(), hold_s: 0.05 }
    }
}

/// What is known of a type of device.
#[derive(Clone, Copy)]
struct Model {
    name: &'static str,
    limits: DeviceLimits,
    has_rotation: bool,
    has_grip: bool,
}

/// The types of the library; one that is not known is taken for the weakest of the maker's.
fn model(kind: c_int) -> Model {
    let new = |name, limits, has_rotation, has_grip| Model { name, limits, has_rotation, has_grip };
    match kind {
        33 => new("Force Dimension omega.3", DeviceLimits::OMEGA, false, false),
        34 | 36 => new("Force Dimension omega.6", DeviceLimits::OMEGA, true, false),
        35 | 37 => new("Force Dimension omega.7", DeviceLimits::OMEGA, true, true),
        60 => new("Novint Falcon", DeviceLimits::FALCON, false, false),
        63 => new("Force Dimension delta.3", DeviceLimits::SIGMA, false, false),
        104 | 105 => new("Force Dimension sigma.7", DeviceLimits::SIGMA, true, true),
        108 | 109 => new("Force Dimension lambda.7", DeviceLimits::SIGMA, true, true),
        131 | 132 => new("Force Dimension lambda.6", DeviceLimits::SIGMA, true, false),
        203 => new("Force Dimension lambda.3", DeviceLimits::SIGMA, false, false),
        206 => new("Force Dimension sigma.3", DeviceLimits::SIGMA, false, false),
        _ => new("device of Force Dimension", DeviceLimits::FALCON, false, false),
    }
}

/// Devices that are open, by their place in the library's list.
type OpenDevices = Arc<Mutex<BTreeMap<u8, DeviceInfo>>>;

/// The DHD library.
#[derive(Default)]
pub struct ForceDimensionBackend {
    settings: ForceDimensionSettings,
    library: Option<Dhd>,
    open: OpenDevices,
}

impl ForceDimensionBackend {
    /// Another library.
    pub fn new(settings: ForceDimensionSettings) -> Self {
        Self { settings, library: None, open: OpenDevices::default() }
    }

    fn library(&mut self) -> Result<Dhd, DeviceFault> {
        Ok(match self.library {
            Some(library) => library,
            None => *self.library.insert(Dhd::load(&self.settings.libraries)?),
        })
    }
}

fn id(place: u8) -> String {
    format!("force_dimension:{place}")
}

/// What an open device is, and what it bears: never more than is known of its kind, and no more than the library says.
fn info(dhd: Dhd, place: u8, handle: c_char) -> DeviceInfo {
    // SAFETY: the handle is open, and the pointer outlives the call.
    let (kind, told, serial) = unsafe {
        let mut serial = 0;
        let is_known = dhd.serial_number.is_some_and(|serial_number| serial_number(&mut serial, handle) >= 0);
        let told = dhd.max_force.map(|max_force| max_force(handle));
        ((dhd.system_type)(handle), told, is_known.then_some(serial))
    };
    let Model { name, limits, has_rotation, has_grip } = model(kind);
    let told = told.filter(|told| told.is_finite() && *told > 0.0);
    let max_force_n = told.map_or(limits.max_force_n, |told| told.min(limits.max_force_n));
    DeviceInfo {
        id: id(place),
        name: serial.map_or_else(|| name.into(), |serial| format!("{name} {serial}")),
        kind: DeviceKind::ForceDimension,
        limits: DeviceLimits { max_force_n, max_slew_n_per_s: 100.0 * max_force_n, ..limits },
        has_force: true,
        has_rotation,
        has_grip,
        buttons: 4,
    }
}

/// The library's handle of a device, or why there is none.
fn open_handle(dhd: Dhd, place: u8) -> Result<c_char, DeviceFault> {
    // SAFETY: any number is allowed.
    let handle = unsafe { (dhd.open_id)(place as c_char) };
    if handle < 0 {
        return Err(DeviceFault::Gone { id: id(place), reason: dhd.reason("opening it") });
    }
    Ok(handle as c_char)
}

impl DeviceBackend for ForceDimensionBackend {
    fn name(&self) -> &'static str {
        "force_dimension"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        let dhd = self.library()?;
        let open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: it only counts.
        let count = unsafe { (dhd.device_count)() }.clamp(0, 16) as u8;
        let look = |place| {
            if let Some(info) = open.get(&place) {
                return Some(info.clone());
            }
            let handle = open_handle(dhd, place).ok()?;
            let info = info(dhd, place, handle);
            // SAFETY: the handle is ours.
            unsafe { (dhd.close)(handle) };
            Some(info)
        };
        Ok((0..count).filter_map(look).collect())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        let dhd = self.library()?;
        // SAFETY: it only counts.
        let count = unsafe { (dhd.device_count)() }.clamp(0, 16) as u8;
        let wanted = serial(id, "force_dimension").parse().ok().filter(|place| *place < count);
        let Some(place) = wanted else {
            let there: Vec<_> = (0..count).map(self::id).collect();
            return Err(DeviceFault::NotFound { id: id.into(), there: there.join(", ") });
        };
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if open.contains_key(&place) {
            return Err(DeviceFault::Gone { id: self::id(place), reason: "it is open already".into() });
        }
        let handle = open_handle(dhd, place)?;
        let info = info(dhd, place, handle);
        let waiting = DeviceFault::Warning { id: info.id.clone(), reason: "it has not said where it is yet".into() };
        let hold = Duration::try_from_secs_f64(self.settings.hold_s).unwrap_or_default();
        let link = Link::new(Err(waiting), hold);
        let driver = Driver { dhd, handle, info: info.clone(), link: link.clone(), saturated: 0 };
        let thread = std::thread::Builder::new().name(format!("haptics-{}", info.id));
        if let Err(error) = thread.spawn(move || driver.run()) {
            // SAFETY: the handle is ours.
            unsafe { (dhd.close)(handle) };
            return Err(DeviceFault::Gone { id: info.id, reason: error.to_string() });
        }
        open.insert(place, info.clone());
        let closing = Closing { place, open: self.open.clone() };
        Ok(Box::new(ForceDimensionDevice { linked: Linked::new(link, &info.id), _closing: closing, info }))
    }
}

/// Takes a device from the list of open ones.
struct Closing {
    place: u8,
    open: OpenDevices,
}

impl Drop for Closing {
    fn drop(&mut self) {
        self.open.lock().unwrap_or_else(PoisonError::into_inner).remove(&self.place);
    }
}

/// A device.
struct ForceDimensionDevice {
    // The link first, so that the thread has closed the device before it may be opened again.
    linked: Linked,
    _closing: Closing,
    info: DeviceInfo,
}

impl HapticDevice for ForceDimensionDevice {
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
