//! The shadow map of a lamp: drawn once for all cameras, and only after lamp or tools moved.

use super::extract::{ExtractedCaster, ExtractedToolShadows};
use super::{MAX_SHADOW_LAMPS, ShadowLens};
use crate::render::{Uploads, shader_path};
use bevy::asset::AssetId;
use bevy::camera::visibility::RenderLayers;
use bevy::core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT;
use bevy::math::{Affine3A, Rect};
use bevy::mesh::MeshVertexBufferLayoutRef;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::mesh::allocator::MeshAllocator;
use bevy::render::mesh::{RenderMesh, RenderMeshBufferInfo};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{binding_types::uniform_buffer, *};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// A mesh that casts, as the shader reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct ToolCasterUniform {
    /// Mesh space to clip space of the lamp.
    pub clip_from_mesh: Mat4,
}

#[derive(Resource)]
pub(super) struct MapPipeline {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
}

/// What a map's pipeline depends on beside the mesh's vertices: topology, and the index format of strips.
type MapPipelineKey = (PrimitiveTopology, Option<IndexFormat>);

impl SpecializedMeshPipeline for MapPipeline {
    type Key = MapPipelineKey;

    fn specialize(
        &self,
        (topology, strip_index_format): MapPipelineKey,
        layout: &MeshVertexBufferLayoutRef,
    ) -> Result<RenderPipelineDescriptor, SpecializedMeshPipelineError> {
        Ok(RenderPipelineDescriptor {
            label: Some("tool_shadow_map_pipeline".into()),
            layout: vec![self.layout.clone()],
            vertex: VertexState {
                shader: self.shader.clone(),
                entry_point: Some("vertex".into()),
                buffers: vec![layout.0.get_layout(&[Mesh::ATTRIBUTE_POSITION.at_shader_location(0)])?],
                ..default()
            },
            // Both sides of every triangle cast: open meshes and mirrored tools need no care.
            primitive: PrimitiveState { topology, strip_index_format, cull_mode: None, ..default() },
            depth_stencil: Some(DepthStencilState {
                format: CORE_3D_DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(CompareFunction::GreaterEqual),
                stencil: default(),
                bias: default(),
            }),
            ..default()
        })
    }
}

/// Everything that a map's contents depend on.
#[derive(Clone, PartialEq)]
struct MapContents {
    lens: ShadowLens,
    casters: Vec<(MainEntity, AssetId<Mesh>, u64, Affine3A)>,
}

struct MapDraw {
    pipeline: CachedRenderPipelineId,
    mesh: AssetId<Mesh>,
    offset: u32,
}

/// What a lamp's casters can shade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reach {
    /// Texels around the casters, with room for the look-ups.
    pub texels: Rect,
    /// Nothing nearer to the lamp is shaded, metres along its axis.
    pub nearest_m: f32,
}

pub(super) struct LampMap {
    pub lens: ShadowLens,
    pub layers: RenderLayers,
    pub view: TextureView,
    pub reach: Reach,
    texture: Texture,
    wanted: MapContents,
    drawn: Option<MapContents>,
    draws: Vec<MapDraw>,
}

impl LampMap {
    /// Whether the map has been drawn at all.
    pub fn is_ready(&self) -> bool {
        self.drawn.is_some()
    }
}

/// The shadow maps of this frame (render world).
#[derive(Resource, Default)]
pub struct ToolShadowMaps {
    pub(super) lamps: BTreeMap<MainEntity, LampMap>,
    uniforms: DynamicUniformBuffer<ToolCasterUniform>,
    group: Option<BindGroup>,
    redraws: u64,
    has_warned: bool,
}

impl ToolShadowMaps {
    /// How often a map was drawn since the app began.
    pub fn redraws(&self) -> u64 {
        self.redraws
    }

    /// The map of a lamp, `Depth32Float`; see [`ShadowLens`] for what it holds.
    pub fn texture(&self, lamp: Entity) -> Option<&Texture> {
        self.lamps.get(&lamp.into()).map(|map| &map.texture)
    }
}

pub(super) fn init_pipeline(mut commands: Commands, assets: Res<AssetServer>) {
    commands.insert_resource(MapPipeline {
        layout: BindGroupLayoutDescriptor::new(
            "tool_shadow_map_layout",
            &BindGroupLayoutEntries::single(ShaderStages::VERTEX, uniform_buffer::<ToolCasterUniform>(true)),
        ),
        shader: assets.load(shader_path("view/tool_shadow_map.wgsl")),
    });
}

