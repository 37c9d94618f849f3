//! Devices: what a hand holds.
//!
//! A device reports where its handle is and takes a force. Space: device, right-handed and the same for all of them: X to the
//! right, Y up, Z towards the person, the origin in the middle of the workspace; metres, newtons, seconds.

mod fault;
mod info;
mod sample;

pub use fault::DeviceFault;
pub use info::{DeviceInfo, DeviceKind, DeviceLimits};
pub use sample::{DeviceOutput, DeviceSample};

/// A device that is open. Implement it for one of your own.
///
/// The servo loop calls [`read`](Self::read) and [`write`](Self::write) once a tick, from its own thread; neither may wait longer
/// than a tick. A device whose driver is slower than that keeps its last state and says when it was taken.
pub trait HapticDevice: Send {
    /// What the device is and what it can bear.
    fn info(&self) -> &DeviceInfo;

    /// The newest state.
    ///
    /// # Errors
    /// [`DeviceFault`]; after one for which [`DeviceFault::is_over`] the device must be opened again.
    fn read(&mut self) -> Result<DeviceSample, DeviceFault>;

    /// Puts a force on the handle until the next call. It has gone through the limits already; a device may limit it further.
    ///
    /// # Errors
    /// As [`HapticDevice::read`].
    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault>;
}

/// What finds and opens devices of one make. One of them stands for one driver or service.
pub trait DeviceBackend: Send {
    /// Short name, as in `--device haply:A14`: the part before the colon.
    fn name(&self) -> &'static str;

    /// The devices that are there now, open ones too. Takes up to some tenths of a second.
    ///
    /// # Errors
    /// Why nothing can be said: a library or a service that is missing. No device is no error.
    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault>;

    /// Opens a device that [`list`](Self::list) named.
    ///
    /// # Errors
    /// [`DeviceFault`]
    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault>;
}
