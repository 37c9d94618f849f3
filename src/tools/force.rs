//! Forces of an instrument that something has measured: a servo loop, or a program of yours.

use bevy::prelude::*;

/// What a hand presses with, where that is known. Written in
/// [`SurgerySystems::Sense`](crate::schedule::SurgerySystems::Sense); without it forces follow from how deep the tool is in
/// what it touches, and how stiff that feels.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ToolForce {
    /// Force of each body on the tool.
    pub by_body: Vec<BodyForce>,
    /// Force of a running burr on bone, in the mean over the step, newtons.
    pub drilling_n: Option<f32>,
    /// Whether the above is known; then bodies that are missing press with nothing.
    pub is_known: bool,
}

/// Force of one body.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct BodyForce {
    /// The body.
    pub body: Entity,
    /// Force on the tool, world, newtons.
    pub force_world_n: Vec3,
}

impl ToolForce {
    /// Force of a body on the tool, newtons; none where it is not known.
    pub fn of_body_n(&self, body: Entity) -> Option<f32> {
        let force_n =
            self.by_body.iter().filter(|force| force.body == body).map(|force| force.force_world_n).sum::<Vec3>();
        self.is_known.then(|| force_n.length()).filter(|force_n| force_n.is_finite())
    }
}
