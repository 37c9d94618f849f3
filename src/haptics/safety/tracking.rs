//! Whether what a device says about its handle can be believed.

use super::SafetySettings;
use crate::haptics::device::DeviceSample;
use glam::DVec3;

/// What is known of a handle after a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tracked {
    /// It moved on from where it was.
    Moved {
        /// By how much since the tick before, device space, metres.
        by_m: DVec3,
    },
    /// Tracking begins, or begins again: nothing that was remembered of the handle counts.
    Began,
    /// The sample is dropped: the newest good one still counts.
    Dropped,
    /// No good sample for so long that the handle may be anywhere.
    Lost,
}

/// Follows a handle and drops what it cannot have done.
#[derive(Clone, Debug)]
pub struct Tracking {
    settings: SafetySettings,
    last: Option<DeviceSample>,
    /// Since the newest good sample, seconds.
    since_good_s: f64,
    /// Since the device's time went on, seconds.
    since_news_s: f64,
    counts_time: bool,
    /// The device's time when it was given up for repeating itself.
    stale_at_s: Option<f64>,
    velocity_m_per_s: DVec3,
    dropped: u64,
    jumps: u64,
}

/// Cutoff of the estimated velocity, hertz.
const VELOCITY_CUTOFF_HZ: f64 = 60.0;

impl Tracking {
    /// Nothing is known yet.
    pub fn new(settings: SafetySettings) -> Self {
        Self {
            settings,
            last: None,
            since_good_s: 0.0,
            since_news_s: 0.0,
            counts_time: false,
            stale_at_s: None,
            velocity_m_per_s: DVec3::ZERO,
            dropped: 0,
            jumps: 0,
        }
    }

    /// Takes a sample, or notes that there was none.
    pub fn follow(&mut self, sample: Option<&DeviceSample>, dt_s: f64) -> Tracked {
        self.since_good_s += dt_s;
        let Some(sample) = sample.filter(|sample| sample.is_valid()) else {
            self.dropped += u64::from(sample.is_some());
            return self.without();
        };
        if self.stale_at_s.is_some_and(|stale_s| sample.time_s <= stale_s) {
            return Tracked::Lost;
        }
        self.stale_at_s = None;
        let Some(last) = self.last else {
            self.begin(sample);
            return Tracked::Began;
        };
        let passed_s = sample.time_s - last.time_s;
        self.counts_time |= passed_s > 0.0;
        self.since_news_s = if passed_s > 0.0 { 0.0 } else { self.since_news_s + dt_s };
        if self.counts_time && self.since_news_s > self.settings.stale_s {
            return self.without();
        }
        let by_m = sample.position_m - last.position_m;
        // A device that reports every few ticks moves in steps: its own time says how long they took.
        let took_s = passed_s.max(self.since_good_s).max(1e-6);
        if by_m.length() > self.settings.max_speed_m_per_s * took_s {
            self.jumps += 1;
            self.begin(sample);
            return Tracked::Began;
        }
        let share = 1.0 - (-std::f64::consts::TAU * VELOCITY_CUTOFF_HZ * dt_s).exp();
        let measured = sample.velocity_m_per_s.unwrap_or(by_m / self.since_good_s.max(1e-6));
        self.velocity_m_per_s += (measured - self.velocity_m_per_s) * share;
        self.since_good_s = 0.0;
        self.last = Some(*sample);
        Tracked::Moved { by_m }
    }

    fn begin(&mut self, sample: &DeviceSample) {
        self.last = Some(*sample);
        self.velocity_m_per_s = DVec3::ZERO;
        (self.since_good_s, self.since_news_s) = (0.0, 0.0);
    }

    fn without(&mut self) -> Tracked {
        let is_stale = self.counts_time && self.since_news_s > self.settings.stale_s;
        if is_stale {
            self.stale_at_s = self.last.map(|sample| sample.time_s);
        }
        if is_stale || self.since_good_s > self.settings.longest_tick_s || self.last.is_none() {
            self.last = None;
            self.velocity_m_per_s = DVec3::ZERO;
            return Tracked::Lost;
        }
        Tracked::Dropped
    }

    /// The newest good sample; none before the first and after tracking was lost.
    pub fn sample(&self) -> Option<&DeviceSample> {
        self.last.as_ref()
    }

    /// How fast the handle moves, smoothed, device space.
    pub fn velocity_m_per_s(&self) -> DVec3 {
        self.velocity_m_per_s
    }

    /// How many samples were no poses.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// How often the handle jumped.
    pub fn jumps(&self) -> u64 {
        self.jumps
    }
}
