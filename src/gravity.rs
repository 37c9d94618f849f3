//! Which way is down.

use bevy::prelude::*;

/// Gravity in the world, for everything that flows and falls.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone)]
pub struct SurgeryGravity {
    /// Acceleration in the world, metres per second squared.
    pub world_m_per_s2: Vec3,
}

impl Default for SurgeryGravity {
    fn default() -> Self {
        Self { world_m_per_s2: Vec3::new(0.0, -9.81, 0.0) }
    }
}
