//! Draws the pools of a view.

use super::textures::PoolTextures;
use super::views::PoolViews;
use crate::organ::render::OrganBindGroups;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewDepthTexture, ViewTarget, ViewUniformOffset};

pub(super) fn draw_pools(
    view: ViewQuery<(&ViewTarget, &ViewDepthTexture, &ViewUniformOffset)>,
    kept: Res<PoolViews>,
    textures: Res<PoolTextures>,
    groups: Res<OrganBindGroups>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let entity = view.entity();
    let (target, depth, view_offset) = view.into_inner();
    let (Some(seen), Some(view_group)) = (kept.views.get(&entity), groups.view(entity)) else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    for pool in &seen.pools {
        let (Some(pipeline), Some((_, tiles, count))) =
            (cache.get_render_pipeline(pool.pipeline), textures.get(pool.entity))
        else {
            continue;
        };
        let encoder = ctx.command_encoder();
        let span = diagnostics.time_span(encoder, "pool_copy");
        let origin = Origin3d { x: pool.pixels.min.x, y: pool.pixels.min.y, z: 0 };
        // A pool sees those behind it; of several samples their mean.
        encoder.copy_texture_to_texture(
            TexelCopyTextureInfo { origin, ..target.main_texture().as_image_copy() },
            TexelCopyTextureInfo { origin, ..seen.copy.as_image_copy() },
            Extent3d { width: pool.pixels.width(), height: pool.pixels.height(), depth_or_array_layers: 1 },
        );
        span.end(encoder);
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("pool"),
            color_attachments: &[Some(target.get_color_attachment())],
            // Only read, as the shader does at the same time.
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: depth.view(),
                depth_ops: None,
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, "pool");
        let (corner, size) = (seen.viewport.min.as_vec2(), seen.viewport.size().as_vec2());
        pass.set_viewport(corner.x, corner.y, size.x, size.y, 0.0, 1.0);
        pass.set_scissor_rect(pool.pixels.min.x, pool.pixels.min.y, pool.pixels.width(), pool.pixels.height());
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, view_group, &[view_offset.offset]);
        pass.set_bind_group(1, &pool.group, &[pool.offset]);
        pass.set_vertex_buffer(0, tiles.slice(..));
        pass.draw(0..4, 0..count);
        span.end(&mut pass);
    }
}
