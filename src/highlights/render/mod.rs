//! The highlight passes.

mod cull;
mod extract;
mod pass;
mod prepare;

pub use prepare::{HighlightRing, HighlightsUniform};

use crate::organ::render::{PrepareOrgans, prepare_layer_pipelines};
use crate::render::OrganPasses;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<extract::ExtractedHighlights>()
        .init_resource::<extract::HighlightSurroundings>()
        .init_gpu_resource::<prepare::HighlightViews>()
        .add_systems(RenderStartup, prepare::init_pipeline.after(PrepareOrgans))
        .add_systems(ExtractSchedule, extract::extract_highlights)
        .add_systems(
            Render,
            (
                prepare_layer_pipelines::<prepare::HighlightsLayer>.in_set(RenderSystems::PrepareResources),
                // Organs and gloss maps are written in `PrepareResources`, in whatever order.
                prepare::prepare_views.in_set(RenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(
            Core3d,
            (
                pass::draw_under_drops.in_set(OrganPasses::HighlightsUnder),
                pass::draw_over_drops.in_set(OrganPasses::Highlights),
            ),
        );
}
