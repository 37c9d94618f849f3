//! What stands between the models and the hand: last in the chain, always on.
//!
//! [`Tracking`] looks at what comes from a device, [`SafetyChain`] at what goes to it. Whatever a model computes, the force is a
//! number, within the device's limits, never grows faster than the device may, and comes on softly: after a start, a jump, a
//! number that is none, or a simulation that stalled, the force is zero until the hand touches (almost) nothing, and then grows from
//! nothing over [`SafetySettings::ramp_s`].

mod tracking;

pub use tracking::{Tracked, Tracking};

use super::device::DeviceLimits;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How careful the chain is. Limits of force and slew are the device's own, and these can only lower them.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct SafetySettings {
    /// Greatest force as a share of the device's, up to 1.
    pub force_share: f64,
    /// Forces of contact below which the chain engages, newtons.
    pub engage_force_n: f64,
    /// For how many ticks on end they must be.
    pub engage_ticks: u32,
    /// How long the force grows until it is whole, seconds.
    pub ramp_s: f64,
    /// How long the simulation may be silent, seconds.
    pub silence_s: f64,
    /// How long the force then takes to vanish, seconds.
    pub fade_s: f64,
    /// The longest tick that is still one, seconds: after a longer one the chain engages anew.
    pub longest_tick_s: f64,
    /// Speeds of the handle beyond which tracking was lost, metres per second.
    pub max_speed_m_per_s: f64,
    /// How long a device that counts time may repeat itself, seconds.
    pub stale_s: f64,
}

impl Default for SafetySettings {
    fn default() -> Self {
        Self {
            force_share: 1.0,
            engage_force_n: 0.2,
            engage_ticks: 4,
            ramp_s: 0.3,
            silence_s: 0.1,
            fade_s: 0.05,
            longest_tick_s: 0.02,
            max_speed_m_per_s: 5.0,
            stale_s: 0.1,
        }
    }
}

/// What goes into the chain in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// The force that the models want, device space, newtons.
    pub force_n: DVec3,
    /// The share of it that comes from contact, newtons: weight and drag do not keep the chain from engaging.
    pub contact_n: f64,
    /// For how long the simulation has been silent, seconds.
    pub silent_s: f64,
    /// Whether the handle's place is known and the hand holds the tool.
    pub is_held: bool,
}

/// Why there is no force, or less.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
pub enum ForceState {
    /// Waiting for a moment without contact.
    #[default]
    Waiting,
    /// Growing.
    Ramping,
    /// Whole.
    Whole,
    /// The simulation is silent.
    Silent,
    /// The place of the handle is not known, or the tool is not held.
    NotHeld,
}

impl ForceState {
    /// Whether the hand feels anything.
    pub fn is_on(self) -> bool {
        matches!(self, Self::Ramping | Self::Whole)
    }
}

/// The last link before the device.
#[derive(Clone, Debug)]
pub struct SafetyChain {
    settings: SafetySettings,
    max_force_n: f64,
    max_slew_n_per_s: f64,
    low_ticks: u32,
    is_engaged: bool,
    /// From 0 to 1, grows while engaged.
    ramp: f64,
    /// From 1 to 0, falls while the simulation is silent.
    fade: f64,
    last_n: DVec3,
    not_numbers: u64,
}

impl SafetyChain {
    /// A chain for a device. Limits that are no numbers count as 0.
    pub fn new(limits: &DeviceLimits, settings: SafetySettings) -> Self {
        let sane = |value: f64| if value.is_finite() { value.max(0.0) } else { 0.0 };
        Self {
            settings,
            max_force_n: sane(limits.max_force_n) * sane(settings.force_share).min(1.0),
            max_slew_n_per_s: sane(limits.max_slew_n_per_s),
            low_ticks: 0,
            is_engaged: false,
            ramp: 0.0,
            fade: 1.0,
            last_n: DVec3::ZERO,
            not_numbers: 0,
        }
    }

    /// Zero force now, and engages anew.
    pub fn trip(&mut self) {
        (self.is_engaged, self.low_ticks, self.ramp, self.last_n) = (false, 0, 0.0, DVec3::ZERO);
    }

    /// The force for the device.
    pub fn limit(&mut self, wanted: Wanted, dt_s: f64) -> DVec3 {
        let is_tick = dt_s.is_finite() && dt_s > 0.0 && dt_s <= self.settings.longest_tick_s;
        if !(wanted.force_n.is_finite() && wanted.contact_n.is_finite()) {
            self.not_numbers += 1;
            self.trip();
            return DVec3::ZERO;
        }
        if !(is_tick && wanted.is_held) {
            self.trip();
            return DVec3::ZERO;
        }
        self.engage(wanted.contact_n, dt_s);
        // A silent simulation fades the force out; one that speaks again brings it back as slowly as a first touch.
        if wanted.silent_s <= self.settings.silence_s {
            self.fade = (self.fade + dt_s / self.settings.ramp_s.max(dt_s)).min(1.0);
        } else {
            self.fade = (self.fade - dt_s / self.settings.fade_s.max(dt_s)).max(0.0);
        }
        let aim_n = (wanted.force_n * (self.ramp * self.fade)).clamp_length_max(self.max_force_n);
        let step_n = (aim_n - self.last_n).clamp_length_max(self.max_slew_n_per_s * dt_s);
        // Rounding of the sum must not pass the limit.
        self.last_n = (self.last_n + step_n).clamp_length_max(self.max_force_n);
        self.last_n
    }

    fn engage(&mut self, contact_n: f64, dt_s: f64) {
        if !self.is_engaged {
            self.low_ticks = if contact_n.abs() < self.settings.engage_force_n { self.low_ticks + 1 } else { 0 };
            self.is_engaged = self.low_ticks >= self.settings.engage_ticks;
        }
        if self.is_engaged {
            self.ramp = (self.ramp + dt_s / self.settings.ramp_s.max(dt_s)).min(1.0);
        }
    }

    /// How many forces were no numbers.
    pub fn not_numbers(&self) -> u64 {
        self.not_numbers
    }

    /// What the chain does, given what went in.
    pub fn state(&self, is_held: bool) -> ForceState {
        match () {
            () if !is_held => ForceState::NotHeld,
            () if !self.is_engaged => ForceState::Waiting,
            () if self.fade < 1.0 => ForceState::Silent,
            () if self.ramp < 1.0 => ForceState::Ramping,
            () => ForceState::Whole,
        }
    }
}
