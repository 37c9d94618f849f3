//! The skin pass.

mod extract;
mod pass;
mod prepare;
mod textures;

pub use prepare::SkinUniform;
pub use textures::{SkinTexture, SkinTileLibrary};

use crate::organ::render::{PrepareOrgans, prepare_layer_pipelines};
use crate::render::OrganPasses;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

pub(super) fn build(app: &mut App) {
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    app.register_type::<SkinTexture>().init_resource::<SkinTileLibrary>().add_systems(PreUpdate, textures::dress_skins);
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<extract::ExtractedSkins>()
        .init_gpu_resource::<prepare::SkinInstances>()
        .add_systems(RenderStartup, prepare::init_pipeline.after(PrepareOrgans))
        .add_systems(ExtractSchedule, extract::extract_skins)
        .add_systems(
            Render,
            (
                prepare_layer_pipelines::<prepare::SkinLayer>.in_set(RenderSystems::PrepareResources),
                prepare::write_buffers.in_set(RenderSystems::PrepareResources),
                prepare::prepare_bind_groups.in_set(RenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(Core3d, pass::draw_skins.in_set(OrganPasses::Skin));
}
