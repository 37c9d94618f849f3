//! Volumes on the GPU: rays or slices into buffers of colour, normal and depth; normals smoothed; wet shading; the picture.
//!
//! Each view keeps its buffers of each volume. Rays are walked again only where the view, the volume or the opaque scene
//! changed, so that an unchanged view costs one pass that puts the finished buffer into the picture.

mod aligned;
mod extract;
mod gpu;
mod lattices;
mod pass;
mod patches;
mod pipelines;
mod redraws;
mod scene;
mod shown;
mod slices;
mod texels;
mod uniform;
mod views;

pub use aligned::{AlignedUniform, PatchFramesTexel, PatchRectTexel};
pub use lattices::DeformUniform;
pub use redraws::VolumeRedraws;
pub use uniform::VolumeUniform;

use crate::organ::render::PrepareOrgans;
use crate::render::VolumePasses;
use crate::volume::{CtVolume, FollowLattices};
use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::{VisibilityClass, VisibilitySystems, add_visibility_class};
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::sync_world::SyncToRenderWorld;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

pub(super) fn build(app: &mut App) {
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    scene::build(app);
    app.register_required_components::<CtVolume, VisibilityClass>();
    app.register_required_components::<CtVolume, SyncToRenderWorld>();
    app.world_mut().register_component_hooks::<CtVolume>().on_add(add_visibility_class::<CtVolume>);
    app.add_systems(
        PostUpdate,
        (
            shown::follow_changes.after(AssetEventSystems),
            extract::bound_volumes
                .after(AssetEventSystems)
                .after(FollowLattices)
                .after(VisibilitySystems::CalculateBounds)
                .before(VisibilitySystems::CheckVisibility),
        ),
    );
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<extract::ExtractedVolumes>()
        .init_resource::<VolumeRedraws>()
        .init_gpu_resource::<gpu::VolumeTextures>()
        .init_gpu_resource::<lattices::VolumeLattices>()
        .init_gpu_resource::<views::VolumeViews>()
        .init_gpu_resource::<aligned::AlignedBodies>()
        .add_systems(RenderStartup, (pipelines::init, aligned::init).after(PrepareOrgans))
        .add_systems(ExtractSchedule, (extract::extract_volumes, aligned::extract_bodies, redraws::start_frame))
        .add_systems(
            Render,
            (gpu::write_textures, lattices::write_lattices, aligned::write_bodies, views::prepare_views)
                .chain()
                .in_set(RenderSystems::PrepareResources),
        )
        .add_systems(Core3d, pass::draw_volumes.in_set(VolumePasses));
}
