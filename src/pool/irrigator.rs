//! The suction-irrigator as surgeons asked for it (paper of 2009, section 7): it irrigates all the time and sucks when told to.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Water that comes out of a tip, and a tube that takes fluid in. On an entity whose transform's origin is the tip; the jet
/// leaves along its forward direction (-Z).
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
#[require(Transform, SuctionState)]
#[serde(default)]
pub struct SuctionIrrigator {
    /// Water per second, millilitres; runs all the time.
    pub irrigation_ml_s: f32,
    /// Speed of the jet, metres per second.
    pub jet_m_s: f32,
    /// Most that it sucks in per second, air and fluid together, millilitres.
    pub suction_ml_s: f32,
    /// Whether it sucks.
    pub is_sucking: bool,
    /// Radius of the tip, metres.
    pub tip_radius_m: f32,
}

impl Default for SuctionIrrigator {
    fn default() -> Self {
        Self { irrigation_ml_s: 0.3, jet_m_s: 0.5, suction_ml_s: 2.0, is_sucking: false, tip_radius_m: 1e-3 }
    }
}

/// What a [`SuctionIrrigator`] took in the last step.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct SuctionState {
    /// Fluid, millilitres per second.
    pub fluid_ml_s: f32,
    /// Share of air in all that it took; 0 while it does not suck.
    pub air_share: f32,
}

/// A sucker takes air and fluid at once. Written in [`SurgerySystems::Flow`](crate::schedule::SurgerySystems::Flow) in each step
/// in which that is so; sounds use it.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct SuctionGurgled {
    /// The sucker.
    pub tool: Entity,
    /// Share of air in what it takes, above 0 and below 1.
    pub air_share: f32,
    /// Where, in the world, metres.
    pub place_world_m: Vec3,
}

/// Share of fluid in what a tip takes whose middle is so high over the fluid, metres; without any where there is none under it.
pub(super) fn fluid_share(height_m: f32, tip_radius_m: f32) -> f32 {
    // A tip draws fluid up from a little below it.
    let reach_m = 2.0 * tip_radius_m;
    let share = (0.5 - 0.5 * height_m / reach_m).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
