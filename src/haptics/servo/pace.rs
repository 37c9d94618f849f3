//! Keeping time: sleep for most of a period, spin for the rest.

use std::time::{Duration, Instant};

/// So many periods that a tick comes late are made up for.
const MADE_UP: u32 = 10;

/// When ticks are due, without a clock of its own; times are those since any beginning.
///
/// **Ticks are counted on.** One that comes late does not move those after it: these come on their time, or half a period after the
/// one before where that time is past. So the mean rate is kept, and two ticks are never so near one another that a step of the
/// device's encoder between them looks like a jump. After a pause of more than ten periods the count begins anew: no hand wants to
/// feel what it missed.
#[derive(Clone, Debug)]
pub struct ServoPace {
    period: Duration,
    /// When the next tick is due by the count.
    counted: Duration,
    /// When it is due in fact.
    due: Duration,
    last: Duration,
}

/// When a tick began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoBeat {
    /// After the time at which it was due in fact, seconds.
    pub late_s: f64,
    /// Since the one before, seconds.
    pub since_last_s: f64,
}

impl ServoPace {
    /// The first tick is due a period from now.
    pub fn new(period: Duration, now: Duration) -> Self {
        Self { period, counted: now + period, due: now + period, last: now }
    }

    /// When the next tick should begin.
    pub fn due(&self) -> Duration {
        self.due
    }

    /// A tick begins.
    pub fn begin(&mut self, now: Duration) -> ServoBeat {
        let late_s = now.saturating_sub(self.due).as_secs_f64();
        let since_last_s = now.saturating_sub(self.last).as_secs_f64();
        let is_made_up_for = now.saturating_sub(self.counted) <= self.period * MADE_UP;
        self.counted = self.period + if is_made_up_for { self.counted } else { now };
        self.due = self.counted.max(now + self.period / 2);
        self.last = now;
        ServoBeat { late_s, since_last_s }
    }
}

/// A [`ServoPace`] on the system's clock.
pub(super) struct Waiter {
    pace: ServoPace,
    spin: Duration,
    start: Instant,
}

impl Waiter {
    pub(super) fn new(period_s: f64, spin_s: f64) -> Self {
        let period = Duration::from_secs_f64(period_s);
        let spin = Duration::try_from_secs_f64(spin_s).unwrap_or_default().min(period);
        Self { pace: ServoPace::new(period, Duration::ZERO), spin, start: Instant::now() }
    }

    /// Waits for the next tick, and tells when it began.
    pub(super) fn wait(&mut self) -> (Instant, ServoBeat) {
        let due = self.start + self.pace.due();
        let left = due.saturating_duration_since(Instant::now());
        if left > self.spin {
            std::thread::sleep(left - self.spin);
        }
        let mut began = Instant::now();
        while began < due {
            std::hint::spin_loop();
            began = Instant::now();
        }
        (began, self.pace.begin(began - self.start))
    }
}
