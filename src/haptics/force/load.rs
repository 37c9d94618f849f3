//! What a hand feels of a tool that touches nothing solid: its weight, what it holds, the drag of what it sucks.

use bevy::reflect::Reflect;
use glam::DVec3;

/// Forces of a tool that need no contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct ToolLoad {
    /// What is felt of the tool's own mass, kilograms.
    pub mass_kg: f64,
    /// Mass that hangs in a grasper, kilograms.
    pub held_mass_kg: f64,
    /// Which way is down and how much, world, metres per second squared.
    pub gravity_m_per_s2: DVec3,
    /// Drag against motion, newton seconds per metre: liquid, or tissue before a sucker.
    pub drag_n_s_per_m: f64,
    /// A steady pull in the world, newtons: tissue that is sucked in or stretched.
    pub pull_n: DVec3,
}

impl ToolLoad {
    /// The force on the hand; drag is no stronger than a limit. Numbers that are none count as 0.
    pub fn force_n(&self, velocity_m_per_s: DVec3, max_drag_n_s_per_m: f64) -> DVec3 {
        let finite = |force: DVec3| if force.is_finite() { force } else { DVec3::ZERO };
        let mass_kg = (self.mass_kg + self.held_mass_kg).max(0.0);
        let drag = self.drag_n_s_per_m.clamp(0.0, max_drag_n_s_per_m.max(0.0));
        finite(self.gravity_m_per_s2 * mass_kg) - finite(velocity_m_per_s * drag) + finite(self.pull_n)
    }
}
