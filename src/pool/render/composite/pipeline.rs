//! The pipelines that draw pools, made as views ask for them.

use super::uniform::PoolUniform;
use crate::organ::render::{OrganLayouts, OrganPipelineKey};
use crate::render::shader_path;
use bevy::core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT;
use bevy::mesh::VertexBufferLayout;
use bevy::prelude::*;
use bevy::render::render_resource::{
    binding_types::{
        sampler, texture_2d, texture_cube, texture_depth_2d, texture_depth_2d_multisampled, uniform_buffer,
    },
    *,
};
use bevy::render::renderer::RenderDevice;

/// What a pipeline depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PoolPipelineKey {
    pub target: OrganPipelineKey,
    /// Whether the camera has an environment map.
    pub has_map: bool,
    pub has_foam: bool,
}

impl SpecializerKey for PoolPipelineKey {
    const IS_CANONICAL: bool = true;
    type Canonical = Self;
}

pub(super) struct PoolSpecializer {
    layouts: [BindGroupLayoutDescriptor; 2],
}

impl Specializer<RenderPipeline> for PoolSpecializer {
    type Key = PoolPipelineKey;

    fn specialize(
        &self,
        key: PoolPipelineKey,
        descriptor: &mut RenderPipelineDescriptor,
    ) -> Result<Canonical<PoolPipelineKey>, BevyError> {
        key.target.apply(descriptor);
        // Which side of a tile is seen is no matter of its corners' order.
        descriptor.primitive.cull_mode = None;
        let multisampled = key.target.samples > 1;
        descriptor.set_layout(1, self.layouts[usize::from(multisampled)].clone());
        let definitions = [(multisampled, "MULTISAMPLED"), (key.has_map, "ENVIRONMENT_MAP"), (key.has_foam, "FOAM")];
        for (_, name) in definitions.into_iter().filter(|(is_defined, _)| *is_defined) {
            descriptor.vertex.shader_defs.push(name.into());
            descriptor.fragment_mut()?.shader_defs.push(name.into());
        }
        let target = ColorTargetState { format: key.target.format, blend: None, write_mask: ColorWrites::ALL };
        descriptor.fragment_mut()?.set_target(0, target);
        Ok(key)
    }
}

/// Layouts and pipelines.
#[derive(Resource)]
pub(super) struct PoolPipelines {
    /// Group 1, for one sample and for several.
    pub layouts: [BindGroupLayoutDescriptor; 2],
    pub variants: Variants<RenderPipeline, PoolSpecializer>,
    pub sampler: Sampler,
}

pub(super) fn init(
    mut commands: Commands,
    organs: Res<OrganLayouts>,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
) {
    let layout = |depth: BindGroupLayoutEntryBuilder| {
        BindGroupLayoutDescriptor::new(
            "pool_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    uniform_buffer::<PoolUniform>(true).visibility(ShaderStages::VERTEX_FRAGMENT),
                    texture_2d(TextureSampleType::Float { filterable: true }),
                    sampler(SamplerBindingType::Filtering),
                    texture_2d(TextureSampleType::Float { filterable: false }),
                    depth,
                    texture_cube(TextureSampleType::Float { filterable: true }),
                    sampler(SamplerBindingType::Filtering),
                ),
            ),
        )
    };
    let layouts = [layout(texture_depth_2d()), layout(texture_depth_2d_multisampled())];
    let shader: Handle<Shader> = assets.load(shader_path("pool/composite.wgsl"));
    let descriptor = RenderPipelineDescriptor {
        label: Some("pool".into()),
        layout: vec![organs.view.clone(), layouts[0].clone()],
        vertex: VertexState {
            shader: shader.clone(),
            entry_point: Some("vertex".into()),
            buffers: vec![VertexBufferLayout::from_vertex_formats(VertexStepMode::Instance, [VertexFormat::Uint32x2])],
            ..default()
        },
        fragment: Some(FragmentState { shader, entry_point: Some("fragment".into()), ..default() }),
        primitive: PrimitiveState { topology: PrimitiveTopology::TriangleStrip, ..default() },
        // What hides even the highest wave need not be shaded; the shader, which reads the same depth, decides about the rest.
        depth_stencil: Some(DepthStencilState {
            format: CORE_3D_DEPTH_FORMAT,
            depth_write_enabled: Some(false),
            depth_compare: Some(CompareFunction::GreaterEqual),
            stencil: default(),
            bias: default(),
        }),
        ..default()
    };
    let variants = Variants::new(PoolSpecializer { layouts: layouts.clone() }, descriptor);
    let sampler = device.create_sampler(&SamplerDescriptor {
        label: Some("pool"),
        mag_filter: FilterMode::Linear,
        min_filter: FilterMode::Linear,
        ..default()
    });
    commands.insert_resource(PoolPipelines { layouts, variants, sampler });
}
