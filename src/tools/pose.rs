//! Where an instrument is and what is pressed on it; poses that are none, and jumps.

use super::{Tool, TouchTools};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Where a hand has an instrument. Write it in [`SurgerySystems::Sense`](crate::schedule::SurgerySystems::Sense); a
/// [`ServoSession`](super::ServoSession) beside the tool does so.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub struct ToolPose {
    /// Where and how turned.
    pub place: ToolPlace,
    /// Whether the hand holds it and is seen. Without that it touches nothing.
    pub is_tracked: bool,
}

impl ToolPose {
    /// Held at a place.
    pub fn at(tip_in_world_m: Vec3, world_from_tool: Quat) -> Self {
        Self { place: ToolPlace { tip_in_world_m, world_from_tool }, is_tracked: true }
    }

    /// Held with the tip at a place and the shaft towards another one.
    pub fn with_shaft_towards(tip_in_world_m: Vec3, back_in_world_m: Vec3) -> Self {
        let back = (back_in_world_m - tip_in_world_m).normalize_or(Vec3::Z);
        Self::at(tip_in_world_m, Quat::from_rotation_arc(Vec3::Z, back))
    }
}

/// Place and rotation of an instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct ToolPlace {
    /// Middle of the tip, world, metres.
    pub tip_in_world_m: Vec3,
    /// From the tool's axes to the world's: it points along -Z.
    pub world_from_tool: Quat,
}

impl ToolPlace {
    /// From the tip towards the hand, in the world.
    pub fn back_in_world(&self) -> Vec3 {
        self.world_from_tool * Vec3::Z
    }

    /// The same with a rotation of length one; none where its numbers are none.
    fn checked(self) -> Option<Self> {
        let world_from_tool = self.world_from_tool.normalize();
        let is_place = self.tip_in_world_m.is_finite() && world_from_tool.is_finite();
        is_place.then_some(Self { world_from_tool, ..self })
    }
}

/// What is pressed. Numbers out of range count as the nearest end, what is no number as 0.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub struct ToolCommand {
    /// How far the pedal is down, 0 to 1.
    pub pedal: f32,
    /// How far the second pedal is down, 0 to 1.
    pub second_pedal: f32,
    /// How far jaws are closed, 0 to 1.
    pub grip: f32,
    /// Asks a drill for its next burr ([`Tool::burrs`]): once each time it begins, and only while the burr stands still.
    #[serde(default)]
    pub next_burr: bool,
}

impl ToolCommand {
    /// From here on a pedal counts as down, and jaws as closed.
    pub const DOWN: f32 = 0.5;

    pub(super) fn clean(&self) -> Self {
        let share = |share: f32| if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
        Self {
            pedal: share(self.pedal),
            second_pedal: share(self.second_pedal),
            grip: share(self.grip),
            next_burr: self.next_burr,
        }
    }
}

/// How an instrument has moved in this step, as far as that can be believed. Written first in
/// [`SurgerySystems::Touch`](crate::schedule::SurgerySystems::Touch).
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ToolMotion {
    /// Where it was after the step before; none after it was away or has jumped.
    pub from: Option<ToolPlace>,
    /// Where it is; none while it is away.
    pub to: Option<ToolPlace>,
    /// Poses so far that were no poses, and were left out.
    pub dropped_poses: u64,
    /// Jumps so far: it was somewhere else at once, as when tracking was lost.
    pub jumps: u64,
}

/// What is believed of poses.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Resource, Default, Clone)]
pub struct ToolLimits {
    /// Speed of the tip beyond which it has jumped, metres per second.
    pub max_speed_m_per_s: f32,
}

impl Default for ToolLimits {
    /// 5 m/s: a stroke of the arm at its fastest, much more than surgery ever sees.
    fn default() -> Self {
        Self { max_speed_m_per_s: 5.0 }
    }
}

impl ToolMotion {
    /// Follows a pose over a step.
    pub(super) fn follow(&mut self, pose: &ToolPose, dt_s: f32, limits: &ToolLimits) {
        let before = self.to;
        self.from = None;
        if !pose.is_tracked {
            self.to = None;
            return;
        }
        let Some(place) = pose.place.checked() else {
            // It stays where it was, and is told of in the count.
            self.dropped_poses += 1;
            self.from = before;
            return;
        };
        self.to = Some(place);
        let Some(before) = before else { return };
        let most_m = limits.max_speed_m_per_s * dt_s.max(1e-3);
        if before.tip_in_world_m.distance(place.tip_in_world_m) > most_m {
            self.jumps += 1;
        } else {
            self.from = Some(before);
        }
    }
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<ToolLimits>()
        .register_type::<ToolPose>()
        .register_type::<ToolPlace>()
        .register_type::<ToolCommand>()
        .register_type::<ToolMotion>()
        .register_type::<ToolLimits>()
        .add_systems(FixedUpdate, follow_poses.in_set(TouchTools::Move));
}

type Moved = (&'static ToolPose, &'static mut ToolMotion, &'static mut Transform, Option<&'static ChildOf>);

/// Moves tools to their poses.
fn follow_poses(
    mut tools: Query<Moved, With<Tool>>,
    parents: Query<&GlobalTransform>,
    limits: Res<ToolLimits>,
    time: Res<Time>,
) {
    for (pose, mut motion, mut transform, parent) in &mut tools {
        motion.follow(pose, time.delta_secs(), &limits);
        let Some(place) = motion.to else { continue };
        let mut local = Transform { translation: place.tip_in_world_m, rotation: place.world_from_tool, ..*transform };
        if let Some(parent) = parent.and_then(|parent| parents.get(parent.parent()).ok()) {
            let placed = parent.affine().inverse() * Transform { scale: Vec3::ONE, ..local }.compute_affine();
            let (_, rotation, translation) = placed.to_scale_rotation_translation();
            (local.translation, local.rotation) = (translation, rotation);
        }
        transform.set_if_neq(local);
    }
}
