//! Devices: models of them, recordings, and the real ones against counterparts that behave as they do.

mod fake;
mod force_dimension;
mod hand;
mod haply;
mod haply_service;
mod manager;
mod openhaptics;
mod recording;
mod scripted;
mod simulated;
mod spacemouse;

use std::time::{Duration, Instant};

/// Waits until something is so; says what was awaited when it does not come.
fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + Duration::from_secs(20);
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < end, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}
