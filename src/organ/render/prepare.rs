//! Buffers and bind groups of organs.

use super::extract::{ExtractedOrgans, PrimaryVertex};
use crate::organ::OrganModel;
use crate::render::{OrganLights, SceneLights, Uploads, shader_path, strongest_lights, tonemapping_definitions};
use bevy::core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT;
use bevy::core_pipeline::tonemapping::{
    Tonemapping, TonemappingLuts, get_lut_bind_group_layout_entries, get_lut_bindings,
};
use bevy::ecs::change_detection::Tick;
use bevy::ecs::system::{SystemParamItem, lifetimeless::SRes};
use bevy::mesh::VertexBufferLayout;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::{PrepareAssetError, RenderAsset, RenderAssets};
use bevy::render::render_resource::{
    binding_types::{storage_buffer_read_only_sized, uniform_buffer},
    *,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::{FallbackImage, GpuImage};
use bevy::render::view::{ExtractedView, ViewUniform, ViewUniformOffset, ViewUniforms};
use bytemuck::{Pod, Zeroable};
use std::collections::BTreeMap;

/// One corner of a skin triangle. Nothing in it changes while the organ moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CornerVertex {
    /// Indices of the primary vertices that it is a combination of.
    pub primaries: [u32; 3],
    /// Their weights; they sum to one.
    pub weights: [f32; 3],
    /// Place in the texture triangle: weights of its first two corners (the third is what is left of one).
    pub tile_barycentric: [f32; 2],
    /// Which texture triangle it belongs to.
    pub texture_triangle: u32,
    /// Position of the organ at rest, organ space, metres: solid noise does not swim when the organ moves.
    pub rest_position_m: [f32; 3],
    /// Direction on a spherical chart, of any length, or (u, v, 1) on a planar one. Interpolated over a triangle it
    /// gives the exact place on the chart: a triangle lies in one face, and inside a face the chart is projective.
    pub chart_direction: [f32; 3],
}

/// Layout of [`CornerVertex`] at shader locations 0 to 5.
pub fn corner_vertex_layout() -> VertexBufferLayout {
    VertexBufferLayout::from_vertex_formats(
        VertexStepMode::Vertex,
        [
            VertexFormat::Uint32x3,
            VertexFormat::Float32x3,
            VertexFormat::Float32x2,
            VertexFormat::Uint32,
            VertexFormat::Float32x3,
            VertexFormat::Float32x3,
        ],
    )
}

/// The unmoving part of an [`OrganModel`] on the GPU.
pub struct GpuOrganModel {
    /// [`CornerVertex`] per corner.
    pub corners: Buffer,
    /// Three `u32` per skin triangle.
    pub indices: Buffer,
    /// Number of indices.
    pub index_count: u32,
    /// The model itself.
    pub model: OrganModel,
}

impl RenderAsset for GpuOrganModel {
    type SourceAsset = OrganModel;
    type Param = SRes<RenderDevice>;

    fn prepare_asset(
        model: OrganModel,
        _: AssetId<OrganModel>,
        device: &mut SystemParamItem<Self::Param>,
        _: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<OrganModel>> {
        let corners = model.corner_vertices();
        let buffer = |label, usage, contents: &[u8]| {
            device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), usage, contents })
        };
        Ok(Self {
            corners: buffer("organ_corners", BufferUsages::VERTEX, bytemuck::cast_slice(&corners)),
            indices: buffer("organ_indices", BufferUsages::INDEX, bytemuck::cast_slice(&model.skin_mesh.indices)),
            index_count: model.skin_mesh.indices.len() as u32,
            model,
        })
    }
}

/// An organ of this frame as the shaders read it (`shaders/organ.wgsl`).
#[derive(Clone, Copy, Debug, Default, ShaderType)]
pub struct OrganUniform {
    /// Organ space to world.
    pub world_from_organ: Mat4,
    /// Inverse transpose of the above, for normals under any scale.
    pub world_from_organ_normal: Mat4,
    /// The lights that reach it.
    pub lights: OrganLights,
    /// -1 where the transform mirrors, so that front and back are exchanged; otherwise 1.
    pub handedness: f32,
    /// Whether the chart is planar: then nothing wraps round.
    pub is_planar: u32,
}

/// Bind group layouts that all layers share.
#[derive(Resource, Clone)]
pub struct OrganLayouts {
    /// Group 0: Bevy's view uniform, with a dynamic offset, and the view's tonemapping texture with its sampler.
    pub view: BindGroupLayoutDescriptor,
    /// Group 1: [`OrganUniform`] with a dynamic offset, and the primary vertices.
    pub organ: BindGroupLayoutDescriptor,
}

