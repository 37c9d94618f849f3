//! Devices: what a hand holds.
//!
//! A device reports where its handle is and takes a force. Space: device, right-handed and the same for all of them: X to the
//! right, Y up, Z towards the person, the origin in the middle of the workspace; metres, newtons, seconds.
//!
//! A [`DeviceBackend`] finds and opens devices of one make; [`DeviceManager`] keeps all backends, lists what there is and takes
//! up again what comes back. Drivers and services are slower than the loop at times, so that each real device has a thread of
//! its own: the loop takes the newest state, leaves a force, and never waits.

mod clock;
mod fault;
#[cfg(feature = "force_dimension")]
pub mod force_dimension;
pub mod hand;
#[cfg(feature = "haply")]
pub mod haply;
mod info;
#[cfg(any(feature = "haply", feature = "openhaptics", feature = "force_dimension", feature = "spacemouse"))]
// A device without force leaves half of it unused.
#[cfg_attr(not(any(feature = "haply", feature = "openhaptics", feature = "force_dimension")), allow(dead_code))]
mod link;
mod manager;
mod none;
#[cfg(feature = "openhaptics")]
pub mod openhaptics;
pub mod recording;
mod sample;
pub mod scripted;
pub mod simulated;
#[cfg(feature = "spacemouse")]
pub mod spacemouse;

pub use clock::device_clock_s;
pub use fault::DeviceFault;
pub(crate) use info::PASSIVE_SHARE;
pub use info::{DeviceInfo, DeviceKind, DeviceLimits};
pub use manager::{DeviceManager, DeviceNews, ManagedDevice};
pub use none::{NoBackend, NoDevice};
pub use sample::{DeviceOutput, DeviceSample};

/// A device that is open. Implement it for one of your own.
///
/// The servo loop calls [`read`](Self::read) and [`write`](Self::write) once a tick, from its own thread; neither may wait longer
/// than a tick. A device whose driver is slower than that keeps its last state and says when it was taken.
///
/// Devices that are models (scripted, replayed, simulated) move on by one tick of their own with each `read`, so that a loop
/// that is stepped by hand gives the same again. What is dropped leaves no force on the handle.
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
    /// As [`HapticDevice::read`]. After a [`DeviceFault::Warning`] the force was taken all the same.
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

    /// Opens a device by its whole id, `haply:A14`, or by the part after the colon.
    ///
    /// # Errors
    /// [`DeviceFault`]
    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault>;
}

/// The part of an id after the backend's name.
pub(crate) fn serial<'a>(id: &'a str, backend: &str) -> &'a str {
    id.strip_prefix(backend).and_then(|rest| rest.strip_prefix(':')).unwrap_or(id)
}

/// Makes all data types of the devices known to a world's registry.
pub fn register_device_types(app: &mut bevy::app::App) {
    app.register_type::<DeviceFault>()
        .register_type::<DeviceInfo>()
        .register_type::<DeviceKind>()
        .register_type::<DeviceLimits>()
        .register_type::<DeviceNews>()
        .register_type::<DeviceOutput>()
        .register_type::<DeviceSample>()
        .register_type::<recording::RecordedEvent>()
        .register_type::<recording::Recording>()
        .register_type::<recording::RecordingError>()
        .register_type::<recording::RecordingProgress>()
        .register_type::<recording::ReplayProgress>()
        .register_type::<scripted::KeyPose>()
        .register_type::<scripted::ScriptedPath>()
        .register_type::<scripted::Tremor>()
        .register_type::<simulated::SimulatedHand>()
        .register_type::<simulated::SimulatedTruth>();
    #[cfg(feature = "haply")]
    app.register_type::<haply::HaplyFormat>().register_type::<haply::HaplySettings>();
    #[cfg(feature = "openhaptics")]
    app.register_type::<openhaptics::OpenHapticsSettings>();
    #[cfg(feature = "force_dimension")]
    app.register_type::<force_dimension::ForceDimensionSettings>();
    #[cfg(feature = "spacemouse")]
    app.register_type::<spacemouse::SpaceMouseModel>()
        .register_type::<spacemouse::SpaceMouseReport>()
        .register_type::<spacemouse::RateControl>()
        .register_type::<spacemouse::RateHandle>();
}
