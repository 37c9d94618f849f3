//! Keeps cameras from shading what their mask hides.
//!
//! Before anything is drawn, the mask's dark part goes into the depth buffer at the near plane: Bevy's passes and ours
//! then skip those pixels by their depth test, some two fifths of a 4:3 frame.

use super::mask::{ScopeMaskUniform, draw_rings, ring_pipeline};
use crate::render::shader_path;
use bevy::core_pipeline::{
    core_3d::{CORE_3D_DEPTH_FORMAT, main_opaque_pass_3d},
    schedule::{Core3d, Core3dSystems},
};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::extract_component::{ComponentUniforms, DynamicUniformIndex};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::ViewDepthTexture;
use bevy::render::{Render, RenderApp, RenderStartup, RenderSystems};

#[derive(Component)]
struct MaskDepthPipelineId(CachedRenderPipelineId);

#[derive(Resource)]
struct MaskDepthPipeline {
    layout: BindGroupLayoutDescriptor,
    variants: Variants<RenderPipeline, MaskDepthSpecializer>,
}

struct MaskDepthSpecializer;

#[derive(PartialEq, Eq, Hash, Clone, Copy, SpecializerKey)]
struct MaskDepthKey {
    samples: u32,
}

impl Specializer<RenderPipeline> for MaskDepthSpecializer {
    type Key = MaskDepthKey;

    fn specialize(
        &self,
        key: MaskDepthKey,
        descriptor: &mut RenderPipelineDescriptor,
    ) -> Result<Canonical<MaskDepthKey>, BevyError> {
        descriptor.multisample.count = key.samples;
        Ok(key)
    }
}

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .add_systems(RenderStartup, init_pipeline)
        .add_systems(Render, prepare_pipelines.in_set(RenderSystems::Prepare))
        .add_systems(Core3d, draw_mask_depth.before(main_opaque_pass_3d).in_set(Core3dSystems::MainPass));
}

fn init_pipeline(mut commands: Commands, assets: Res<AssetServer>) {
    let (layout, mut descriptor) =
        ring_pipeline("scope_mask_depth_pipeline", assets.load(shader_path("view/mask.wgsl")));
    descriptor.depth_stencil = Some(DepthStencilState {
        format: CORE_3D_DEPTH_FORMAT,
        depth_write_enabled: Some(true),
        depth_compare: Some(CompareFunction::Always),
        stencil: default(),
        bias: default(),
    });
    commands.insert_resource(MaskDepthPipeline { layout, variants: Variants::new(MaskDepthSpecializer, descriptor) });
}

fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    mut pipeline: ResMut<MaskDepthPipeline>,
    views: Query<(Entity, &Msaa), With<ScopeMaskUniform>>,
) -> Result {
    for (entity, msaa) in &views {
        let id = pipeline.variants.specialize(&cache, MaskDepthKey { samples: msaa.samples() })?;
        commands.entity(entity).insert(MaskDepthPipelineId(id));
    }
    Ok(())
}

type MaskedView = (
    &'static ExtractedCamera,
    &'static ViewDepthTexture,
    &'static ScopeMaskUniform,
    &'static DynamicUniformIndex<ScopeMaskUniform>,
    &'static MaskDepthPipelineId,
);

fn draw_mask_depth(
    view: ViewQuery<MaskedView>,
    pipeline: Res<MaskDepthPipeline>,
    cache: Res<PipelineCache>,
    masks: Res<ComponentUniforms<ScopeMaskUniform>>,
    mut ctx: RenderContext,
) {
    let (camera, depth, mask, index, id) = view.into_inner();
    // A frame that is not opaque shows what lies behind it.
    if mask.colour.w < 1.0 {
        return;
    }
    let (Some(render_pipeline), Some(binding)) = (cache.get_render_pipeline(id.0), masks.uniforms().binding()) else {
        return;
    };
    let layout = cache.get_bind_group_layout(&pipeline.layout);
    let bind_group =
        ctx.render_device().create_bind_group("scope_mask_depth", &layout, &BindGroupEntries::single(binding));
    let pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("scope_mask_depth"),
        color_attachments: &[],
        depth_stencil_attachment: Some(depth.get_attachment(StoreOp::Store)),
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    // Only the outer ring: what the soft edge lets through must be drawn.
    draw_rings(pass, camera, render_pipeline, &bind_group, index, 1..2);
}
