//! How well a scripted hand does what it does.

use bevy::prelude::*;

/// What tells one hand from another.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct Skill {
    /// How fast it moves between places, metres a second.
    pub speed_m_per_s: f32,
    /// Amplitude of its tremor of some ten times a second, metres.
    pub tremor_m: f32,
    /// How far beside what it aims at it arrives, metres.
    pub aim_error_m: f32,
    /// How deep it presses into soft tissue, metres.
    pub press_m: f32,
    /// How long it burns a place, seconds.
    pub burn_s: f32,
    /// Force with which it drills, newtons.
    pub drill_n: f32,
    /// How fast it leads a burr over bone, metres a second.
    pub stroke_m_per_s: f32,
    /// How far from critical structures it stops, metres; nothing is kept away from with 0.
    pub margin_m: f32,
    /// How long it waits before each thing that it does, seconds.
    pub pause_s: f32,
    /// Whether the other hand sucks.
    pub sucks: bool,
}

impl Skill {
    /// One who does this every day.
    pub const EXPERT: Self = Self {
        speed_m_per_s: 0.06,
        tremor_m: 4e-5,
        aim_error_m: 3e-4,
        press_m: 6e-4,
        burn_s: 3.0,
        drill_n: 3.0,
        stroke_m_per_s: 0.03,
        margin_m: 1.0e-3,
        pause_s: 0.2,
        sucks: true,
    };

    /// One who does it for the first time: hasty on the bone, slow to decide, shaky, and deaf to warnings.
    pub const NOVICE: Self = Self {
        speed_m_per_s: 0.03,
        tremor_m: 4e-4,
        aim_error_m: 7e-3,
        press_m: 7e-3,
        burn_s: 4.0,
        drill_n: 9.0,
        stroke_m_per_s: 0.08,
        margin_m: 0.0,
        pause_s: 1.5,
        sucks: false,
    };
}
