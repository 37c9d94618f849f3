//! The round picture of an endoscope: everything outside the circle is dark.

use crate::render::{finite_within, shader_path};
use bevy::core_pipeline::{
    schedule::{Core3d, Core3dSystems},
    tonemapping::tonemapping,
};
use bevy::prelude::*;
use bevy::render::extract_component::{
    ComponentUniforms, DynamicUniformIndex, ExtractComponent, ExtractComponentPlugin, UniformComponentPlugin,
};
use bevy::render::render_phase::TrackedRenderPass;
use bevy::render::render_resource::{binding_types::uniform_buffer, *};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ExtractedView, ViewTarget};
use bevy::render::{Render, RenderApp, RenderStartup, RenderSystems, camera::ExtractedCamera};
use std::ops::Range;

/// Corners of the circle; each is a quad for the soft edge and one for the dark outside.
const SEGMENTS: u32 = 96;

/// Draws a dark frame with a round hole over a camera's finished picture.
///
/// Only the pixels outside the circle are touched, so it costs little where the circle fills the frame.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ScopeMask {
    /// Radius of the picture as a share of half the shorter side of the frame: in a frame wider than high 1 touches the
    /// upper and lower border. The frame is the camera's viewport.
    pub radius: f32,
    /// Width of the soft edge, in the same measure.
    pub softness: f32,
    /// Colour outside the circle.
    pub colour: Color,
}

impl Default for ScopeMask {
    fn default() -> Self {
        Self { radius: 0.98, softness: 0.02, colour: Color::BLACK }
    }
}

/// [`ScopeMask`] as the shader reads it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct ScopeMaskUniform {
    /// Linear colour outside the circle.
    pub colour: Vec4,
    /// Radius and outer end of the soft edge in shares of half the height.
    pub radii: Vec2,
    /// Width over height of the frame.
    pub aspect: f32,
}

impl bevy::render::sync_component::SyncComponent for ScopeMask {
    type Target = (ScopeMaskUniform, MaskPipelineId);
}

impl ExtractComponent for ScopeMask {
    type QueryData = (&'static ScopeMask, &'static Camera);
    type QueryFilter = ();
    type Out = ScopeMaskUniform;

    fn extract_component((mask, camera): (&ScopeMask, &Camera)) -> Option<ScopeMaskUniform> {
        let size = camera.logical_viewport_size().filter(|size| size.min_element() > 0.0)?;
        let aspect = size.x / size.y;
        // The shader measures in heights.
        let narrow = aspect.min(1.0);
        let default = ScopeMask::default();
        // A hundred half heights cover any frame.
        let radius = finite_within(mask.radius, 0.0, 100.0, default.radius);
        let softness = finite_within(mask.softness, 0.0, 100.0, default.softness);
        let [red, green, blue, alpha] = mask.colour.to_linear().to_f32_array();
        let [red, green, blue] = [red, green, blue].map(|channel| finite_within(channel, 0.0, 1.0, 0.0));
        Some(ScopeMaskUniform {
            colour: Vec4::new(red, green, blue, finite_within(alpha, 0.0, 1.0, 1.0)),
            radii: Vec2::new(radius, radius + softness) * narrow,
            aspect,
        })
    }
}

#[doc(hidden)]
#[derive(Component)]
pub struct MaskPipelineId(CachedRenderPipelineId);

#[derive(Resource)]
struct MaskPipeline {
    layout: BindGroupLayoutDescriptor,
    variants: Variants<RenderPipeline, MaskSpecializer>,
}

struct MaskSpecializer;

#[derive(PartialEq, Eq, Hash, Clone, Copy, SpecializerKey)]
struct MaskKey {
    format: TextureFormat,
}

impl Specializer<RenderPipeline> for MaskSpecializer {
    type Key = MaskKey;

    fn specialize(
        &self,
        key: MaskKey,
        descriptor: &mut RenderPipelineDescriptor,
    ) -> Result<Canonical<MaskKey>, BevyError> {
        descriptor.fragment_mut()?.set_target(
            0,
            ColorTargetState {
                format: key.format,
                blend: Some(BlendState::ALPHA_BLENDING),
                write_mask: ColorWrites::ALL,
            },
        );
        Ok(key)
    }
}

