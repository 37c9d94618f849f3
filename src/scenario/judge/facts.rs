//! What goals and rules look at: one step in plain numbers.

use bevy::reflect::Reflect;
use glam::Vec3;

/// Everything that is known of a step. Structures and lesions are those that the scenario names, in the order of its
/// [`Targets`](super::Targets).
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct Facts {
    /// The step, from 0.
    pub step: u64,
    /// Its length, seconds.
    pub dt_s: f32,
    /// Instruments, in the log's order.
    pub tools: Vec<ToolFacts>,
    /// Structures.
    pub structures: Vec<StructureFacts>,
    /// Sets of lesions.
    pub lesions: Vec<LesionFacts>,
    /// What was removed in this step.
    pub removals: Vec<RemovalFacts>,
    /// Blood that was lost so far, millilitres.
    pub lost_ml: f64,
    /// Blood that is lost now, millilitres a second.
    pub bleeding_ml_s: f64,
    /// Share of the pool under which nothing can be seen; none where there is none.
    pub hidden: Option<f32>,
    /// Pairs of instruments that touch each other.
    pub collisions: Vec<[u32; 2]>,
}

/// An instrument in a step.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct ToolFacts {
    /// Where its tip is, world, metres; none where it is not tracked.
    pub tip_m: Option<Vec3>,
    /// How fast that moves, metres a second.
    pub speed_m_per_s: f32,
    /// Force of all bodies on it, newtons.
    pub force_n: f32,
    /// Diameter of its burr, metres, while that turns.
    pub turning_burr_m: Option<f32>,
    /// How far its tip's surface is from the nearest critical structure of a volume, metres; none where it is near none.
    pub critical_m: Option<f32>,
}

/// A structure in a step.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct StructureFacts {
    /// Share of it that is removed, 0 to 1.
    pub removed_share: f32,
    /// How much that is, mm³.
    pub removed_mm3: f32,
    /// Share of what of it is turned to the eye that can be seen; none where that was not looked at in this step.
    pub exposed_share: Option<f32>,
    /// For each instrument whether it touches it.
    pub is_touched: Vec<bool>,
    /// For each instrument how far its tip's surface is from it, metres; none beyond what anyone asks for.
    pub distance_m: Vec<Option<f32>>,
}

/// A set of lesions in a step.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct LesionFacts {
    /// For each whether the tip of an instrument is on it.
    pub is_touched: Vec<bool>,
    /// For each the share of its area that is coagulated.
    pub coagulated: Vec<f32>,
    /// Area that is coagulated outside of all of them, mm².
    pub outside_mm2: f32,
}

/// Something was removed in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct RemovalFacts {
    /// By which instrument.
    pub tool: Option<u32>,
    /// How much, mm³.
    pub mm3: f32,
    /// Share that the eye saw; none without an eye.
    pub seen: Option<f32>,
    /// Where, world, metres.
    pub centroid_m: Vec3,
}
