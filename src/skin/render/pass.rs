//! Draws the skins of the organs that a camera sees.

use super::prepare::{SkinInstances, SkinPipelineIds};
use crate::organ::Organ;
use crate::organ::render::{ExtractedOrgans, GpuOrganModel, OrganBindGroups};
use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{IndexFormat, PipelineCache, RenderPassDescriptor, StoreOp};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{RenderVisibleEntities, ViewDepthTexture, ViewTarget, ViewUniformOffset};

type SkinView = (
    &'static ExtractedCamera,
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
    let (camera, target, depth, view_offset, visible, pipelines, resolution) = view.into_inner();
    let (Some(view_group), Some(visible)) = (&organ_groups.view, visible.get::<Organ>()) else { return };
    let mut drawable = visible
        .entities_cpu_culling
        .iter()
        .filter_map(|&(_, entity)| {
            let place = organs.organs.binary_search_by_key(&entity, |organ| organ.entity).ok()?;
            let organ = &organs.organs[place];
            let model = models.get(organ.model)?;
            let pipeline = cache.get_render_pipeline(pipelines.of(organ.sides))?;
            Some((pipeline, model, organ_groups.organ(entity)?, skins.bind_group(entity)?))
        })
        .peekable();
    if drawable.peek().is_none() {
        return;
    }
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
    for (pipeline, model, (organ_group, organ_offset), skin_group) in drawable {
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