pub(super) fn init_layouts(mut commands: Commands) {
    let [lut_texture, lut_sampler] = get_lut_bind_group_layout_entries();
    commands.insert_resource(OrganLayouts {
        view: BindGroupLayoutDescriptor::new(
            "organ_view_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    uniform_buffer::<ViewUniform>(true).visibility(ShaderStages::VERTEX_FRAGMENT),
                    lut_texture,
                    lut_sampler,
                ),
            ),
        ),
        organ: BindGroupLayoutDescriptor::new(
            "organ_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::VERTEX_FRAGMENT,
                (
                    uniform_buffer::<OrganUniform>(true),
                    storage_buffer_read_only_sized(false, None).visibility(ShaderStages::VERTEX),
                ),
            ),
        ),
    });
}

/// Which faces of an organ are drawn.
#[derive(PartialEq, Eq, Hash, Clone, Copy, Debug, Default)]
pub enum OrganSides {
    /// The outside of a closed organ: half the work.
    #[default]
    Outside,
    /// The same under a transform that mirrors, which turns the faces round.
    OutsideMirrored,
    /// Both sides of an open surface.
    Both,
}

impl OrganSides {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Outside, Self::OutsideMirrored, Self::Both];
}

/// What an organ layer's pipeline depends on in a view.
#[derive(PartialEq, Eq, Hash, Clone, Copy, Debug)]
pub struct OrganPipelineKey {
    /// Format of the view's main texture.
    pub format: TextureFormat,
    /// Samples per pixel.
    pub samples: u32,
    /// How the shader itself tonemaps: on cameras without HDR, and there only.
    pub tonemapping: Tonemapping,
    /// Which faces are drawn.
    pub sides: OrganSides,
}

// By hand, because Bevy's `Tonemapping` is no key itself.
impl SpecializerKey for OrganPipelineKey {
    const IS_CANONICAL: bool = true;
    type Canonical = Self;
}

impl OrganPipelineKey {
    /// The key of a view.
    pub fn of_view(
        view: &ExtractedView,
        camera: &ExtractedCamera,
        msaa: &Msaa,
        tonemapping: Option<&Tonemapping>,
        sides: OrganSides,
    ) -> Self {
        let by_shader = tonemapping.filter(|_| !camera.hdr).copied();
        Self {
            format: view.target_format,
            samples: msaa.samples(),
            tonemapping: by_shader.unwrap_or(Tonemapping::None),
            sides,
        }
    }

    /// Writes what all layers have in common into a descriptor.
    pub fn apply(self, descriptor: &mut RenderPipelineDescriptor) {
        descriptor.multisample.count = self.samples;
        let definitions = tonemapping_definitions(self.tonemapping);
        if let Some(fragment) = &mut descriptor.fragment {
            fragment.shader_defs.extend(definitions.clone());
        }
        descriptor.vertex.shader_defs.extend(definitions);
        descriptor.primitive.cull_mode = match self.sides {
            OrganSides::Outside => Some(Face::Back),
            OrganSides::OutsideMirrored => Some(Face::Front),
            OrganSides::Both => None,
        };
    }
}

/// The pipeline of a layer before specialization: organ vertices, depth test, no blending.
///
/// `own_groups` are bound from group 2 on. The first layer writes depth; layers over it pass where they are not behind
/// it, and as all compute their vertices alike, that is where they lie on it.
pub fn organ_pipeline_descriptor(
    label: &'static str,
    layouts: &OrganLayouts,
    own_groups: &[BindGroupLayoutDescriptor],
    shader: Handle<Shader>,
    writes_depth: bool,
) -> RenderPipelineDescriptor {
    RenderPipelineDescriptor {
        label: Some(label.into()),
        layout: [&[layouts.view.clone(), layouts.organ.clone()], own_groups].concat(),
        vertex: VertexState {
            shader: shader.clone(),
            entry_point: Some("vertex".into()),
            buffers: vec![corner_vertex_layout()],
            ..default()
        },
        depth_stencil: Some(DepthStencilState {
            format: CORE_3D_DEPTH_FORMAT,
            depth_write_enabled: Some(writes_depth),
            // Bevy's depth is reversed: nearer is greater.
            depth_compare: Some(CompareFunction::GreaterEqual),
            stencil: default(),
            bias: default(),
        }),
        fragment: Some(FragmentState { shader, entry_point: Some("fragment".into()), ..default() }),
        ..default()
    }
}

/// The path of a layer's shader, for [`AssetServer::load`].
pub(crate) fn layer_shader(assets: &AssetServer, path: &str) -> Handle<Shader> {
    assets.load(shader_path(path))
}

struct OrganBuffer {
    primaries: RawBufferVec<PrimaryVertex>,
    revision: Tick,
}

/// Buffers of every organ, kept between frames.
#[derive(Resource)]
pub(super) struct OrganBuffers {
    primaries: BTreeMap<MainEntity, OrganBuffer>,
    uniforms: DynamicUniformBuffer<OrganUniform>,
    offsets: BTreeMap<MainEntity, u32>,
}

impl Default for OrganBuffers {
    fn default() -> Self {
        let mut uniforms = DynamicUniformBuffer::default();
        uniforms.set_label(Some("organ_uniforms"));
        Self { primaries: BTreeMap::new(), uniforms, offsets: BTreeMap::new() }
    }
}

