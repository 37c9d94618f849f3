//! Draws volumes into a view: walk, smooth, shade where something changed; then into the picture.

use super::aligned::{AlignedBodies, AlignedBody, AlignedKey, AlignedPipelines, StackDrawing, draw_stack};
use super::gpu::{GpuVolume, VolumeTextures};
use super::lattices::VolumeLattices;
use super::pipelines::{PipelineKey, VolumePipelines};
use super::redraws::VolumeRedraws;
use super::views::{SQUARE_PX, VolumeView, VolumeViews, grown};
use crate::organ::render::{OrganBindGroups, OrganPipelineKey, OrganSides};
use crate::volume::VolumeMethod;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ExtractedView, ViewDepthTexture, ViewTarget, ViewUniformOffset};

/// Opacity nothing, and a depth that no neighbour has ([`shaders/volume/volume.wgsl`]).
const NOTHING: LinearRgba = LinearRgba { red: 0.0, green: 0.0, blue: 0.0, alpha: 60000.0 };

type View = (
    &'static ExtractedView,
    &'static ExtractedCamera,
    &'static ViewTarget,
    &'static ViewDepthTexture,
    &'static ViewUniformOffset,
    &'static Msaa,
    Option<&'static Tonemapping>,
);

/// A texture that a pass draws into: what it holds stays, unless it is cleared first.
pub(super) fn attachment(view: &TextureView, clear: Option<LinearRgba>) -> RenderPassColorAttachment<'_> {
    let load = clear.map_or(LoadOp::Load, |clear| LoadOp::Clear(clear.into()));
    let ops = Operations { load, store: StoreOp::Store };
    RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops }
}

struct Drawing<'a> {
    pipelines: &'a VolumePipelines,
    cache: &'a PipelineCache,
    device: &'a RenderDevice,
    view_group: &'a BindGroup,
    view_offset: u32,
    plane_group: &'a BindGroup,
    volume: &'a VolumeView,
    redraws: &'a VolumeRedraws,
    /// Of a volume that is deformed.
    lattice_group: Option<&'a BindGroup>,
    aligned: &'a AlignedPipelines,
    body: Option<&'a AlignedBody>,
}

