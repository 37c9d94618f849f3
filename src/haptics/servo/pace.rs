//! Keeping time: sleep for most of a period, spin for the rest.

use std::time::{Duration, Instant};

/// When ticks are due.
pub(super) struct Pace {
    period: Duration,
    spin: Duration,
    due: Instant,
    last: Instant,
}

/// When a tick began.
pub(super) struct Beat {
    /// When.
    pub(super) began: Instant,
    /// How late, seconds.
    pub(super) late_s: f64,
    /// Since the one before, seconds.
    pub(super) since_last_s: f64,
}

impl Pace {
    pub(super) fn new(period_s: f64, spin_s: f64) -> Self {
        let (period, now) = (Duration::from_secs_f64(period_s), Instant::now());
        let spin = Duration::try_from_secs_f64(spin_s).unwrap_or_default().min(period);
        Self { period, spin, due: now + period, last: now }
    }

    /// Waits for the next tick. Ticks that were missed are not made up for: after a pause the pace begins anew.
    pub(super) fn wait(&mut self) -> Beat {
        let left = self.due.saturating_duration_since(Instant::now());
        if left > self.spin {
            std::thread::sleep(left - self.spin);
        }
        let mut began = Instant::now();
        while began < self.due {
            std::hint::spin_loop();
            began = Instant::now();
        }
        let late = began - self.due;
        let since_last_s = (began - self.last).as_secs_f64();
        self.last = began;
        self.due = if late < self.period { self.due + self.period } else { began + self.period };
        Beat { began, late_s: late.as_secs_f64(), since_last_s }
    }
}
