//! The parts that voices are made of.

use rand_pcg::Pcg32;
use rand_pcg::rand_core::{Rng, SeedableRng};
use std::f32::consts::{PI, TAU};

/// Below this, 100 dB under the loudest, nothing is heard.
pub(super) const SILENCE: f32 = 1e-5;

/// Samples a second that a voice can be worked out at.
pub(super) fn sane_rate_hz(rate_hz: u32) -> f32 {
    rate_hz.clamp(8000, 384_000) as f32
}

/// A setting between two; what is no number counts as the lower.
pub(super) fn within(value: f32, least: f32, most: f32) -> f32 {
    if value.is_nan() { least } else { value.clamp(least, most) }
}

/// A number that follows its goal smoothly.
#[derive(Clone, Copy, Debug)]
pub(super) struct Smooth {
    now: f32,
    goal: f32,
    share: f32,
}

impl Smooth {
    pub(super) fn new(start: f32, time_s: f32, rate_hz: f32) -> Self {
        Self { now: start, goal: start, share: -(-1.0 / (time_s * rate_hz)).exp_m1() }
    }

    /// Goals that are no numbers change nothing.
    pub(super) fn aim(&mut self, goal: f32, least: f32, most: f32) {
        if goal.is_finite() {
            self.goal = goal.clamp(least, most);
        }
    }

    pub(super) fn next(&mut self) -> f32 {
        self.now += (self.goal - self.now) * self.share;
        self.now
    }

    pub(super) fn is_silent(&self) -> bool {
        self.goal == 0.0 && self.now < SILENCE
    }
}

/// White noise from -1 to 1.
#[derive(Clone, Debug)]
pub(super) struct Noise(Pcg32);

impl Noise {
    pub(super) fn new(seed: u64) -> Self {
        Self(Pcg32::seed_from_u64(seed))
    }

    pub(super) fn next(&mut self) -> f32 {
        self.0.next_u32() as f32 * (2.0 / u32::MAX as f32) - 1.0
    }

    /// From 0 to 1.
    pub(super) fn share(&mut self) -> f32 {
        0.5 * (self.next() + 1.0)
    }
}

/// A slow noise around 0, of deviation 1: what no hand and no machine holds steady.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wander {
    now: f32,
    share: f32,
    gain: f32,
}

impl Wander {
    pub(super) fn new(hz: f32, rate_hz: f32) -> Self {
        let share = -(-TAU * hz / rate_hz).exp_m1();
        // White noise from -1 to 1 has a variance of 1/3, of which the filter leaves share / (2 - share).
        Self { now: 0.0, share, gain: (3.0 * (2.0 - share) / share).sqrt() }
    }

    pub(super) fn next(&mut self, noise: &mut Noise) -> f32 {
        self.now += (noise.next() * self.gain - self.now) * self.share;
        self.now
    }
}

/// Where something that turns is. The frequency may change from sample to sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Phase {
    turns: f64,
}

impl Phase {
    /// Turns on; says whether a turn was completed.
    pub(super) fn advance(&mut self, turns: f32) -> bool {
        self.turns += f64::from(turns);
        let is_round = self.turns >= 1.0;
        self.turns = self.turns.fract();
        is_round
    }

    /// Part of the turn, from 0 to 1.
    pub(super) fn turns(&self) -> f32 {
        self.turns as f32
    }

    pub(super) fn sin_cos(&self) -> (f32, f32) {
        (self.turns as f32 * TAU).sin_cos()
    }

    pub(super) fn sin(&self) -> f32 {
        self.sin_cos().0
    }
}

/// A state-variable filter (trapezoidal, so that it may be tuned at any time).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Filter {
    k: f32,
    weights: [f32; 3],
    a: f32,
    b: f32,
}

/// What comes out of a [`Filter`].
pub(super) struct Bands {
    pub(super) low: f32,
    pub(super) band: f32,
    pub(super) high: f32,
}

impl Filter {
    pub(super) fn new(hz: f32, width: f32, rate_hz: f32) -> Self {
        let mut filter = Self::default();
        filter.tune(hz, width, rate_hz);
        filter
    }

    /// The band's height is 1 at any width; the width is a share of the frequency.
    pub(super) fn tune(&mut self, hz: f32, width: f32, rate_hz: f32) {
        let g = (PI * (hz / rate_hz).clamp(1e-5, 0.45)).tan();
        self.k = width.max(0.01);
        let first = 1.0 / (1.0 + g * (g + self.k));
        self.weights = [first, g * first, g * g * first];
    }

    pub(super) fn next(&mut self, sample: f32) -> Bands {
        let [first, second, third] = self.weights;
        let rest = sample - self.b;
        let band = first * self.a + second * rest;
        let low = self.b + second * self.a + third * rest;
        (self.a, self.b) = (2.0 * band - self.a, 2.0 * low - self.b);
        Bands { low, band: self.k * band, high: sample - self.k * band - low }
    }
}
