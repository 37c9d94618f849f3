//! Opening, the driver's scheduler, and what is done in its callback.

use super::OpenHapticsSettings;
use super::library::{CALLBACK_CONTINUE, CALLBACK_DONE, Hd, INVALID_HANDLE, MAX_PRIORITY, name};
use crate::haptics::device::link::Link;
use crate::haptics::device::{DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceSample, device_clock_s};
use glam::{DMat3, DMat4, DQuat, DVec3};
use std::collections::BTreeMap;
use std::ffi::{CString, c_ulong, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

const METRES_PER_MILLIMETRE: f64 = 1e-3;
/// Calibration is asked for once in so many ticks: the question takes the driver some time.
const CALIBRATION_TICKS: u32 = 500;
/// The style of calibration that a driver does without help, by moving on.
const STYLE_AUTO: u32 = 2;
const STYLE_INKWELL: u32 = 4;

/// The loaded driver. All that opens, closes or starts goes through one lock: the driver has one current device.
pub(super) struct Driver {
    hd: Hd,
    hold: Duration,
    open: Arc<Mutex<OpenDevices>>,
}

/// The devices that are open, and whether the scheduler runs.
#[derive(Default)]
struct OpenDevices {
    devices: BTreeMap<String, DeviceInfo>,
    is_running: bool,
}

/// What the callback of one device works with.
struct Tick {
    hd: Hd,
    handle: u32,
    id: String,
    link: Arc<Link>,
    style: u32,
    until_check: u32,
    is_calibrated: bool,
}

/// A device in the scheduler; dropping it takes it out.
pub(super) struct Running {
    hd: Hd,
    handle: u32,
    name: String,
    link: Arc<Link>,
    scheduled: c_ulong,
    /// The callback's, from a box; ours again when it is no longer scheduled.
    tick: *mut Mutex<Tick>,
    open: Arc<Mutex<OpenDevices>>,
}

// SAFETY: the pointer is used by the callback, which locks it, and freed once, in `drop`, after it was unscheduled.
unsafe impl Send for Running {}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn id(name: &str) -> String {
    format!("openhaptics:{name}")
}

impl Driver {
    pub(super) fn load(settings: &OpenHapticsSettings) -> Result<Self, DeviceFault> {
        let hd = Hd::load(&settings.library)?;
        let hold = Duration::try_from_secs_f64(settings.hold_s).unwrap_or_default();
        Ok(Self { hd, hold, open: Arc::default() })
    }

    /// What a device is, if it is there. One that is open is not asked again.
    pub(super) fn look(&self, name: &str) -> Option<DeviceInfo> {
        let mut open = lock(&self.open);
        if let Some(info) = open.devices.get(name) {
            return Some(info.clone());
        }
        self.pause(&mut open);
        let found = self.init(name).ok().map(|handle| {
            let info = self.info(name);
            // SAFETY: a handle that the driver has just given.
            unsafe { (self.hd.disable_device)(handle) };
            info
        });
        self.hd.errors();
        self.resume(&mut open);
        found
    }

    pub(super) fn open(&self, name: &str) -> Result<(Running, DeviceInfo), DeviceFault> {
        let mut open = lock(&self.open);
        if open.devices.contains_key(name) {
            return Err(DeviceFault::Gone { id: id(name), reason: "it is open already".into() });
        }
        self.pause(&mut open);
        let opened = self.init(name).and_then(|handle| self.schedule(name, handle));
        if let Ok((_, info)) = &opened {
            open.devices.insert(name.into(), info.clone());
        }
        self.resume(&mut open);
        opened
    }

    /// Devices are opened while the scheduler stands.
    fn pause(&self, open: &mut OpenDevices) {
        if std::mem::take(&mut open.is_running) {
            // SAFETY: it runs.
            unsafe { (self.hd.stop_scheduler)() };
        }
    }

    fn resume(&self, open: &mut OpenDevices) {
        if !open.devices.is_empty() && !open.is_running {
            // SAFETY: it stands.
            unsafe { (self.hd.start_scheduler)() };
            open.is_running = true;
        }
    }

    fn init(&self, name: &str) -> Result<u32, DeviceFault> {
        self.hd.errors();
        let gone = |reason: String| DeviceFault::Gone { id: id(name), reason };
        let given = CString::new(name).map_err(|error| gone(error.to_string()))?;
        let given = if name == "default" { std::ptr::null() } else { given.as_ptr() };
        // SAFETY: null or a string that outlives the call.
        let handle = unsafe { (self.hd.init_device)(given) };
        let error = self.hd.errors().into_iter().find(|error| !error.is_warning());
        match (handle, error) {
            (INVALID_HANDLE, error) => {
                let reason = error.map_or_else(|| "the driver has no such device".into(), |error| error.reason());
                Err(gone(reason))
            }
            (handle, Some(error)) => {
                // SAFETY: a handle that the driver has just given.
                unsafe { (self.hd.disable_device)(handle) };
                Err(gone(error.reason()))
            }
            (handle, None) => Ok(handle),
        }
    }

    /// What the current device is, and what it bears: what its driver says, and never more than is known of its kind.
    fn info(&self, name: &str) -> DeviceInfo {
        let (model, serial) = (self.hd.string(name::MODEL), self.hd.string(name::SERIAL));
        let lower = model.to_lowercase();
        let known = match lower {
            _ if lower.contains("omni") => DeviceLimits::OMNI,
            _ if lower.contains("desktop") || lower.contains("premium") => DeviceLimits::DESKTOP,
            _ => DeviceLimits::TOUCH,
        };
        let told = |name, factor: f64, limit: f64| {
            let [told] = self.hd.doubles::<1>(name).map(|told| told * factor);
            if told.is_finite() && told > 0.0 { told.min(limit) } else { limit }
        };
        // The driver counts in newtons and millimetres.
        let per_metre = 1.0 / METRES_PER_MILLIMETRE;
        let max_force_n = told(name::MAX_FORCE, 1.0, known.max_force_n);
        let limits = DeviceLimits {
            max_force_n,
            max_stiffness_n_per_m: told(name::MAX_STIFFNESS, per_metre, known.max_stiffness_n_per_m),
            max_damping_n_s_per_m: told(name::MAX_DAMPING, per_metre, known.max_damping_n_s_per_m),
            max_slew_n_per_s: known.max_slew_n_per_s.min(100.0 * max_force_n),
            ..known
        };
        let model = if model.is_empty() { "device of 3D Systems".into() } else { model };
        DeviceInfo {
            id: id(name),
            name: if serial.is_empty() { model } else { format!("{model} {serial}") },
            kind: DeviceKind::OpenHaptics,
            limits,
            has_force: true,
            has_rotation: true,
            has_grip: false,
            buttons: 4,
        }
    }

    fn schedule(&self, name: &str, handle: u32) -> Result<(Running, DeviceInfo), DeviceFault> {
        let hd = self.hd;
        // SAFETY: the handle is the driver's own.
        unsafe { (hd.make_current)(handle) };
        let info = self.info(name);
        let style = hd.integer(name::CALIBRATION_STYLE).cast_unsigned();
        // SAFETY: constants of the driver.
        unsafe {
            (hd.enable)(name::FORCE_OUTPUT);
            (hd.set_rate)(1000);
        }
        // Not every driver knows every question, and older ones keep to their own rate.
        hd.errors();
        let waiting = DeviceFault::Warning { id: info.id.clone(), reason: "it has not said where it is yet".into() };
        let link = Link::new(Err(waiting), self.hold);
        let id = info.id.clone();
        let tick = Tick { hd, handle, id, link: link.clone(), style, until_check: 0, is_calibrated: false };
        let tick = Box::into_raw(Box::new(Mutex::new(tick)));
        // SAFETY: the box lives until `Running` is dropped, which unschedules first.
        let scheduled = unsafe { (hd.schedule)(in_scheduler, tick.cast(), MAX_PRIORITY) };
        let running = Running { hd, handle, name: name.into(), link, scheduled, tick, open: self.open.clone() };
        match hd.errors().into_iter().find(|error| !error.is_warning()) {
            None => Ok((running, info)),
            Some(error) => {
                running.link.set_closed();
                running.take_out();
                // The caller holds the lock that `drop` would take.
                std::mem::forget(running);
                Err(DeviceFault::Gone { id: info.id, reason: error.reason() })
            }
        }
    }
}

impl Running {
    pub(super) fn link(&self) -> Arc<Link> {
        self.link.clone()
    }

    fn take_out(&self) {
        // SAFETY: scheduled and opened by us; after it was unscheduled the driver does not call back with the box any more. A
        // callback that is at work yet holds the box's lock.
        unsafe {
            (self.hd.unschedule)(self.scheduled);
            drop(lock(&*self.tick));
            (self.hd.disable_device)(self.handle);
            drop(Box::from_raw(self.tick));
        }
        self.hd.errors();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let open = self.open.clone();
        let mut open = lock(&open);
        // No callback runs while the scheduler stands.
        // SAFETY: it runs; and is started again if another device needs it.
        unsafe {
            if std::mem::take(&mut open.is_running) {
                (self.hd.stop_scheduler)();
            }
        }
        self.take_out();
        open.devices.remove(&self.name);
        if !open.devices.is_empty() {
            // SAFETY: it stands.
            unsafe { (self.hd.start_scheduler)() };
            open.is_running = true;
        }
    }
}

/// The callback. What panics must not unwind into the driver.
extern "C" fn in_scheduler(tick: *mut c_void) -> u32 {
    // SAFETY: the box of `Running`, which outlives the scheduling.
    let tick = unsafe { &*tick.cast::<Mutex<Tick>>() };
    catch_unwind(AssertUnwindSafe(|| lock(tick).run())).unwrap_or(CALLBACK_DONE)
}

impl Tick {
    fn run(&mut self) -> u32 {
        let hd = self.hd;
        if self.until_check == 0 {
            self.until_check = CALIBRATION_TICKS;
            // SAFETY: the handle is open.
            unsafe { (hd.make_current)(self.handle) };
            self.check_calibration();
        }
        self.until_check -= 1;
        // SAFETY: the handle is open.
        unsafe { (hd.begin_frame)(self.handle) };
        let transform = hd.doubles::<16>(name::TRANSFORM);
        let position_m = DVec3::from_array(hd.doubles(name::POSITION)) * METRES_PER_MILLIMETRE;
        let velocity = DVec3::from_array(hd.doubles(name::VELOCITY)) * METRES_PER_MILLIMETRE;
        let buttons = hd.integer(name::BUTTONS).cast_unsigned();
        let is_closing = self.link.is_closing();
        let force_n = if self.is_calibrated { self.link.output().force_n } else { DVec3::ZERO };
        // SAFETY: three numbers, which outlive the call; and the frame that was begun.
        unsafe {
            (hd.set_doubles)(name::FORCE, force_n.to_array().as_ptr());
            (hd.end_frame)(self.handle);
        }
        for error in hd.errors() {
            if error.is_warning() {
                self.link.warn(DeviceFault::Warning { id: self.id.clone(), reason: error.reason() });
            } else {
                self.link.put(Err(DeviceFault::Gone { id: self.id.clone(), reason: error.reason() }));
                self.link.set_closed();
                return CALLBACK_DONE;
            }
        }
        if is_closing {
            self.link.set_closed();
            return CALLBACK_DONE;
        }
        if self.is_calibrated {
            self.link.put(Ok(DeviceSample {
                time_s: device_clock_s(),
                position_m,
                device_from_handle: rotation(&transform),
                velocity_m_per_s: velocity.is_finite().then_some(velocity),
                buttons,
                ..DeviceSample::default()
            }));
        }
        CALLBACK_CONTINUE
    }

    fn check_calibration(&mut self) {
        // SAFETY: both look at the current device, or let it measure itself.
        let mut state = unsafe { (self.hd.check_calibration)() };
        if state == name::CALIBRATION_NEEDS_UPDATE {
            let styles = [STYLE_AUTO, STYLE_INKWELL];
            let style = styles.into_iter().find(|style| self.style & style != 0).unwrap_or(self.style);
            unsafe {
                (self.hd.update_calibration)(style);
                state = (self.hd.check_calibration)();
            }
        }
        self.is_calibrated = state == name::CALIBRATION_OK;
        if !self.is_calibrated {
            let how = match self.style & STYLE_INKWELL {
                0 => "hold its stylus still in the middle, and restart its driver if that does not help",
                _ => "put its stylus into the inkwell",
            };
            self.link.put(Err(DeviceFault::Uncalibrated { id: self.id.clone(), how: how.into() }));
        }
    }
}

/// The rotation of a transform by columns; none where it has none.
fn rotation(transform: &[f64; 16]) -> DQuat {
    let axes = DMat3::from_mat4(DMat4::from_cols_array(transform));
    let rotation = DQuat::from_mat3(&axes);
    if (axes.determinant() - 1.0).abs() < 0.01 && rotation.is_finite() { rotation.normalize() } else { DQuat::IDENTITY }
}
