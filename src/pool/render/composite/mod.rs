//! The surface of a pool in the picture: a copy of what was drawn, and tiles of the surface that look through it.
//!
//! What is copied holds the scene's exposed radiance, on cameras without HDR after tonemapping. There the fluid absorbs what is
//! shown instead of what was there, and only the light that it adds is tonemapped: differences are small where the picture is not
//! nearly white.

mod extract;
mod pass;
mod pipeline;
mod textures;
mod uniform;
mod views;

pub use textures::PoolTextures;
pub use uniform::PoolUniform;

use super::PoolPasses;
use crate::organ::render::PrepareOrgans;
use crate::render::OrganPasses;
use crate::view::ToolShadowPasses;
use bevy::core_pipeline::core_3d::main_transparent_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

/// In `PrepareResources`: texels of pools go to the GPU.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct WriteSurfaces;

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .configure_sets(
            Core3d,
            PoolPasses
                .after(OrganPasses::Highlights)
                .after(ToolShadowPasses::Apply)
                .before(main_transparent_pass_3d)
                .in_set(Core3dSystems::MainPass),
        )
        .init_resource::<extract::ExtractedPools>()
        .init_gpu_resource::<PoolTextures>()
        .init_gpu_resource::<views::PoolViews>()
        .add_systems(RenderStartup, pipeline::init.after(PrepareOrgans))
        .add_systems(ExtractSchedule, extract::extract_pools)
        .add_systems(
            Render,
            (
                textures::write_textures.in_set(WriteSurfaces).in_set(RenderSystems::PrepareResources),
                views::prepare_views.in_set(RenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(Core3d, pass::draw_pools.in_set(PoolPasses));
}