pub(super) fn build(app: &mut App) {
    app.add_plugins((
        ExtractComponentPlugin::<ScopeMask>::default(),
        UniformComponentPlugin::<ScopeMaskUniform>::default(),
    ));
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .add_systems(RenderStartup, init_pipeline)
        .add_systems(Render, prepare_pipelines.in_set(RenderSystems::Prepare))
        // After tonemapping, so that dark stays dark and bloom does not bleed in; before Bevy's UI, which follows
        // the set.
        .add_systems(Core3d, draw_mask.after(tonemapping).in_set(Core3dSystems::PostProcess));
}

/// What both pipelines that draw the mask's rings start from: layout of their one group, and vertices.
pub(super) fn ring_pipeline(
    label: &'static str,
    shader: Handle<Shader>,
) -> (BindGroupLayoutDescriptor, RenderPipelineDescriptor) {
    let layout = BindGroupLayoutDescriptor::new(
        "scope_mask_layout",
        &BindGroupLayoutEntries::single(ShaderStages::VERTEX_FRAGMENT, uniform_buffer::<ScopeMaskUniform>(true)),
    );
    let descriptor = RenderPipelineDescriptor {
        label: Some(label.into()),
        layout: vec![layout.clone()],
        vertex: VertexState { shader, entry_point: Some("vertex".into()), ..default() },
        primitive: PrimitiveState { topology: PrimitiveTopology::TriangleStrip, ..default() },
        ..default()
    };
    (layout, descriptor)
}

/// Draws rings of the mask into a pass: 0 is the soft edge, 1 the dark outside.
pub(super) fn draw_rings<'w>(
    mut pass: TrackedRenderPass<'w>,
    camera: &ExtractedCamera,
    pipeline: &'w RenderPipeline,
    bind_group: &'w BindGroup,
    mask: &DynamicUniformIndex<ScopeMaskUniform>,
    rings: Range<u32>,
) {
    if let Some(viewport) = &camera.viewport {
        pass.set_camera_viewport(viewport);
    }
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, bind_group, &[mask.index()]);
    pass.draw(0..2 * (SEGMENTS + 1), rings);
}

fn init_pipeline(mut commands: Commands, assets: Res<AssetServer>) {
    let shader: Handle<Shader> = assets.load(shader_path("view/mask.wgsl"));
    let (layout, mut descriptor) = ring_pipeline("scope_mask_pipeline", shader.clone());
    descriptor.fragment = Some(FragmentState { shader, entry_point: Some("fragment".into()), ..default() });
    commands.insert_resource(MaskPipeline { layout, variants: Variants::new(MaskSpecializer, descriptor) });
}

fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    mut pipeline: ResMut<MaskPipeline>,
    views: Query<(Entity, &ExtractedView), With<ScopeMaskUniform>>,
) -> Result {
    for (entity, view) in &views {
        let id = pipeline.variants.specialize(&cache, MaskKey { format: view.target_format })?;
        commands.entity(entity).insert(MaskPipelineId(id));
    }
    Ok(())
}

fn draw_mask(
    view: ViewQuery<(&ExtractedCamera, &ViewTarget, &DynamicUniformIndex<ScopeMaskUniform>, &MaskPipelineId)>,
    pipeline: Res<MaskPipeline>,
    cache: Res<PipelineCache>,
    masks: Res<ComponentUniforms<ScopeMaskUniform>>,
    mut ctx: RenderContext,
) {
    let (camera, target, mask, id) = view.into_inner();
    let (Some(render_pipeline), Some(binding)) = (cache.get_render_pipeline(id.0), masks.uniforms().binding()) else {
        return;
    };
    let layout = cache.get_bind_group_layout(&pipeline.layout);
    let bind_group = ctx.render_device().create_bind_group("scope_mask", &layout, &BindGroupEntries::single(binding));
    let pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("scope_mask"),
        color_attachments: &[Some(target.get_unsampled_color_attachment())],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    draw_rings(pass, camera, render_pipeline, &bind_group, mask, 0..2);
}