impl Drawing<'_> {
    fn inputs<const N: usize>(&self, textures: [&TextureView; N]) -> BindGroup {
        let entries: Vec<_> = textures
            .iter()
            .enumerate()
            .map(|(binding, texture)| BindGroupEntry {
                binding: binding as u32,
                resource: BindingResource::TextureView(texture),
            })
            .collect();
        let layout = self.cache.get_bind_group_layout(self.pipelines.inputs(N));
        self.device.create_bind_group("volume_inputs", &layout, &entries)
    }

    /// A pass over some pixels of the volume's buffers.
    #[expect(clippy::too_many_arguments, reason = "one call says all of a pass")]
    fn pass(
        &self,
        ctx: &mut RenderContext,
        label: &'static str,
        key: PipelineKey,
        into: &[(&TextureView, LinearRgba)],
        clears: bool,
        patches: &[URect],
        group_1: &BindGroup,
        group_2: &BindGroup,
        vertices: Option<&(Buffer, u32)>,
    ) {
        let Some(pipeline) = self.pipelines.get(self.cache, key) else { return };
        let attachments: Vec<_> =
            into.iter().map(|(view, clear)| Some(attachment(view, clears.then_some(*clear)))).collect();
        let diagnostics = ctx.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(label),
            color_attachments: &attachments,
            depth_stencil_attachment: None,
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, label);
        let patches = patches.iter().filter(|pixels| !pixels.is_empty());
        for (k, &pixels) in patches.enumerate() {
            match key {
                PipelineKey::March(_) | PipelineKey::Slices(_) => self.redraws.add_walked(pixels),
                PipelineKey::Wet => self.redraws.add_shaded(pixels),
                _ => {}
            }
            if k == 0 {
                pass.set_render_pipeline(pipeline);
                pass.set_bind_group(0, self.view_group, &[self.view_offset]);
                pass.set_bind_group(1, group_1, &[self.volume.offset]);
                pass.set_bind_group(2, group_2, &[]);
                if key.is_deformed()
                    && let Some(lattice) = self.lattice_group
                {
                    pass.set_bind_group(3, lattice, &[]);
                }
            }
            pass.set_scissor_rect(pixels.min.x, pixels.min.y, pixels.width(), pixels.height());
            match vertices {
                Some((buffer, count)) => {
                    pass.set_vertex_buffer(0, buffer.slice(..));
                    pass.draw(0..*count, 0..1);
                }
                None => pass.draw(0..3, 0..1),
            }
        }
        span.end(&mut pass);
    }

    fn walk(&self, ctx: &mut RenderContext, gpu: &GpuVolume, uniform: &BindingResource, scene: &ViewDepthTexture) {
        let volume = self.volume;
        let buffers = &volume.buffers;
        let variant = volume.variant;
        let walk_group = self.device.create_bind_group(
            "volume_walk",
            &self.cache.get_bind_group_layout(&self.pipelines.walk),
            &BindGroupEntries::sequential((
                uniform.clone(),
                &gpu.field,
                &gpu.gradients,
                &self.pipelines.sampler,
                &gpu.table,
                // Not read where the table's colours are shown.
                gpu.colours.as_ref().unwrap_or(&gpu.gradients),
                &gpu.blocks,
            )),
        );
        let scene_group = self.device.create_bind_group(
            "volume_scene",
            &self.cache.get_bind_group_layout(&self.pipelines.scene[usize::from(variant.multisampled)]),
            &BindGroupEntries::single(scene.view()),
        );
        let none = LinearRgba::NONE;
        let (relief, depth) = ((&buffers.relief, NOTHING), (&buffers.depth, none));
        match &buffers.sums {
            None => {
                let Some(starts) = &buffers.starts else { return };
                let bounds = volume.walk.bounds();
                let squares = URect { min: bounds.min / SQUARE_PX, max: bounds.max.map(|end| end.div_ceil(SQUARE_PX)) };
                let nothing = self.inputs([]);
                let (into, patches) = ([(starts, none)], [squares]);
                let key = PipelineKey::Start(variant);
                self.pass(ctx, "volume_start", key, &into, true, &patches, &walk_group, &nothing, None);
                let scene_group = self.device.create_bind_group(
                    "volume_march_scene",
                    &self.cache.get_bind_group_layout(&self.pipelines.march_scene[usize::from(variant.multisampled)]),
                    &BindGroupEntries::sequential((scene.view(), starts)),
                );
                let key = PipelineKey::March(variant);
                let into = [(&buffers.colour, none), relief, depth];
                let pixels = volume.walk.disjoint();
                self.pass(ctx, "volume_march", key, &into, volume.is_all, &pixels, &walk_group, &scene_group, None);
            }
            Some((gradients, depths)) if volume.method == VolumeMethod::PatchSlices => {
                self.draw_aligned(ctx, gpu, uniform, scene, gradients, depths);
                self.resolve(ctx, gradients, depths);
            }
            Some((gradients, depths)) => {
                // Blending cannot be taken back: all slices are drawn again.
                let key = PipelineKey::Slices(variant);
                let into = [(&buffers.colour, none), (gradients, none), (depths, none)];
                let pixels = if volume.slices.is_some() { volume.seen } else { URect::EMPTY };
                let slices = volume.slices.as_ref();
                self.pass(ctx, "volume_slices", key, &into, true, &[pixels], &walk_group, &scene_group, slices);
                self.resolve(ctx, gradients, depths);
            }
        }
    }

    fn draw_aligned(
        &self,
        ctx: &mut RenderContext,
        gpu: &GpuVolume,
        uniform: &BindingResource,
        scene: &ViewDepthTexture,
        gradients: &TextureView,
        depths: &TextureView,
    ) {
        let volume = self.volume;
        let (Some((key, stack)), Some(body), Some(hidden)) = (&volume.aligned, self.body, &volume.buffers.hidden)
        else {
            return;
        };
        let normals = matches!(key, AlignedKey::Slices { normals: true, .. }).then_some(gradients);
        draw_stack(
            ctx,
            StackDrawing {
                pipelines: self.aligned,
                cache: self.cache,
                device: self.device,
                key: *key,
                multisampled: volume.variant.multisampled,
                body,
                gpu,
                stack: stack.as_ref(),
                sampler: &self.pipelines.sampler,
                view_group: (self.view_group, self.view_offset),
                uniform: (uniform.clone(), volume.offset),
                scene: scene.view(),
                seen: volume.seen,
                into: [Some(&volume.buffers.colour), Some(depths), normals],
                hidden,
            },
        );
        self.redraws.add_walked(volume.seen);
    }

    /// From blended slices to what rays leave.
    fn resolve(&self, ctx: &mut RenderContext, gradients: &TextureView, depths: &TextureView) {
        let buffers = &self.volume.buffers;
        let sums = self.inputs([&buffers.colour, gradients, depths]);
        let into = [(&buffers.relief, NOTHING), (&buffers.depth, LinearRgba::NONE)];
        let key = PipelineKey::Resolve { deformed: self.volume.variant.deformed };
        self.pass(ctx, "volume_resolve", key, &into, true, &[self.volume.seen], self.plane_group, &sums, None);
    }

    /// Smooths the normals where they are shaded anew.
    fn smooth(&self, ctx: &mut RenderContext) {
        let buffers = &self.volume.buffers;
        let passes = self.volume.passes;
        let between = [&buffers.ping, &buffers.pong];
        for k in 0..passes {
            let from = if k == 0 { &buffers.relief } else { between[(k as usize + 1) % 2] };
            // The last one has a texture of its own, which stays right where nothing is drawn anew.
            let into = if k + 1 == passes { &buffers.smoothed } else { between[k as usize % 2] };
            let group = self.inputs([from]);
            let clears = self.volume.is_all;
            self.pass(
                ctx,
                "volume_smooth",
                PipelineKey::Smooth,
                &[(into, NOTHING)],
                clears,
                &[self.volume.smoothed_by(k)],
                self.plane_group,
                &group,
                None,
            );
        }
    }

    fn shade(&self, ctx: &mut RenderContext) {
        let buffers = &self.volume.buffers;
        let smoothed = if self.volume.passes == 0 { &buffers.relief } else { &buffers.smoothed };
        let group = self.inputs([&buffers.colour, &buffers.relief, smoothed, &buffers.depth]);
        let size = URect { min: UVec2::ZERO, max: self.volume.viewport.size() };
        let pixels = self.volume.shade.intersect(grown(self.volume.seen, 1, size));
        self.pass(
            ctx,
            "volume_wet",
            PipelineKey::Wet,
            &[(&buffers.lit, LinearRgba::NONE)],
            self.volume.is_all,
            &[pixels],
            self.plane_group,
            &group,
            None,
        );
    }

    fn composite(
        &self,
        ctx: &mut RenderContext,
        target: &ViewTarget,
        depth: &ViewDepthTexture,
        into: OrganPipelineKey,
    ) {
        let buffers = &self.volume.buffers;
        let group = self.inputs([&buffers.lit, &buffers.depth]);
        let diagnostics = ctx.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("volume_composite"),
            color_attachments: &[Some(target.get_color_attachment())],
            depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, "volume_composite");
        let (viewport, seen) = (self.volume.viewport, self.volume.seen);
        let size = viewport.size().as_vec2();
        pass.set_viewport(viewport.min.x as f32, viewport.min.y as f32, size.x, size.y, 0.0, 1.0);
        let corner = viewport.min + seen.min;
        if !seen.is_empty() {
            pass.set_scissor_rect(corner.x, corner.y, seen.width(), seen.height());
            for is_solid in [true, false] {
                let key = PipelineKey::Composite { target: into, is_solid };
                let Some(pipeline) = self.pipelines.get(self.cache, key) else { continue };
                pass.set_render_pipeline(pipeline);
                pass.set_bind_group(0, self.view_group, &[self.view_offset]);
                pass.set_bind_group(1, self.plane_group, &[self.volume.offset]);
                pass.set_bind_group(2, &group, &[]);
                pass.draw(0..3, 0..1);
            }
        }
        span.end(&mut pass);
    }
}