pub(super) fn prepare_maps(
    mut maps: ResMut<ToolShadowMaps>,
    extracted: Res<ExtractedToolShadows>,
    meshes: Res<RenderAssets<RenderMesh>>,
    pipeline: Res<MapPipeline>,
    mut pipelines: ResMut<SpecializedMeshPipelines<MapPipeline>>,
    cache: Res<PipelineCache>,
    uploaded: Option<Res<Uploads>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let maps = &mut *maps;
    maps.uniforms.clear();
    maps.group = None;
    // Meshes that are not there yet cast as soon as they are.
    let casters: Vec<(&ExtractedCaster, &RenderMesh)> =
        extracted.casters.iter().filter_map(|caster| Some((caster, meshes.get(caster.mesh)?))).collect();
    let casting = extracted.lamps.iter().filter_map(|lamp| {
        let own: Vec<_> = casters.iter().filter(|(caster, _)| caster.layers.intersects(&lamp.layers)).collect();
        (!own.is_empty()).then_some((lamp, own))
    });
    let casting: Vec<_> = casting.collect();
    if casting.len() > MAX_SHADOW_LAMPS && !maps.has_warned {
        maps.has_warned = true;
        tracing::warn!("{} lamps have tool shadows; only the first {MAX_SHADOW_LAMPS} cast them", casting.len());
    }
    let chosen = &casting[..casting.len().min(MAX_SHADOW_LAMPS)];
    maps.lamps.retain(|entity, _| chosen.iter().any(|(lamp, _)| lamp.entity == *entity));
    let mut count = 0;
    for (lamp, casters) in chosen {
        let wanted = MapContents {
            // How the map is read does not change what it holds.
            lens: ShadowLens { softness_m: 0.0, strength: 0.0, ..lamp.lens },
            casters: casters.iter().map(|(c, _)| (c.entity, c.mesh, c.revision, c.world_from_mesh)).collect(),
        };
        let reach = reach(&lamp.lens, casters.iter().map(|(caster, _)| *caster));
        let old = maps.lamps.remove(&lamp.entity);
        let old = old.filter(|map| map.lens.resolution_px == lamp.lens.resolution_px);
        let mut map = old.unwrap_or_else(|| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some("tool_shadow_map"),
                size: Extent3d { width: lamp.lens.resolution_px, height: lamp.lens.resolution_px, ..default() },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: CORE_3D_DEPTH_FORMAT,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            LampMap {
                lens: lamp.lens,
                layers: default(),
                view: texture.create_view(&default()),
                reach,
                texture,
                wanted: wanted.clone(),
                drawn: None,
                draws: Vec::new(),
            }
        });
        (map.lens, map.layers, map.reach, map.wanted) = (lamp.lens, lamp.layers.clone(), reach, wanted);
        map.draws.clear();
        if map.drawn.as_ref() != Some(&map.wanted) {
            let clip_from_world = map.lens.clip_from_world();
            for (caster, mesh) in casters {
                let Some(pipeline) = caster_pipeline(mesh, &pipeline, &mut pipelines, &cache) else { continue };
                let clip_from_mesh = clip_from_world * Mat4::from(caster.world_from_mesh);
                let offset = maps.uniforms.push(&ToolCasterUniform { clip_from_mesh });
                map.draws.push(MapDraw { pipeline, mesh: caster.mesh, offset });
                count += 1;
            }
        }
        maps.lamps.insert(lamp.entity, map);
    }
    if count > 0 {
        maps.uniforms.write_buffer(&device, &queue);
        let layout = cache.get_bind_group_layout(&pipeline.layout);
        maps.group = maps
            .uniforms
            .binding()
            .map(|binding| device.create_bind_group("tool_shadow_map", &layout, &BindGroupEntries::single(binding)));
        if let Some(uploaded) = uploaded {
            uploaded.add(count * ToolCasterUniform::min_size().get());
        }
    }
}

