//! The two steps in a camera's passes: keep the depth of what does not receive, darken what was drawn since.

use super::map::ToolShadowMaps;
use super::prepare::ToolShadowViews;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewDepthTexture, ViewTarget};

pub(super) fn keep_depth(view: ViewQuery<&ViewDepthTexture>, shadows: Res<ToolShadowViews>, mut ctx: RenderContext) {
    let Some(shades) = shadows.views.get(&view.entity()) else { return };
    let depth = view.into_inner();
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "tool_shadows_keep_depth");
    // The whole texture: parts of depth textures cannot be copied.
    encoder.copy_texture_to_texture(depth.texture.as_image_copy(), shades.kept.as_image_copy(), depth.texture.size());
    span.end(encoder);
}

pub(super) fn apply_shadows(
    view: ViewQuery<&ViewTarget>,
    shadows: Res<ToolShadowViews>,
    maps: Res<ToolShadowMaps>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let Some(shades) = shadows.views.get(&view.entity()) else { return };
    let target = view.into_inner();
    let Some(pipeline) = cache.get_render_pipeline(shades.pipeline) else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("tool_shadows"),
        color_attachments: &[Some(target.get_color_attachment())],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "tool_shadows");
    if let Some(viewport) = &shades.viewport {
        pass.set_camera_viewport(viewport);
    }
    pass.set_render_pipeline(pipeline);
    // Two lamps take their shares one after the other.
    let is_ready = |lamp| maps.lamps.get(&lamp).is_some_and(super::map::LampMap::is_ready);
    for lamp in shades.lamps.iter().filter(|lamp| is_ready(lamp.lamp)) {
        let (corner, size) = (lamp.scissor.min, lamp.scissor.size());
        pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
        pass.set_bind_group(0, &lamp.group, &[lamp.offset]);
        pass.draw(0..3, 0..1);
    }
    span.end(&mut pass);
}
