//! One clock for all devices.

use std::sync::OnceLock;
use std::time::Instant;

/// Seconds since the program first asked. Real devices stamp their samples with it; models count their own ticks from zero.
pub fn device_clock_s() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}
