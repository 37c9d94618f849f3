//! Passivity: what a hand gets out of a virtual thing must not be more than it put in.
//!
//! The force that a tick sets is held until the next, while the handle moves on: the work it does on the hand is known one tick
//! later. A spring that is held so gives back a little more than it took, and what the device's own friction does not eat makes it
//! hum. The observer sums that work; once more came out than went in, a damper takes it back, never a stronger one than the device
//! bears.

use bevy::reflect::Reflect;
use glam::DVec3;

/// Sums the work of contact on the hand, and says how much damping takes the excess back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct PassivityObserver {
    /// Work on the hand since contact began, joules; above 0 it was more than the hand's.
    out_j: f64,
    /// The force that the handle bears until the next tick.
    held_force_n: DVec3,
    /// How long there was no contact, seconds.
    free_s: f64,
    total_out_j: f64,
}

/// Seconds without contact after which the next one begins anew.
const FREE_S: f64 = 0.05;

impl PassivityObserver {
    /// Counts what the force that was held until now did while the handle moved. `lent_j` is the work of what moves by itself, a
    /// surface that pulses: that is no fault of the loop.
    pub fn observe(&mut self, moved_m: DVec3, lent_j: f64, dt_s: f64) {
        let work_j = self.held_force_n.dot(moved_m);
        self.total_out_j += work_j;
        if self.held_force_n == DVec3::ZERO {
            self.free_s += dt_s;
            if self.free_s >= FREE_S {
                self.out_j = 0.0;
            }
        } else {
            self.free_s = 0.0;
            self.out_j += work_j - lent_j.max(0.0);
        }
    }

    /// The contact force to be held from now on, with what the observer adds to it: damping that takes back the excess within a
    /// tick, as far as the limit goes.
    pub fn hold(&mut self, force_n: DVec3, velocity_m_per_s: DVec3, limit_n_s_per_m: f64, dt_s: f64) -> DVec3 {
        let speed2 = velocity_m_per_s.length_squared();
        let damping = if self.out_j > 0.0 && speed2 > 1e-10 && force_n != DVec3::ZERO {
            (self.out_j / (speed2 * dt_s.max(1e-6))).min(limit_n_s_per_m.max(0.0))
        } else {
            0.0
        };
        self.held_force_n = force_n - velocity_m_per_s * damping;
        self.held_force_n
    }

    /// Notes the force that the device was told in the end, where that differs.
    pub fn held(&mut self, force_n: DVec3) {
        self.held_force_n = force_n;
    }

    /// Work on the hand in this contact, less what was lent, joules. Above 0: the contact is active.
    pub fn excess_j(&self) -> f64 {
        self.out_j
    }

    /// Work of contact on the hand since the beginning, joules.
    pub fn total_out_j(&self) -> f64 {
        self.total_out_j
    }

    /// Forgets the contact, as after a jump.
    pub fn reset(&mut self) {
        *self = Self { total_out_j: self.total_out_j, ..Self::default() };
    }
}