/// `None` for meshes that are no surfaces.
fn caster_pipeline(
    mesh: &RenderMesh,
    pipeline: &MapPipeline,
    pipelines: &mut SpecializedMeshPipelines<MapPipeline>,
    cache: &PipelineCache,
) -> Option<CachedRenderPipelineId> {
    let topology = mesh.primitive_topology();
    if !matches!(topology, PrimitiveTopology::TriangleList | PrimitiveTopology::TriangleStrip) {
        return None;
    }
    let strip_index_format = mesh.index_format().filter(|_| topology.is_strip());
    pipelines.specialize(cache, pipeline, (topology, strip_index_format), &mesh.layout).ok()
}

/// Bounds of the casters on the map.
fn reach<'a>(lens: &ShadowLens, casters: impl Iterator<Item = &'a ExtractedCaster>) -> Reach {
    let whole = Rect::from_corners(Vec2::ZERO, Vec2::splat(lens.resolution_px as f32));
    let mut texels = Rect::EMPTY;
    let mut nearest_depth = 0.0_f32;
    for caster in casters {
        let corners = caster.bounds.map(|bounds| {
            let corner = move |i: u32| {
                let sign = |bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
                let offset = Vec3::new(sign(0), sign(1), sign(2)) * Vec3::from(bounds.half_extents);
                caster.world_from_mesh.transform_point3(Vec3::from(bounds.center) + offset)
            };
            (0..8).map(corner)
        });
        for place in corners.into_iter().flatten().map(|corner| lens.place(corner)) {
            match place.filter(|place| place.depth < 1.0) {
                Some(place) => {
                    texels = texels.union_point(place.texel);
                    nearest_depth = nearest_depth.max(place.depth);
                }
                // Beside or behind the lamp: it may be seen anywhere.
                None => (texels, nearest_depth) = (texels.union(whole), 1.0),
            }
        }
        if caster.bounds.is_none() {
            (texels, nearest_depth) = (texels.union(whole), 1.0);
        }
    }
    // Nothing is drawn beyond the map; a texel of rounding besides the look-ups' radius.
    let texels = texels.intersect(whole);
    let texels = if texels.is_empty() { Rect::EMPTY } else { texels.inflate(lens.radius_px(nearest_depth) + 1.0) };
    Reach { texels, nearest_m: lens.near_m / nearest_depth.max(f32::MIN_POSITIVE) }
}

pub(super) fn draw_maps(
    mut maps: ResMut<ToolShadowMaps>,
    meshes: Res<RenderAssets<RenderMesh>>,
    allocator: Res<MeshAllocator>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let ToolShadowMaps { lamps, group, redraws, .. } = &mut *maps;
    for map in lamps.values_mut().filter(|map| map.drawn.as_ref() != Some(&map.wanted)) {
        let pipelines: Option<Vec<_>> = map.draws.iter().map(|draw| cache.get_render_pipeline(draw.pipeline)).collect();
        // Until all of them are compiled the old map stays.
        let Some(pipelines) = pipelines else { continue };
        let diagnostics = ctx.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("tool_shadow_map"),
            color_attachments: &[],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &map.view,
                depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, "tool_shadow_map");
        // The outermost texels stay empty: look-ups beyond the map are clamped to them.
        let inner_px = map.lens.resolution_px - 2;
        pass.set_scissor_rect(1, 1, inner_px, inner_px);
        for (draw, pipeline) in map.draws.iter().zip(pipelines) {
            let (Some(mesh), Some(vertices), Some(group)) =
                (meshes.get(draw.mesh), allocator.mesh_vertex_slice(&draw.mesh), group.as_ref())
            else {
                continue;
            };
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, group, &[draw.offset]);
            pass.set_vertex_buffer(0, vertices.buffer.slice(..));
            match &mesh.buffer_info {
                RenderMeshBufferInfo::Indexed { count, index_format } => {
                    let Some(indices) = allocator.mesh_index_slice(&draw.mesh) else { continue };
                    pass.set_index_buffer(indices.buffer.slice(..), *index_format);
                    let first = indices.range.start;
                    pass.draw_indexed(first..first + count, vertices.range.start as i32, 0..1);
                }
                RenderMeshBufferInfo::NonIndexed => pass.draw(vertices.range, 0..1),
            }
        }
        span.end(&mut pass);
        drop(pass);
        map.drawn = Some(map.wanted.clone());
        *redraws += 1;
    }
}
