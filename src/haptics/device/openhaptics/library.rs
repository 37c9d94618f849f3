//! The HD library's functions, looked up when the program runs.

use crate::haptics::device::DeviceFault;
use libloading::Library;
use std::ffi::{CStr, c_char, c_int, c_ulong, c_void};
use std::path::Path;

pub(super) const INVALID_HANDLE: u32 = 0xFFFF_FFFF;
pub(super) const CALLBACK_CONTINUE: u32 = 1;
pub(super) const CALLBACK_DONE: u32 = 0;
pub(super) const MAX_PRIORITY: u16 = 0xFFFF;

/// What is asked and set, by the driver's numbers.
pub(super) mod name {
    pub const BUTTONS: u32 = 0x2000;
    pub const POSITION: u32 = 0x2050;
    pub const VELOCITY: u32 = 0x2051;
    pub const TRANSFORM: u32 = 0x2052;
    pub const MODEL: u32 = 0x2501;
    pub const SERIAL: u32 = 0x2504;
    pub const CALIBRATION_STYLE: u32 = 0x2555;
    pub const MAX_STIFFNESS: u32 = 0x2602;
    pub const MAX_FORCE: u32 = 0x2603;
    pub const MAX_DAMPING: u32 = 0x2609;
    pub const FORCE: u32 = 0x2700;
    pub const FORCE_OUTPUT: u32 = 0x4000;
    pub const CALIBRATION_OK: u32 = 0x5000;
    pub const CALIBRATION_NEEDS_UPDATE: u32 = 0x5001;
}

/// An error as the library returns it, by value.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct ErrorInfo {
    pub code: u32,
    pub internal: c_int,
    pub handle: u32,
}

pub(super) type Callback = extern "C" fn(*mut c_void) -> u32;

macro_rules! functions {
    ($($field:ident = $symbol:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The library. It stays loaded to the end of the program: the driver does not bear being loaded twice.
        #[derive(Clone, Copy)]
        pub(super) struct Hd {
            $(pub $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Hd {
            /// Takes the functions from a library, or says which is missing.
            fn bind(library: &'static Library) -> Result<Self, libloading::Error> {
                // SAFETY: the signatures are those of the driver's headers, and the library is never unloaded.
                unsafe { Ok(Self { $($field: *library.get($symbol)?,)* }) }
            }
        }
    };
}

functions! {
    init_device = b"hdInitDevice\0": fn(*const c_char) -> u32;
    disable_device = b"hdDisableDevice\0": fn(u32);
    make_current = b"hdMakeCurrentDevice\0": fn(u32);
    begin_frame = b"hdBeginFrame\0": fn(u32);
    end_frame = b"hdEndFrame\0": fn(u32);
    get_doubles = b"hdGetDoublev\0": fn(u32, *mut f64);
    get_integers = b"hdGetIntegerv\0": fn(u32, *mut c_int);
    set_doubles = b"hdSetDoublev\0": fn(u32, *const f64);
    get_string = b"hdGetString\0": fn(u32) -> *const c_char;
    enable = b"hdEnable\0": fn(u32);
    get_error = b"hdGetError\0": fn() -> ErrorInfo;
    get_error_string = b"hdGetErrorString\0": fn(u32) -> *const c_char;
    check_calibration = b"hdCheckCalibration\0": fn() -> u32;
    update_calibration = b"hdUpdateCalibration\0": fn(u32);
    start_scheduler = b"hdStartScheduler\0": fn();
    stop_scheduler = b"hdStopScheduler\0": fn();
    set_rate = b"hdSetSchedulerRate\0": fn(c_ulong);
    schedule = b"hdScheduleAsynchronous\0": fn(Callback, *mut c_void, u16) -> c_ulong;
    unschedule = b"hdUnschedule\0": fn(c_ulong);
}

/// Where the driver installs its library.
pub(super) fn usual_name() -> &'static str {
    if cfg!(windows) {
        "HD.dll"
    } else if cfg!(target_os = "macos") {
        "libHD.dylib"
    } else {
        "libHD.so"
    }
}

impl Hd {
    pub(super) fn load(path: &Path) -> Result<Self, DeviceFault> {
        let failed = |reason: String| DeviceFault::Library {
            library: path.display().to_string(),
            maker: "3D Systems (OpenHaptics)".into(),
            reason,
        };
        if cfg!(not(target_pointer_width = "64")) {
            return Err(failed("only 64-bit programs can use it".into()));
        }
        // SAFETY: loading runs the library's own start; whoever names the library answers for it.
        let library = unsafe { Library::new(path) }.map_err(|error| failed(error.to_string()))?;
        Self::bind(Box::leak(Box::new(library))).map_err(|error| failed(error.to_string()))
    }

    /// Numbers of the current device.
    pub(super) fn doubles<const N: usize>(&self, name: u32) -> [f64; N] {
        // The largest answer has 16 numbers; none is written past its end whatever is asked.
        let mut values = [0.0; 16];
        // SAFETY: there is room for the longest answer.
        unsafe { (self.get_doubles)(name, values.as_mut_ptr()) };
        std::array::from_fn(|i| values[i])
    }

    pub(super) fn integer(&self, name: u32) -> i32 {
        let mut values = [0; 16];
        // SAFETY: there is room for the longest answer.
        unsafe { (self.get_integers)(name, values.as_mut_ptr()) };
        values[0]
    }

    pub(super) fn string(&self, name: u32) -> String {
        // SAFETY: the driver gives a string of its own, or null.
        unsafe { text((self.get_string)(name)) }
    }

    /// All errors since the last call, oldest first.
    pub(super) fn errors(&self) -> Vec<HdError> {
        let mut errors = Vec::new();
        // A driver that never runs out of errors must not hold us for ever.
        for _ in 0..16 {
            // SAFETY: both functions only look.
            let error = unsafe { (self.get_error)() };
            if error.code == 0 {
                break;
            }
            let said = unsafe { text((self.get_error_string)(error.code)) };
            errors.push(HdError { code: error.code, internal: error.internal, said });
        }
        errors
    }
}

/// # Safety
/// A string that ends with zero, or null.
unsafe fn text(string: *const c_char) -> String {
    if string.is_null() {
        return String::new();
    }
    // SAFETY: as above.
    unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned()
}

/// An error of the driver.
pub(super) struct HdError {
    pub code: u32,
    pub internal: i32,
    pub said: String,
}

impl HdError {
    /// Whether the device goes on: warm motors, too much force, too fast.
    pub fn is_warning(&self) -> bool {
        self.code & 0xFF00 == 0x0200
    }

    /// For people.
    pub fn reason(&self) -> String {
        let family = match self.code & 0xFF00 {
            0x0100 => "the driver was asked for something that it does not know",
            0x0200 => match self.code {
                0x0200 => "its motors are too warm",
                0x0201 => "the force was too great",
                0x0202 => "the force changed too quickly",
                0x0203 => "it was moved too fast",
                _ => "a force was not put out",
            },
            0x0300 => "the device does not answer any more",
            0x0400 => "the driver's frames are out of order",
            0x0500 => "the driver has no place for one more device",
            0x0600 => "the driver has no licence",
            _ => "the driver reports an error",
        };
        let Self { code, internal, said, .. } = self;
        let said = if said.is_empty() { String::new() } else { format!("{said}; ") };
        format!("{family} ({said}error {code:#06x}, {internal})")
    }
}
