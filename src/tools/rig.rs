//! How the workspace of a device lies in the scene: where, how turned, at which scale, and what a clutch has moved.

use bevy::ecs::entity::MapEntities;
use bevy::ecs::template::{FromTemplate, SpecializeFromTemplate, Template, TemplateContext};
use bevy::math::{DAffine3, DMat3, DQuat, DVec3};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// What a workspace moves with.
#[derive(Clone, Copy, Debug, Default, FromTemplate, MapEntities, PartialEq, Reflect)]
#[reflect(Default)]
pub enum RigFrame {
    /// It stays in the world.
    #[default]
    World,
    /// It moves with an entity: a camera, so that right is right in the picture.
    Of(#[entities] Entity),
}

/// Leads from the space of a device to the world. In the device's space the hand sits at +Z, right is +X, up is +Y, as in a camera's.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ToolRig {
    /// What it moves with.
    #[entities]
    pub frame: RigFrame,
    /// Where the middle of the workspace lies in that frame, metres.
    pub centre_in_frame_m: Vec3,
    /// How the workspace is turned in that frame.
    pub frame_from_device: Quat,
    /// Metres in the scene per metre at the hand: below 1 for fine work under a microscope.
    pub scale: f32,
    /// Newtons at the hand per newton in the scene.
    pub force_scale: f32,
    /// Where the middle of the tip is in the handle's axes, scene metres.
    pub tip_in_handle_m: Vec3,
    /// What the clutch has done so far.
    pub clutch: ToolClutch,
}

/// What the clutch of a [`ToolRig`] has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct ToolClutch {
    /// Where the handle was when it was pressed, device space.
    held_at_m: Option<DVec3>,
    /// By how much the workspace was moved so far, in the frame.
    moved_m: DVec3,
    /// How often it jumped.
    revision: u64,
}

impl Default for ToolRig {
    fn default() -> Self {
        Self {
            frame: RigFrame::World,
            centre_in_frame_m: Vec3::ZERO,
            frame_from_device: Quat::IDENTITY,
            scale: 1.0,
            force_scale: 1.0,
            tip_in_handle_m: Vec3::ZERO,
            clutch: ToolClutch::default(),
        }
    }
}

/// Makes a [`ToolRig`] of a scene, whose frame may be another entity of the scene by its name.
pub struct ToolRigTemplate {
    /// What it moves with.
    pub frame: RigFrameTemplate,
    /// As in [`ToolRig`].
    pub centre_in_frame_m: Vec3,
    /// As in [`ToolRig`].
    pub frame_from_device: Quat,
    /// As in [`ToolRig`].
    pub scale: f32,
    /// As in [`ToolRig`].
    pub force_scale: f32,
    /// As in [`ToolRig`].
    pub tip_in_handle_m: Vec3,
}

impl Default for ToolRigTemplate {
    fn default() -> Self {
        let rig = ToolRig::default();
        Self {
            frame: RigFrameTemplate::default(),
            centre_in_frame_m: rig.centre_in_frame_m,
            frame_from_device: rig.frame_from_device,
            scale: rig.scale,
            force_scale: rig.force_scale,
            tip_in_handle_m: rig.tip_in_handle_m,
        }
    }
}

impl Template for ToolRigTemplate {
    type Output = ToolRig;

    fn build_template(&self, context: &mut TemplateContext) -> Result<ToolRig> {
        let &Self { ref frame, centre_in_frame_m, frame_from_device, scale, force_scale, tip_in_handle_m } = self;
        let (frame, clutch) = (frame.build_template(context)?, ToolClutch::default());
        Ok(ToolRig { frame, centre_in_frame_m, frame_from_device, scale, force_scale, tip_in_handle_m, clutch })
    }

    fn clone_template(&self) -> Self {
        Self { frame: self.frame.clone_template(), ..*self }
    }
}

impl FromTemplate for ToolRig {
    type Template = ToolRigTemplate;
}

// So that it has a template of its own although it has a default, as Bevy's derive does it.
impl Unpin for ToolRig where for<'a> [()]: SpecializeFromTemplate {}

impl ToolRig {
    /// Before a camera: the middle of the workspace lies at a distance along its view.
    pub fn before_camera(camera: Entity, distance_m: f32) -> Self {
        let centre_in_frame_m = Vec3::NEG_Z * distance_m;
        Self { frame: RigFrame::Of(camera), centre_in_frame_m, ..Self::default() }
    }

    /// In the world, with its middle at a place.
    pub fn at(centre_m: Vec3) -> Self {
        Self { centre_in_frame_m: centre_m, ..Self::default() }
    }

