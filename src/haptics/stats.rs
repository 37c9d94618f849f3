//! How well the loop keeps time, counted without taking memory.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Buckets per doubling; a bucket is at most an eighth as wide as its least value.
const PER_OCTAVE: u32 = 8;
const OCTAVES: u32 = 34;
const BUCKETS: usize = (PER_OCTAVE * OCTAVES) as usize;

/// Counts of durations, exact below 8 ns and within an eighth above, up to 17 s.
#[derive(Clone, Debug, PartialEq)]
pub struct DurationHistogram {
    counts: Box<[u32; BUCKETS]>,
    total: u64,
    max_ns: u64,
}

impl Default for DurationHistogram {
    fn default() -> Self {
        Self { counts: Box::new([0; BUCKETS]), total: 0, max_ns: 0 }
    }
}

/// The bucket of a duration: its highest bit and the three below it.
fn bucket(ns: u64) -> usize {
    let bits = 63 - (ns | 1).leading_zeros();
    let place = if bits < 3 { ns as u32 } else { (bits - 2) * PER_OCTAVE + ((ns >> (bits - 3)) as u32 & 7) };
    (place as usize).min(BUCKETS - 1)
}

/// The greatest duration of a bucket.
fn upper_ns(bucket: usize) -> u64 {
    let bucket = bucket as u64;
    let (octave, step) = (bucket / 8, bucket % 8);
    if octave == 0 { step } else { ((8 + step + 1) << (octave - 1)) - 1 }
}

impl DurationHistogram {
    /// Counts one.
    pub fn record_s(&mut self, seconds: f64) {
        // A cast of what is no number gives 0.
        let ns = (seconds.max(0.0) * 1e9) as u64;
        let count = &mut self.counts[bucket(ns)];
        *count = count.saturating_add(1);
        self.total += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// A share of all are at most this long, seconds; within an eighth above the true value. 0 where nothing was counted.
    pub fn quantile_s(&self, share: f64) -> f64 {
        let wanted = (share.clamp(0.0, 1.0) * self.total as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (place, &count) in self.counts.iter().enumerate() {
            seen += u64::from(count);
            if seen >= wanted {
                return upper_ns(place).min(self.max_ns) as f64 * 1e-9;
            }
        }
        self.max_s()
    }

    /// The longest, seconds.
    pub fn max_s(&self) -> f64 {
        self.max_ns as f64 * 1e-9
    }

    /// How many were counted.
    pub fn count(&self) -> u64 {
        self.total
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.counts.fill(0);
        (self.total, self.max_ns) = (0, 0);
    }
}

/// How a loop keeps time. All 0 while it is stepped by hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct ServoTiming {
    /// Ticks per second in the mean.
    pub rate_hz: f64,
    /// How late ticks begin: the median, seconds.
    pub late_p50_s: f64,
    /// The 99th percentile, seconds.
    pub late_p99_s: f64,
    /// The latest, seconds.
    pub late_max_s: f64,
    /// How long a tick takes to compute: the median, seconds.
    pub compute_p50_s: f64,
    /// The 99th percentile, seconds.
    pub compute_p99_s: f64,
    /// The longest, seconds.
    pub compute_max_s: f64,
    /// Ticks that began a whole period late or more.
    pub missed: u64,
    /// Ticks that were counted.
    pub ticks: u64,
}

/// Measures a loop.
#[derive(Clone, Debug, Default)]
pub struct TimingMeter {
    late: DurationHistogram,
    compute: DurationHistogram,
    missed: u64,
    elapsed_s: f64,
}

impl TimingMeter {
    /// Counts a tick that began so late, that much after the one before it, and took so long.
    pub fn record(&mut self, late_s: f64, since_last_s: f64, compute_s: f64, period_s: f64) {
        self.late.record_s(late_s);
        self.compute.record_s(compute_s);
        self.missed += u64::from(late_s >= period_s);
        self.elapsed_s += since_last_s;
    }

    /// What was measured.
    pub fn timing(&self) -> ServoTiming {
        let ticks = self.late.count();
        ServoTiming {
            rate_hz: if self.elapsed_s > 0.0 { ticks as f64 / self.elapsed_s } else { 0.0 },
            late_p50_s: self.late.quantile_s(0.5),
            late_p99_s: self.late.quantile_s(0.99),
            late_max_s: self.late.max_s(),
            compute_p50_s: self.compute.quantile_s(0.5),
            compute_p99_s: self.compute.quantile_s(0.99),
            compute_max_s: self.compute.max_s(),
            missed: self.missed,
            ticks,
        }
    }
}
