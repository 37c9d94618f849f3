//! Draws aligned slices into the buffers of a volume in a view.

use super::super::gpu::GpuVolume;
use super::super::pass::attachment;
use super::bodies::AlignedBody;
use super::pipelines::{AlignedKey, AlignedPipelines, POLYGONS_AT_ONCE};
use super::view::AlignedView;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice};

/// What a stack is drawn with, and where.
pub(in super::super) struct StackDrawing<'a> {
    pub pipelines: &'a AlignedPipelines,
    pub cache: &'a PipelineCache,
    pub device: &'a RenderDevice,
    pub key: AlignedKey,
    pub multisampled: bool,
    pub body: &'a AlignedBody,
    pub gpu: &'a GpuVolume,
    pub stack: Option<&'a AlignedView>,
    pub sampler: &'a Sampler,
    /// Group 0 with its offset; the volume's uniform with its own.
    pub view_group: (&'a BindGroup, u32),
    pub uniform: (BindingResource<'a>, u32),
    pub scene: &'a TextureView,
    pub seen: URect,
    /// Colour, depth, and gradients if they are wanted.
    pub into: [Option<&'a TextureView>; 3],
    pub hidden: &'a TextureView,
}

/// Clears the buffers and draws all slices.
pub(in super::super) fn draw_stack(ctx: &mut RenderContext, with: StackDrawing) {
    let Some(slices) = with.pipelines.get(with.cache, with.key) else { return };
    let scene_key = AlignedKey::Scene { multisampled: with.multisampled };
    let batches = with.stack.map_or(&[][..], |stack| &stack.batches);
    if !with.seen.is_empty() && !batches.is_empty() {
        let layout = &with.pipelines.scene[usize::from(with.multisampled)];
        hide(ctx, &with, scene_key, layout, with.scene, true);
    }
    let group = with.stack.zip(with.body.gpu.as_ref()).map(|(stack, body)| {
        let entry = |binding, resource| BindGroupEntry { binding, resource };
        let textured = |binding, view| entry(binding, BindingResource::TextureView(view));
        with.device.create_bind_group(
            "volume_aligned",
            &with.cache.get_bind_group_layout(&with.pipelines.body),
            &[
                entry(0, with.uniform.0.clone()),
                textured(1, &with.gpu.field),
                textured(2, &with.gpu.gradients),
                entry(3, BindingResource::Sampler(with.sampler)),
                textured(4, &with.gpu.table),
                // Not read where the table's colours are shown.
                textured(5, with.gpu.colours.as_ref().unwrap_or(&with.gpu.gradients)),
                entry(7, stack.uniform.as_entire_binding()),
                entry(8, body.frames.as_entire_binding()),
                entry(9, body.rects.as_entire_binding()),
                entry(10, body.translations.as_entire_binding()),
                entry(11, stack.polygons.as_entire_binding()),
            ],
        )
    });
    // Without polygons the buffers are cleared all the same.
    for k in 0..batches.len().max(1) {
        if k > 0
            && let Some(colour) = with.into[0]
        {
            hide(ctx, &with, AlignedKey::Finished, &with.pipelines.gathered, colour, false);
        }
        let clear = (k == 0).then_some(LinearRgba::NONE);
        let attachments: Vec<_> = with.into.iter().flatten().map(|view| Some(attachment(view, clear))).collect();
        let diagnostics = ctx.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("volume_aligned"),
            color_attachments: &attachments,
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: with.hidden,
                depth_ops: None,
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, "volume_aligned");
        if let (Some(group), Some(batch)) = (&group, batches.get(k)) {
            pass.set_render_pipeline(slices);
            pass.set_bind_group(0, with.view_group.0, &[with.view_group.1]);
            pass.set_bind_group(1, group, &[with.uniform.1]);
            pass.set_index_buffer(with.pipelines.indices.slice(..), IndexFormat::Uint16);
            pass.set_scissor_rect(with.seen.min.x, with.seen.min.y, with.seen.width(), with.seen.height());
            let mut first = batch.start;
            while first < batch.end {
                let count = (batch.end - first).min(POLYGONS_AT_ONCE);
                pass.draw_indexed(0..count * 12, (first * 5) as i32, 0..1);
                first += count;
            }
        }
        span.end(&mut pass);
    }
}

/// Draws depth over what is seen.
fn hide(
    ctx: &mut RenderContext,
    with: &StackDrawing,
    key: AlignedKey,
    layout: &BindGroupLayoutDescriptor,
    input: &TextureView,
    clears: bool,
) {
    let Some(pipeline) = with.pipelines.get(with.cache, key) else { return };
    let plane = with.device.create_bind_group(
        "volume_plane",
        &with.cache.get_bind_group_layout(&with.pipelines.plane),
        &BindGroupEntries::single(with.uniform.0.clone()),
    );
    let inputs = with.device.create_bind_group(
        "volume_hidden",
        &with.cache.get_bind_group_layout(layout),
        &BindGroupEntries::single(input),
    );
    let load = if clears { LoadOp::Clear(0.0) } else { LoadOp::Load };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("volume_hidden"),
        color_attachments: &[],
        depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
            view: with.hidden,
            depth_ops: Some(Operations { load, store: StoreOp::Store }),
            stencil_ops: None,
        }),
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    let span = diagnostics.pass_span(&mut pass, "volume_hidden");
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, with.view_group.0, &[with.view_group.1]);
    pass.set_bind_group(1, &plane, &[with.uniform.1]);
    pass.set_bind_group(2, &inputs, &[]);
    pass.set_scissor_rect(with.seen.min.x, with.seen.min.y, with.seen.width(), with.seen.height());
    pass.draw(0..3, 0..1);
    span.end(&mut pass);
}
