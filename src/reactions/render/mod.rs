//! The reactions pass: what changed goes to the GPU, and the layer is drawn over the skin.

mod cull;
mod extract;
mod pass;
mod prepare;

use crate::organ::render::{PrepareOrgans, prepare_layer_pipelines};
use crate::render::OrganPasses;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<extract::ExtractedReactions>()
        .init_gpu_resource::<prepare::ReactionTextures>()
        .add_systems(RenderStartup, prepare::init_layer.after(PrepareOrgans))
        .add_systems(ExtractSchedule, extract::extract_reactions)
        .add_systems(
            Render,
            (
                prepare_layer_pipelines::<prepare::ReactionLayer>.in_set(RenderSystems::PrepareResources),
                prepare::write_textures.in_set(RenderSystems::PrepareResources),
                prepare::prepare_bind_groups.in_set(RenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(Core3d, pass::draw_reactions.in_set(OrganPasses::Reactions));
}