    /// Takes the handle's place and whether the clutch is held: while it is, the hand moves and the tool stays; from then on the
    /// tool goes on from where it was.
    pub fn hold_clutch(&mut self, is_held: bool, handle_m: DVec3) {
        match (is_held, self.clutch.held_at_m) {
            (true, None) if handle_m.is_finite() => self.clutch.held_at_m = Some(handle_m),
            (false, Some(held_at_m)) => {
                self.clutch.held_at_m = None;
                if handle_m.is_finite() {
                    self.clutch.moved_m += self.turn() * (held_at_m - handle_m);
                    self.clutch.revision += 1;
                }
            }
            _ => {}
        }
    }

    /// Whether the clutch is held.
    pub fn is_clutched(&self) -> bool {
        self.clutch.held_at_m.is_some()
    }

    /// Another number each time the clutch has let the tool go on from elsewhere.
    pub fn revision(&self) -> u64 {
        self.clutch.revision
    }

    /// Takes back all that the clutch has moved.
    pub fn centre(&mut self) {
        if self.clutch.moved_m != DVec3::ZERO {
            self.clutch.moved_m = DVec3::ZERO;
            self.clutch.revision += 1;
        }
    }

    /// Rotation and scale from the device's to the frame's axes.
    fn turn(&self) -> DMat3 {
        let scale = if self.scale.is_finite() && self.scale > 0.0 { f64::from(self.scale) } else { 1.0 };
        let rotation = self.frame_from_device.normalize();
        let rotation = if rotation.is_finite() { rotation.as_dquat() } else { DQuat::IDENTITY };
        DMat3::from_quat(rotation) * scale
    }

    /// From the device to the world, for a frame's place in the world; a frame's own scale does not count.
    pub fn world_from_device(&self, world_from_frame: &GlobalTransform) -> DAffine3 {
        let (_, rotation, translation) = world_from_frame.to_scale_rotation_translation();
        let frame = DAffine3::from_rotation_translation(rotation.as_dquat(), translation.as_dvec3());
        let centre_m = self.centre_in_frame_m.as_dvec3() + self.clutch.moved_m;
        frame * DAffine3::from_mat3_translation(self.turn(), centre_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DVec3, b: DVec3) {
        assert!(a.distance(b) < 1e-6, "{a} {b}");
    }

    #[test]
    fn a_rig_before_a_camera_turns_and_scales() {
        let camera = GlobalTransform::from(
            Transform::from_xyz(1.0, 2.0, 3.0).with_rotation(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2)),
        );
        let rig = ToolRig { scale: 0.5, ..ToolRig::before_camera(Entity::PLACEHOLDER, 0.2) };
        let map = rig.world_from_device(&camera);
        // The camera looks along -X: its right is -Z.
        close(map.transform_point3(DVec3::ZERO), DVec3::new(0.8, 2.0, 3.0));
        close(map.transform_vector3(DVec3::X), DVec3::NEG_Z * 0.5);
    }

    #[test]
    fn a_clutch_moves_the_hand_and_not_the_tool() {
        let mut rig = ToolRig { scale: 2.0, frame_from_device: Quat::from_rotation_z(0.5), ..ToolRig::at(Vec3::X) };
        let frame = GlobalTransform::IDENTITY;
        let (from, to) = (DVec3::new(0.01, 0.02, 0.03), DVec3::new(-0.05, 0.0, 0.04));
        let tool_m = rig.world_from_device(&frame).transform_point3(from);
        rig.hold_clutch(true, from);
        assert!(rig.is_clutched());
        rig.hold_clutch(true, DVec3::ONE);
        rig.hold_clutch(false, to);
        assert!(!rig.is_clutched());
        assert_eq!(rig.revision(), 1);
        close(rig.world_from_device(&frame).transform_point3(to), tool_m);
        rig.hold_clutch(false, from);
        assert_eq!(rig.revision(), 1, "it was let go of already");
        rig.centre();
        close(rig.world_from_device(&frame).transform_point3(DVec3::ZERO), DVec3::X);
        assert_eq!(rig.revision(), 2);
    }

    #[test]
    fn nonsense_is_no_rig_but_does_no_harm() {
        let mut rig = ToolRig { scale: f32::NAN, frame_from_device: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..default() };
        rig.hold_clutch(true, DVec3::NAN);
        assert!(!rig.is_clutched());
        close(rig.world_from_device(&GlobalTransform::IDENTITY).transform_point3(DVec3::ONE), DVec3::ONE);
    }
}
