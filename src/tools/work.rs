//! What an instrument does at present, for whoever shows or sounds it.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// What a tool does in this step: its voice, lamps and panels follow it. Written in
/// [`SurgerySystems::Touch`](crate::schedule::SurgerySystems::Touch) and, where fluid or tissue answers, in later stages.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub enum ToolWork {
    /// Nothing that is heard.
    #[default]
    Idle,
    /// A burr turns.
    Drilling {
        /// Turns per minute.
        speed_rpm: f32,
        /// With how much it presses on bone, newtons.
        force_n: f32,
        /// Share of the burr that is in bone, 0 to 1.
        contact: f32,
        /// Hardness of what it is in, as a multiple of cortical bone.
        hardness: f32,
    },
    /// A tip sucks.
    Sucking {
        /// Share of what it can, 0 to 1.
        strength: f32,
        /// Share of fluid in what it takes, 0 (air) to 1.
        liquid: f32,
    },
    /// An electrode burns tissue.
    Burning {
        /// Share of the power at which it is as loud as it gets, 0 to 1.
        heat: f32,
        /// Water that is left in the tissue under it, 0 (char) to 1.
        water: f32,
    },
}