pub(super) fn draw_volumes(
    view: ViewQuery<View>,
    pipelines: Res<VolumePipelines>,
    cache: Res<PipelineCache>,
    textures: Res<VolumeTextures>,
    kept: Res<VolumeViews>,
    lattices: Res<VolumeLattices>,
    groups: Res<OrganBindGroups>,
    redraws: Res<VolumeRedraws>,
    aligned: Res<AlignedPipelines>,
    bodies: Res<AlignedBodies>,
    mut ctx: RenderContext,
) {
    let entity = view.entity();
    let (extracted, camera, target, depth, offset, msaa, tonemapping) = view.into_inner();
    let (Some(view_group), Some(uniform)) = (groups.view(entity), kept.uniforms.binding()) else { return };
    let into = OrganPipelineKey::of_view(extracted, camera, msaa, tonemapping, OrganSides::default());
    let device = ctx.render_device().clone();
    for (volume_entity, volume) in kept.of_view(entity) {
        let Some(gpu) = textures.get(volume_entity) else { continue };
        let layout = cache.get_bind_group_layout(&pipelines.plane);
        let plane_group = device.create_bind_group("volume_plane", &layout, &BindGroupEntries::single(uniform.clone()));
        let lattice_group = lattices.get(volume_entity).and_then(|lattice| {
            let layout = cache.get_bind_group_layout(&pipelines.lattice);
            let entries = BindGroupEntries::sequential((lattice.uniform()?, &lattice.nodes, &lattice.matrices));
            Some(device.create_bind_group("volume_lattice", &layout, &entries))
        });
        // Removed from the lists of this frame, but still among the buffers: shown as it was.
        if volume.variant.deformed && lattice_group.is_none() {
            continue;
        }
        let drawing = Drawing {
            lattice_group: lattice_group.as_ref(),
            pipelines: &pipelines,
            cache: &cache,
            device: &device,
            view_group,
            view_offset: offset.offset,
            plane_group: &plane_group,
            volume,
            redraws: &redraws,
            aligned: &aligned,
            body: bodies.get(volume_entity),
        };
        if volume.is_all || !volume.walk.is_empty() {
            drawing.walk(&mut ctx, gpu, &uniform, depth);
        }
        if !volume.shade.is_empty() {
            drawing.smooth(&mut ctx);
            drawing.shade(&mut ctx);
        }
        drawing.composite(&mut ctx, target, depth, into);
    }
}