impl OrganBuffers {
    pub fn revision(&self, entity: MainEntity) -> Option<Tick> {
        self.primaries.get(&entity).map(|buffer| buffer.revision)
    }
}

pub(super) fn write_buffers(
    mut buffers: ResMut<OrganBuffers>,
    mut extracted: ResMut<ExtractedOrgans>,
    scene: Option<Res<SceneLights>>,
    uploaded: Option<Res<Uploads>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let buffers = &mut *buffers;
    let mut bytes = 0;
    let is_here = |entity: &MainEntity| extracted.organs.binary_search_by_key(entity, |organ| organ.entity).is_ok();
    buffers.primaries.retain(|entity, _| is_here(entity));
    buffers.offsets.clear();
    buffers.uniforms.clear();
    for organ in &mut extracted.organs {
        if let Some(moved) = organ.moved.take() {
            let buffer = buffers.primaries.entry(organ.entity).or_insert_with(|| {
                let mut primaries = RawBufferVec::new(BufferUsages::STORAGE);
                primaries.set_label(Some("organ_primaries"));
                OrganBuffer { primaries, revision: organ.revision }
            });
            buffer.revision = organ.revision;
            *buffer.primaries.values_mut() = moved;
            buffer.primaries.write_buffer(&device, &queue);
            bytes += size_of_val(buffer.primaries.values().as_slice()) as u64;
        }
        let lights = scene
            .as_ref()
            .map(|scene| strongest_lights(scene, organ.centre_world_m, &organ.layers))
            .unwrap_or_default();
        let offset = buffers.uniforms.push(&OrganUniform {
            world_from_organ: organ.world_from_organ,
            world_from_organ_normal: organ.world_from_organ.inverse().transpose(),
            lights,
            handedness: organ.world_from_organ.determinant().signum(),
            is_planar: organ.is_planar.into(),
        });
        buffers.offsets.insert(organ.entity, offset);
    }
    buffers.uniforms.write_buffer(&device, &queue);
    bytes += OrganUniform::min_size().get() * extracted.organs.len() as u64;
    if let Some(uploaded) = uploaded {
        uploaded.add(bytes);
    }
}

/// Bind groups of this frame.
#[derive(Resource, Default)]
pub struct OrganBindGroups {
    views: BTreeMap<Entity, BindGroup>,
    organs: BTreeMap<MainEntity, (BindGroup, u32)>,
}

impl OrganBindGroups {
    /// Group 0 of a view (an entity of the render world); takes the view's offset.
    pub fn view(&self, view: Entity) -> Option<&BindGroup> {
        self.views.get(&view)
    }

    /// Group 1 of an organ with its dynamic offset.
    pub fn organ(&self, entity: MainEntity) -> Option<(&BindGroup, u32)> {
        self.organs.get(&entity).map(|(group, offset)| (group, *offset))
    }
}

pub(super) fn prepare_bind_groups(
    mut groups: ResMut<OrganBindGroups>,
    buffers: Res<OrganBuffers>,
    extracted: Res<ExtractedOrgans>,
    models: Res<RenderAssets<GpuOrganModel>>,
    layouts: Res<OrganLayouts>,
    views: Query<(Entity, Option<&Tonemapping>), With<ViewUniformOffset>>,
    view_uniforms: Res<ViewUniforms>,
    luts: Res<TonemappingLuts>,
    images: Res<RenderAssets<GpuImage>>,
    fallback: Res<FallbackImage>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    groups.views.clear();
    if let Some(binding) = view_uniforms.uniforms.binding() {
        let layout = cache.get_bind_group_layout(&layouts.view);
        for (view, tonemapping) in &views {
            let tonemapping = tonemapping.unwrap_or(&Tonemapping::None);
            let (lut, sampler) = get_lut_bindings(&images, &luts, tonemapping, &fallback);
            let entries = BindGroupEntries::sequential((binding.clone(), lut, sampler));
            groups.views.insert(view, device.create_bind_group("organ_view", &layout, &entries));
        }
    }
    groups.organs.clear();
    let Some(uniform) = buffers.uniforms.binding() else { return };
    let layout = cache.get_bind_group_layout(&layouts.organ);
    for organ in &extracted.organs {
        let (Some(buffer), Some(&offset)) = (buffers.primaries.get(&organ.entity), buffers.offsets.get(&organ.entity))
        else {
            continue;
        };
        // A model that was exchanged arrives a frame before the vertices that belong to it.
        let fits =
            models.get(organ.model).is_some_and(|gpu| gpu.model.mesh.positions_m.len() == buffer.primaries.len());
        if let Some(primaries) = buffer.primaries.buffer().filter(|_| fits) {
            let entries = BindGroupEntries::sequential((uniform.clone(), primaries.as_entire_binding()));
            groups.organs.insert(organ.entity, (device.create_bind_group("organ", &layout, &entries), offset));
        }
    }
}
