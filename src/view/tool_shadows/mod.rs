//! Soft shadows of tools on tissue (paper of 2009, section 5.5).
//!
//! A lamp with [`ToolShadows`] sees the meshes that carry [`ToolShadow`] in a shadow map. After all layers of the organs
//! the picture of every camera is darkened where the map has something between lamp and surface, in screen space, by
//! [`SHADOW_TAPS`] look-ups per pixel spread over a disk.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_surgery::prelude::*;
//! # fn setup(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>) {
//! let probe = Mesh3d(meshes.add(Capsule3d::new(0.002, 0.1)));
//! commands.spawn((probe, ToolShadow));
//! let lamp = Transform::from_xyz(0.1, 0.2, 0.1).looking_at(Vec3::ZERO, Vec3::Y);
//! commands.spawn((ScopeLight::default(), ToolShadows::default(), lamp));
//! # }
//! ```
//!
//! - **What receives** is what this crate's passes, or layers of your own, drew between Bevy's opaque and transparent
//!   passes: pixels whose depth changed since the opaque pass. What Bevy's opaque pass drew, the tools themselves among
//!   it, stays as it is. As no caster receives, a surface cannot shade itself: there is no bias, and shadows begin where
//!   a tool touches.
//! - **What casts** is the mesh at rest: skinning and morph targets are not applied. Tools out of a camera's view cast,
//!   hidden ones do not. [`RenderLayers`](bevy::camera::visibility::RenderLayers) of lamp and tool must meet, and those
//!   of lamp and camera.
//! - **Cost**: the map is drawn once per lamp, and only after lamp or tools moved. Without a lamp or without tools nothing
//!   is drawn or copied. Up to [`MAX_SHADOW_LAMPS`] lamps; of more those whose
//!   entities come first.

mod apply;
mod extract;
mod lens;
mod map;
mod prepare;

pub use lens::{SHADOW_TAPS, ShadowLens, ShadowMapPlace, shadow_noise};
pub use map::{ToolCasterUniform, ToolShadowMaps};
pub use prepare::ToolShadowUniform;

use crate::render::{OrganPasses, VolumePasses, finite_within};
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems, camera_driver};
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::render::render_resource::SpecializedMeshPipelines;
use bevy::render::renderer::{RenderGraph, RenderGraphSystems};
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

/// How many lamps cast shadows of tools at once.
pub const MAX_SHADOW_LAMPS: usize = 2;

/// Marks an entity with a [`Mesh3d`] as a part of a tool that casts shadows.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ToolShadow;

/// A lamp that tools cast shadows from, shining along -Z of its entity; usually beside a
/// [`ScopeLight`](super::ScopeLight), and off the camera, because shadows of a lamp at the eye are not seen.
///
/// Numbers out of range are clamped where they are used; for those that are not finite the default's are taken.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform, Visibility)]
pub struct ToolShadows {
    /// Share of the picture's light that a full shadow takes, 0 to 1. The rest comes from elsewhere in the room.
    pub strength: f32,
    /// Radius on the surface that the edge is blurred over, metres. At least a texel of the map, at most an eighth of it.
    pub softness_m: f32,
    /// Width and height of the shadow map in texels, 16 to 4096.
    pub resolution_px: u32,
    /// Half angle of the square cone that the map covers, radians, 0.01 to 1.5. Beyond it everything is lit.
    pub half_angle_rad: f32,
    /// Nearest distance along the axis at which tools cast, metres, at least a tenth of a millimetre. There is no
    /// farthest one.
    pub near_m: f32,
}

impl Default for ToolShadows {
    fn default() -> Self {
        Self {
            strength: 0.6,
            softness_m: 0.001,
            resolution_px: 1024,
            half_angle_rad: 20_f32.to_radians(),
            near_m: 0.005,
        }
    }
}

impl ToolShadows {
    /// The map's camera at a place in the world; `None` where the place is not finite.
    pub fn to_lens(&self, transform: &GlobalTransform) -> Option<ShadowLens> {
        let default = Self::default();
        let half_angle_rad = finite_within(self.half_angle_rad, 0.01, 1.5, default.half_angle_rad);
        // Scale is none of the lamp's business.
        let (_, rotation, translation) = transform.to_scale_rotation_translation();
        let has_place = translation.length_squared().is_finite() && rotation.is_normalized();
        has_place.then(|| ShadowLens {
            world_from_lamp: Affine3A::from_rotation_translation(rotation, translation),
            tan_half_angle: half_angle_rad.tan(),
            near_m: finite_within(self.near_m, 1e-4, 1e3, default.near_m),
            resolution_px: self.resolution_px.clamp(16, 4096),
            softness_m: finite_within(self.softness_m, 0.0, 10.0, default.softness_m),
            strength: finite_within(self.strength, 0.0, 1.0, default.strength),
        })
    }
}

/// The steps of tool shadows in a camera's `Core3d`.
///
/// Whatever is to receive shadows must be drawn between the two, and write depth.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ToolShadowPasses {
    /// Keeps the depth of what does not receive; after Bevy's opaque pass, before volumes and organs.
    KeepDepth,
    /// Darkens what was drawn since; after the organs' layers, before Bevy's transparent pass.
    Apply,
}

pub(super) fn build(app: &mut App) {
    app.register_type::<ToolShadow>()
        .register_type::<ToolShadows>()
        .register_type::<ShadowLens>()
        .register_type::<ShadowMapPlace>();
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .configure_sets(
            Core3d,
            (
                ToolShadowPasses::KeepDepth.after(main_opaque_pass_3d).before(VolumePasses),
                ToolShadowPasses::Apply.after(OrganPasses::Highlights).before(main_transparent_pass_3d),
            )
                .in_set(Core3dSystems::MainPass),
        )
        .init_resource::<extract::ExtractedToolShadows>()
        .init_gpu_resource::<SpecializedMeshPipelines<map::MapPipeline>>()
        .init_gpu_resource::<ToolShadowMaps>()
        .init_gpu_resource::<prepare::ToolShadowViews>()
        .add_systems(RenderStartup, (map::init_pipeline, prepare::init_pipeline))
        .add_systems(ExtractSchedule, extract::extract_tool_shadows)
        .add_systems(
            Render,
            (
                map::prepare_maps.in_set(RenderSystems::PrepareResources),
                prepare::prepare_views.in_set(RenderSystems::PrepareBindGroups),
            ),
        )
        // Once for all cameras.
        .add_systems(RenderGraph, map::draw_maps.in_set(RenderGraphSystems::Render).before(camera_driver))
        .add_systems(
            Core3d,
            (
                apply::keep_depth.in_set(ToolShadowPasses::KeepDepth),
                apply::apply_shadows.in_set(ToolShadowPasses::Apply),
            ),
        );
}
