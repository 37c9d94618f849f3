//! The DHD library's functions, looked up when the program runs.

use crate::haptics::device::DeviceFault;
use libloading::Library;
use std::ffi::{CStr, c_char, c_int, c_uchar, c_uint, c_ushort};
use std::path::{Path, PathBuf};

/// How many numbers the library's status has.
pub(super) const STATUS: usize = 17;
pub(super) const STATUS_POWER: usize = 0;
pub(super) const STATUS_CALIBRATED: usize = 3;
/// Positive answers that are no errors.
pub(super) const TIMEGUARD: c_int = 1;
pub(super) const MOTOR_SATURATED: c_int = 2;

/// Room for a status, with some to spare for newer libraries.
pub(super) type Status = [c_int; 32];

macro_rules! functions {
    (
        needed { $($field:ident = $symbol:literal: fn($($argument:ty),*) -> $result:ty;)* }
        optional { $($opt:ident = $opt_symbol:literal: fn($($opt_argument:ty),*) -> $opt_result:ty;)* }
    ) => {
        /// The library. It stays loaded to the end of the program. Every function takes the device last: the header's default
        /// for it is not there for us.
        #[derive(Clone, Copy)]
        pub(super) struct Dhd {
            $(pub $field: unsafe extern "system" fn($($argument),*) -> $result,)*
            $(pub $opt: Option<unsafe extern "system" fn($($opt_argument),*) -> $opt_result>,)*
        }

        impl Dhd {
            /// Takes the functions from a library, or says which is missing.
            fn bind(library: &'static Library) -> Result<Self, libloading::Error> {
                // SAFETY: the signatures are those of the library's header, and it is never unloaded.
                unsafe {
                    Ok(Self {
                        $($field: *library.get($symbol)?,)*
                        $($opt: library.get($opt_symbol).ok().map(|found| *found),)*
                    })
                }
            }
        }
    };
}

functions! {
    needed {
    device_count = b"dhdGetDeviceCount\0": fn() -> c_int;
    open_id = b"dhdOpenID\0": fn(c_char) -> c_int;
    close = b"dhdClose\0": fn(c_char) -> c_int;
    system_type = b"dhdGetSystemType\0": fn(c_char) -> c_int;
    get_position = b"dhdGetPosition\0": fn(*mut f64, *mut f64, *mut f64, c_char) -> c_int;
    get_orientation = b"dhdGetOrientationFrame\0": fn(*mut [[f64; 3]; 3], c_char) -> c_int;
    get_velocity = b"dhdGetLinearVelocity\0": fn(*mut f64, *mut f64, *mut f64, c_char) -> c_int;
    set_force = b"dhdSetForce\0": fn(f64, f64, f64, c_char) -> c_int;
    get_buttons = b"dhdGetButtonMask\0": fn(c_char) -> c_uint;
    get_gripper = b"dhdGetGripperAngleRad\0": fn(*mut f64, c_char) -> c_int;
    enable_force = b"dhdEnableForce\0": fn(c_uchar, c_char) -> c_int;
    error_last = b"dhdErrorGetLast\0": fn() -> c_int;
    }
    optional {
    error_text = b"dhdErrorGetLastStr\0": fn() -> *const c_char;
    max_force = b"dhdGetMaxForce\0": fn(c_char) -> f64;
    status = b"dhdGetStatus\0": fn(*mut c_int, c_char) -> c_int;
    serial_number = b"dhdGetSerialNumber\0": fn(*mut c_ushort, c_char) -> c_int;
    }
}

/// Names that the library has on this system, the usual one first.
pub(super) fn usual_names() -> Vec<PathBuf> {
    let names: &[&str] = if cfg!(windows) {
        &["drd64.dll", "dhd64.dll"]
    } else if cfg!(target_os = "macos") {
        &["libdrd.dylib", "libdhd.dylib"]
    } else {
        &["libdhd.so.3", "libdrd.so.3", "libdhd.so"]
    };
    names.iter().map(PathBuf::from).collect()
}

impl Dhd {
    /// Loads the first library that is there; says why the first is not when none is.
    pub(super) fn load(names: &[PathBuf]) -> Result<Self, DeviceFault> {
        let mut first = None;
        for name in names {
            match Self::load_one(name) {
                Ok(library) => return Ok(library),
                Err(fault) => first = first.or(Some(fault)),
            }
        }
        Err(first.unwrap_or_else(|| fault(Path::new("the DHD library"), "no name was given for it".into())))
    }

    fn load_one(path: &Path) -> Result<Self, DeviceFault> {
        // SAFETY: loading runs the library's own start; whoever names the library answers for it.
        let library = unsafe { Library::new(path) }.map_err(|error| fault(path, error.to_string()))?;
        Self::bind(Box::leak(Box::new(library))).map_err(|error| fault(path, error.to_string()))
    }

    /// What went wrong last, for people.
    pub(super) fn reason(&self, what: &str) -> String {
        // SAFETY: both only look; the string is the library's own, or null.
        let (code, said) = unsafe {
            let said = self.error_text.map_or(std::ptr::null(), |error_text| error_text());
            let said = if said.is_null() { String::new() } else { CStr::from_ptr(said).to_string_lossy().into_owned() };
            ((self.error_last)(), said)
        };
        if said.is_empty() {
            format!("{what} failed with error {code}")
        } else {
            format!("{what} failed: {said} ({code})")
        }
    }
}

fn fault(path: &Path, reason: String) -> DeviceFault {
    DeviceFault::Library { library: path.display().to_string(), maker: "Force Dimension (DHD)".into(), reason }
}
