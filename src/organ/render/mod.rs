//! The organ on the GPU: what every layer that is drawn on it shares.
//!
//! A layer's pipeline has the view in group 0 and the organ in group 1 ([`OrganLayouts`]), draws the vertices of
//! [`corner_vertex_layout`] with the functions of `shaders/organ.wgsl`, and binds what is its own from group 2 on.

mod extract;
mod gloss;
mod layer;
mod prepare;

pub use extract::{ExtractedOrgan, ExtractedOrgans, PrimaryVertex};
pub use gloss::OrganGloss;
pub use layer::{OrganDraw, OrganLayer, OrganLayerPipelines, OrganLayerView, OrganPart, prepare_layer_pipelines};
pub(crate) use prepare::layer_shader;
pub use prepare::{
    CornerVertex, GpuOrganModel, OrganBindGroups, OrganLayouts, OrganPipelineKey, OrganSides, OrganUniform,
    corner_vertex_layout, organ_pipeline_descriptor,
};

use super::Organ;
use bevy::camera::visibility::{VisibilityClass, add_visibility_class};
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssetPlugin;
use bevy::render::sync_world::SyncToRenderWorld;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

/// What layers build on: [`OrganLayouts`] in `RenderStartup`, [`OrganBindGroups`] in
/// [`RenderSystems::PrepareBindGroups`]. A layer that reads them in the same schedule runs after this set.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PrepareOrgans;

pub(super) fn build(app: &mut App) {
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    app.add_plugins(RenderAssetPlugin::<GpuOrganModel>::default());
    app.register_required_components::<Organ, VisibilityClass>();
    app.register_required_components::<Organ, SyncToRenderWorld>();
    // The class makes Bevy's culling list organs per view, with render layers and frusta respected.
    app.world_mut().register_component_hooks::<Organ>().on_add(add_visibility_class::<Organ>);
    app.add_systems(
        PostUpdate,
        extract::bound_shapes.before(bevy::camera::visibility::VisibilitySystems::CheckVisibility),
    );
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<ExtractedOrgans>()
        .init_gpu_resource::<prepare::OrganBuffers>()
        .init_gpu_resource::<OrganBindGroups>()
        .add_systems(RenderStartup, (prepare::init_layouts, gloss::init).in_set(PrepareOrgans))
        .add_systems(ExtractSchedule, extract::extract_organs)
        .add_systems(
            Render,
            (
                prepare::write_buffers.in_set(RenderSystems::PrepareResources),
                prepare::prepare_bind_groups.in_set(RenderSystems::PrepareBindGroups).in_set(PrepareOrgans),
            ),
        );
}
