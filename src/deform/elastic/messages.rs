//! What instruments tell bodies, and bodies answer.

use super::touch::ToolShape;
use bevy::prelude::*;

/// An instrument that may touch a body in this step. Write it in each step before
/// [`SurgerySystems::Deform`](crate::schedule::SurgerySystems::Deform) while it is near.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct PressBody {
    /// The body.
    pub body: Entity,
    /// Which instrument: a number of your own. One that goes on from step to step moves in between.
    pub tool: u32,
    /// Its shape now; world, metres.
    pub shape: ToolShape,
    /// Friction between it and the tissue (force along per force across); wet metal on tissue has 0.05 to 0.2.
    pub friction: f32,
}

/// Jaws that are closed in this step. Write it in each step while they are; what they hold is decided in the first one.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct GraspBody {
    /// The body.
    pub body: Entity,
    /// Which instrument: a number of your own.
    pub tool: u32,
    /// Middle of the jaws; world, metres.
    pub position_world_m: Vec3,
    /// How they are turned; tissue between them turns along.
    pub rotation_world: Quat,
    /// They hold the surface within this distance, metres.
    pub radius_m: f32,
    /// Force that closes them, newtons.
    pub grip_force_n: f32,
    /// Friction of their inner sides; teeth have 0.5 to 1. Tissue slips out where the pull exceeds this share of the grip.
    pub friction: f32,
}

/// An instrument touches a body.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct BodyContact {
    /// The body.
    pub body: Entity,
    /// Which instrument.
    pub tool: u32,
    /// Force on the instrument; world, newtons.
    pub force_world_n: Vec3,
    /// How far the surface gives way, metres.
    pub depth_m: f32,
    /// Where; world, metres.
    pub position_world_m: Vec3,
}

/// Jaws hold tissue.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct GraspHeld {
    /// The body.
    pub body: Entity,
    /// Which instrument.
    pub tool: u32,
    /// Force on the instrument; world, newtons.
    pub force_world_n: Vec3,
    /// Greatest stretch of the tissue where it is held: 1 at rest.
    pub stretch: f32,
}

/// Tissue slipped out of jaws: the pull exceeded what their grip holds. They have to be opened before they grasp anew.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct GraspSlipped {
    /// The body.
    pub body: Entity,
    /// Which instrument.
    pub tool: u32,
    /// Pull at that moment, newtons.
    pub pull_n: f32,
    /// Where; world, metres.
    pub position_world_m: Vec3,
}

/// Tissue tore where jaws held it; they hold it no longer.
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct TissueTorn {
    /// The body.
    pub body: Entity,
    /// Which instrument.
    pub tool: u32,
    /// Pull at that moment, newtons.
    pub pull_n: f32,
    /// Stretch at that moment.
    pub stretch: f32,
    /// Where; world, metres.
    pub position_world_m: Vec3,
}
