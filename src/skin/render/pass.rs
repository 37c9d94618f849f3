//! Draws the skins of the organs that a camera sees.

use super::prepare::{SkinInstances, SkinPipelineIds};
use crate::organ::Organ;
use crate::organ::render::{ExtractedOrgan, ExtractedOrgans, GpuOrganModel, OrganBindGroups, OrganSides};
use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{IndexFormat, PipelineCache, RenderPassDescriptor, StoreOp};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ExtractedView, RenderVisibleEntities, ViewDepthTexture, ViewTarget, ViewUniformOffset};

type SkinView = (
    &'static ExtractedCamera,
    &'static ExtractedView,
    &'static ViewTarget,
    &'static ViewDepthTexture,
    &'static ViewUniformOffset,
    &'static RenderVisibleEntities,
    &'static SkinPipelineIds,
    Option<&'static MainPassResolutionOverride>,
);

pub(super) fn draw_skins(
    view: ViewQuery<SkinView>,
    organs: Res<ExtractedOrgans>,
    models: Res<RenderAssets<GpuOrganModel>>,
    organ_groups: Res<OrganBindGroups>,
    skins: Res<SkinInstances>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let view_entity = view.entity();
    let (camera, extracted, target, depth, view_offset, visible, pipelines, resolution) = view.into_inner();
    let (Some(view_group), Some(visible)) = (organ_groups.view(view_entity), visible.get::<Organ>()) else { return };
    let visible = visible.entities_cpu_culling.iter();
    let mut drawable: Vec<_> = visible
        .filter_map(|&(_, entity)| {
            let place = organs.organs.binary_search_by_key(&entity, |organ| organ.entity).ok()?;
            let organ = &organs.organs[place];
            let model = models.get(organ.model)?;
            let pipeline = cache.get_render_pipeline(pipelines.of(organ.sides))?;
            Some((organ, pipeline, model, organ_groups.organ(entity)?, skins.bind_group(entity)?))
        })
        .collect();
    if drawable.is_empty() {
        return;
    }
    // Near ones first, and what surrounds the camera last: hidden pixels then cost a depth test and no shading.
    let eye = extracted.world_from_view.translation();
    drawable.sort_by(|(a, ..), (b, ..)| {
        let distance = |organ: &ExtractedOrgan| organ.centre_world_m.distance_squared(eye);
        let surrounds = |organ: &ExtractedOrgan| organ.sides == OrganSides::Both;
        surrounds(a).cmp(&surrounds(b)).then(distance(a).total_cmp(&distance(b)))
    });
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("skin"),
        color_attachments: &[Some(target.get_color_attachment())],
        depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "skin");
    if let Some(viewport) = Viewport::from_viewport_and_override(camera.viewport.as_ref(), resolution) {
        pass.set_camera_viewport(&viewport);
    }
    for (_, pipeline, model, (organ_group, organ_offset), skin_group) in drawable {
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, view_group, &[view_offset.offset]);
        pass.set_bind_group(1, organ_group, &[organ_offset]);
        pass.set_bind_group(2, skin_group, &[]);
        pass.set_vertex_buffer(0, model.corners.slice(..));
        pass.set_index_buffer(model.indices.slice(..), IndexFormat::Uint32);
        pass.draw_indexed(0..model.index_count, 0, 0..1);
    }
    span.end(&mut pass);
}
