//! The thread of one device.

use super::library::{Dhd, MOTOR_SATURATED, STATUS, STATUS_CALIBRATED, STATUS_POWER, Status, TIMEGUARD};
use crate::haptics::device::link::Link;
use crate::haptics::device::{DeviceFault, DeviceInfo, DeviceSample, device_clock_s};
use glam::{DMat3, DQuat, DVec3};
use std::ffi::{c_char, c_int};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Least time from one exchange to the next.
const PERIOD: Duration = Duration::from_micros(500);
/// The status is asked for once in so many exchanges.
const STATUS_EXCHANGES: u32 = 500;
/// One saturated tick is nothing; so many in a row are worth a word.
const SATURATED: u32 = 200;

pub(super) struct Driver {
    pub dhd: Dhd,
    pub handle: c_char,
    pub info: DeviceInfo,
    pub link: Arc<Link>,
    pub saturated: u32,
}

/// The library's Y is to the right, its Z up, its X towards the person.
fn to_device(dhd: [f64; 3]) -> DVec3 {
    DVec3::new(dhd[1], dhd[2], dhd[0])
}

fn to_dhd(device: DVec3) -> [f64; 3] {
    [device.z, device.x, device.y]
}

/// Whether an answer is an error; positive ones are remarks.
fn failed(answer: c_int) -> bool {
    answer < 0
}

impl Driver {
    pub(super) fn run(mut self) {
        let dhd = self.dhd;
        // SAFETY: the handle is open until this thread closes it.
        if failed(unsafe { (dhd.enable_force)(1, self.handle) }) {
            let reason = format!("no force: {}", dhd.reason("switching its motors on"));
            self.link.warn(DeviceFault::Warning { id: self.info.id.clone(), reason });
        }
        let mut until_status = 0;
        let mut uncalibrated = None;
        while !self.link.is_closing() {
            let begun = Instant::now();
            if until_status == 0 {
                until_status = STATUS_EXCHANGES;
                uncalibrated = self.check_status();
            }
            until_status -= 1;
            let read = self.read();
            let force_n = if uncalibrated.is_none() { self.link.output().force_n } else { DVec3::ZERO };
            let result = read.and_then(|sample| self.set_force(force_n).map(|()| sample));
            let is_over = result.is_err();
            self.link.put(match (result, &uncalibrated) {
                (Ok(_), Some(fault)) => Err(fault.clone()),
                (result, _) => result,
            });
            if is_over {
                break;
            }
            std::thread::sleep(PERIOD.saturating_sub(begun.elapsed()));
        }
        // SAFETY: as above; nobody uses the handle after this.
        unsafe {
            (dhd.set_force)(0.0, 0.0, 0.0, self.handle);
            (dhd.enable_force)(0, self.handle);
            (dhd.close)(self.handle);
        }
        self.link.set_closed();
    }

    fn gone(&self, what: &str) -> DeviceFault {
        DeviceFault::Gone { id: self.info.id.clone(), reason: self.dhd.reason(what) }
    }

    /// Three numbers of the library.
    fn vector(&self, get: unsafe extern "system" fn(*mut f64, *mut f64, *mut f64, c_char) -> c_int) -> Option<DVec3> {
        let [mut x, mut y, mut z] = [0.0; 3];
        // SAFETY: the pointers outlive the call, the handle is open.
        let answer = unsafe { get(&mut x, &mut y, &mut z, self.handle) };
        (!failed(answer)).then(|| to_device([x, y, z]))
    }

    fn read(&self) -> Result<DeviceSample, DeviceFault> {
        let dhd = self.dhd;
        let position_m = self.vector(dhd.get_position).ok_or_else(|| self.gone("asking for its position"))?;
        let mut sample = DeviceSample {
            time_s: device_clock_s(),
            position_m,
            velocity_m_per_s: self.vector(dhd.get_velocity).filter(|velocity| velocity.is_finite()),
            ..DeviceSample::default()
        };
        // SAFETY: the pointers outlive the calls, the handle is open.
        unsafe {
            sample.buttons = (dhd.get_buttons)(self.handle);
            let mut rows = [[0.0; 3]; 3];
            if self.info.has_rotation && !failed((dhd.get_orientation)(&mut rows, self.handle)) {
                sample.device_from_handle = rotation(rows);
            }
            let mut angle_rad = 0.0;
            if self.info.has_grip && !failed((dhd.get_gripper)(&mut angle_rad, self.handle)) {
                sample.grip_rad = Some(angle_rad).filter(|angle_rad: &f64| angle_rad.is_finite());
            }
        }
        Ok(sample)
    }

    fn set_force(&mut self, force_n: DVec3) -> Result<(), DeviceFault> {
        let [x, y, z] = to_dhd(force_n);
        // SAFETY: the handle is open.
        let answer = unsafe { (self.dhd.set_force)(x, y, z, self.handle) };
        self.saturated = if answer == MOTOR_SATURATED { self.saturated + 1 } else { 0 };
        if self.saturated == SATURATED {
            let reason = "its motors give all they can".into();
            self.link.warn(DeviceFault::Warning { id: self.info.id.clone(), reason });
        }
        match answer {
            0 | TIMEGUARD | MOTOR_SATURATED => Ok(()),
            answer if !failed(answer) => Ok(()),
            _ => Err(self.gone("setting its force")),
        }
    }

    /// Whether it is calibrated and has power, where the library can tell.
    fn check_status(&self) -> Option<DeviceFault> {
        let mut status: Status = [0; 32];
        const { assert!(STATUS <= 32) };
        // SAFETY: there is room for more than the library writes; the handle is open.
        let answer = unsafe { (self.dhd.status?)(status.as_mut_ptr(), self.handle) };
        if failed(answer) {
            return None;
        }
        let id = || self.info.id.clone();
        if status[STATUS_POWER] == 0 {
            self.link.warn(DeviceFault::Warning { id: id(), reason: "it has no power supply, so no force".into() });
        }
        let how = "move its handle to the ends of its workspace, or let the maker's program calibrate it".into();
        (status[STATUS_CALIBRATED] == 0).then(|| DeviceFault::Uncalibrated { id: id(), how })
    }
}

/// A rotation by rows, in the library's axes, as one of ours.
fn rotation(rows: [[f64; 3]; 3]) -> DQuat {
    // Axis n of ours is axis AXES[n] of the library's.
    const AXES: [usize; 3] = [1, 2, 0];
    let turned = DMat3::from_cols_array_2d(&AXES.map(|column| AXES.map(|row| rows[row][column])));
    let rotation = DQuat::from_mat3(&turned);
    if (turned.determinant() - 1.0).abs() < 0.01 && rotation.is_finite() {
        rotation.normalize()
    } else {
        DQuat::IDENTITY
    }
}
