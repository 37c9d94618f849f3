//! What the simulation tells the loop.

use crate::haptics::force::{BonePatch, ContactPatch, SurfacePatch, ToolCapsule, ToolLoad, TurningBurr};
use bevy::reflect::Reflect;
use glam::{DAffine3, DQuat, DVec3};
use std::sync::Arc;

/// How many bodies the loop looks at; more are left out. Put the nearest first.
pub const MAX_BODIES: usize = 16;

/// How the device's workspace lies in the world.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct ServoRig {
    /// From device space to the world: turned, moved, and evenly scaled by metres in the world per metre at the hand. Clutch and
    /// camera are in it. Small changes are followed smoothly until the next scene.
    pub world_from_device: DAffine3,
    /// Newtons at the hand per newton in the world.
    pub force_scale: f64,
    /// Another number: the tool has jumped, as after a clutch. The loop begins anew there.
    pub revision: u64,
    /// Whether the hand moves the tool. False while a clutch is held: then there is no force.
    pub is_engaged: bool,
}

impl Default for ServoRig {
    fn default() -> Self {
        Self { world_from_device: DAffine3::IDENTITY, force_scale: 1.0, revision: 0, is_engaged: true }
    }
}

/// A rig taken apart, so that it can be moved smoothly.
#[derive(Clone, Copy, Debug)]
pub(super) struct RigPose {
    pub(super) rotation: DQuat,
    pub(super) scale: f64,
    pub(super) origin_m: DVec3,
}

impl RigPose {
    /// None where the map is no rig.
    pub(super) fn new(rig: &ServoRig) -> Option<Self> {
        let axes = rig.world_from_device.matrix3;
        let volume = axes.determinant();
        let is_rig = rig.world_from_device.is_finite() && volume > 0.0 && rig.force_scale.is_finite();
        if !is_rig {
            return None;
        }
        let scale = volume.cbrt();
        let rotation = DQuat::from_mat3(&(axes * (1.0 / scale))).normalize();
        rotation.is_finite().then_some(Self { rotation, scale, origin_m: rig.world_from_device.translation })
    }

    pub(super) fn towards(&self, other: &Self, share: f64) -> Self {
        Self {
            rotation: self.rotation.slerp(other.rotation, share).normalize(),
            scale: self.scale + (other.scale - self.scale) * share,
            origin_m: self.origin_m.lerp(other.origin_m, share),
        }
    }

    pub(super) fn place(&self, device_m: DVec3) -> DVec3 {
        self.origin_m + self.rotation * (device_m * self.scale)
    }
}

/// What the hand holds.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct ServoTool {
    /// The middle of its tip in the handle's axes, world metres.
    pub tip_in_handle_m: DVec3,
    /// Radius of the ball at the tip, metres.
    pub tip_radius_m: f64,
    /// Length of the shaft behind the tip, metres; 0 for none that touches.
    pub shaft_length_m: f64,
    /// Radius of the shaft, metres.
    pub shaft_radius_m: f64,
    /// A burr instead of the ball while it turns: it goes into bone.
    pub burr: Option<TurningBurr>,
    /// Weight, drag and pull.
    pub load: ToolLoad,
}

impl Default for ServoTool {
    /// A probe with a tip of 2 mm across, and no shaft.
    fn default() -> Self {
        Self {
            tip_in_handle_m: DVec3::ZERO,
            tip_radius_m: 1e-3,
            shaft_length_m: 0.0,
            shaft_radius_m: 0.0,
            burr: None,
            load: ToolLoad::default(),
        }
    }
}

impl ServoTool {
    /// The direction from the tip to the hand, in the handle's axes.
    pub(super) const BACK: DVec3 = DVec3::Z;

    /// The burr if it turns.
    pub fn turning(&self) -> Option<&TurningBurr> {
        self.burr.as_ref().filter(|burr| burr.speed_rpm.is_finite() && burr.speed_rpm != 0.0)
    }

    /// Its parts, for a rotation from the handle's axes to the world's.
    pub(super) fn parts(&self, world_from_handle: DQuat) -> ([ToolCapsule; 2], usize) {
        // Never thinner than what single precision tells apart in a room.
        let radius = |radius_m: f64| if radius_m.is_finite() { radius_m.max(1e-4) } else { 1e-4 };
        let tip = ToolCapsule { ends_m: [DVec3::ZERO; 2], radius_m: radius(self.tip_radius_m) };
        if !(self.shaft_length_m.is_finite() && self.shaft_length_m > 0.0) {
            return ([tip; 2], 1);
        }
        let back_m = world_from_handle * (Self::BACK * self.shaft_length_m);
        ([tip, ToolCapsule { ends_m: [DVec3::ZERO, back_m], radius_m: radius(self.shaft_radius_m) }], 2)
    }
}

/// Outline of a body.
#[derive(Clone, Debug)]
pub enum ServoShape {
    /// A piece of an organ.
    Surface(Arc<SurfacePatch>),
    /// Bone.
    Bone(Arc<BonePatch>),
    /// A plane or a ball of an elastic body.
    Contact(ContactPatch),
}

/// Something near the tool.
#[derive(Clone, Debug)]
pub struct ServoBody {
    /// Comes back in contacts: the bits of an entity, say.
    pub id: u64,
    /// What it is.
    pub shape: ServoShape,
}

/// What the simulation knows around the tool, in the world.
#[derive(Clone, Debug)]
pub struct ServoScene {
    /// The simulation's time, seconds; comes back in the state.
    pub time_s: f64,
    /// When the next one will come, seconds from now: until then things move from where they were to where they are.
    pub interval_s: f64,
    /// Where the device stands.
    pub rig: ServoRig,
    /// What the hand holds.
    pub tool: ServoTool,
    /// What is near.
    pub bodies: Vec<ServoBody>,
}

impl Default for ServoScene {
    fn default() -> Self {
        let (rig, tool) = (ServoRig::default(), ServoTool::default());
        Self { time_s: 0.0, interval_s: 1.0 / 60.0, rig, tool, bodies: Vec::new() }
    }
}
