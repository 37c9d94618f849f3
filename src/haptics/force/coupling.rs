//! The spring and damper between the handle and the proxy: as stiff as wanted, as the device bears, and as sampling allows.

use super::SurfaceFeel;
use crate::haptics::device::{DeviceLimits, PASSIVE_SHARE};

/// What the loop may couple with, in the world's metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    max_stiffness_n_per_m: f64,
    max_damping_n_s_per_m: f64,
    own_damping_n_s_per_m: f64,
    own_mass_kg: f64,
    period_s: f64,
    /// Newtons per metre at the handle for one in the world.
    hand_from_world: f64,
}

impl Coupling {
    /// For a device, a period of the loop, and a rig: a metre at the handle is `scale` metres in the world, and a newton in the world
    /// `force_scale` at the handle.
    pub fn new(limits: &DeviceLimits, period_s: f64, scale: f64, force_scale: f64) -> Self {
        let sane = |value: f64| if value.is_finite() { value.max(0.0) } else { 0.0 };
        Self {
            max_stiffness_n_per_m: sane(limits.max_stiffness_n_per_m),
            max_damping_n_s_per_m: sane(limits.max_damping_n_s_per_m),
            own_damping_n_s_per_m: sane(limits.own_damping_n_s_per_m),
            own_mass_kg: sane(limits.own_mass_kg),
            period_s: sane(period_s).max(1e-5),
            hand_from_world: sane(scale * force_scale),
        }
    }

    /// The stiffest spring in the world's metres: within the device's limit and `K < 2 b / T`.
    pub fn max_stiffness_n_per_m(&self) -> f64 {
        let stable = PASSIVE_SHARE * 2.0 * self.own_damping_n_s_per_m / self.period_s;
        self.in_world(self.max_stiffness_n_per_m.min(stable))
    }

    fn in_world(&self, at_the_hand: f64) -> f64 {
        if self.hand_from_world > 0.0 { at_the_hand / self.hand_from_world } else { 0.0 }
    }

    /// A spring and damper that feel like this as nearly as is stable: Colgate's `b > K T / 2 + B`, and never damped more than
    /// critically.
    pub fn limited(&self, feel: &SurfaceFeel) -> (f64, f64) {
        let stiffness = feel.stiffness_n_per_m.min(self.max_stiffness_n_per_m()).max(0.0);
        let at_the_hand = stiffness * self.hand_from_world;
        let left = PASSIVE_SHARE * self.own_damping_n_s_per_m - at_the_hand * self.period_s * 0.5;
        let critical = 2.0 * (self.own_mass_kg * at_the_hand).sqrt();
        let most = left.min(critical).min(self.max_damping_n_s_per_m).max(0.0);
        (stiffness, feel.damping_n_s_per_m.min(self.in_world(most)).max(0.0))
    }

    /// The strongest drag in the world's metres.
    pub fn drag_n_s_per_m(&self) -> f64 {
        self.in_world(self.controller_damping_n_s_per_m())
    }

    /// How much damping the passivity controller may add, at the hand: with more than half of `m / T` the damper itself would
    /// overshoot.
    pub fn controller_damping_n_s_per_m(&self) -> f64 {
        self.max_damping_n_s_per_m.min(0.25 * self.own_mass_kg / self.period_s)
    }
}
