//! Textures, pipeline and bind groups of the reactions pass.

use super::cull::TriangleTiles;
use super::extract::{ExtractedReactions, ExtractedRect};
use crate::organ::OrganModel;
use crate::organ::render::{GpuOrganModel, OrganGloss, OrganLayer, OrganLayouts, OrganPart, layer_shader};
use crate::reactions::texels::{MapSize, TileMask};
use crate::render::Uploads;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    binding_types::{sampler, texture_2d},
    *,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// Names the layer.
pub(super) struct ReactionLayer;

pub(super) fn init_layer(mut commands: Commands, layouts: Res<OrganLayouts>, assets: Res<AssetServer>) {
    let layout = BindGroupLayoutDescriptor::new(
        "reactions_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (texture_2d(TextureSampleType::Float { filterable: true }), sampler(SamplerBindingType::Filtering)),
        ),
    );
    let shader = layer_shader(&assets, "reactions/reactions.wgsl");
    let blend = Some(BlendState::ALPHA_BLENDING);
    commands.insert_resource(OrganLayer::<ReactionLayer>::new("reactions", &layouts, vec![layout], shader, blend));
}

/// The GPU's copy of a reaction map.
struct MapTextures {
    size: MapSize,
    model: u64,
    revision: u64,
    colour: Texture,
    gloss: Texture,
    gloss_view: TextureView,
    bind_group: Option<BindGroup>,
    /// Of which organ the triangles are.
    organ: Option<(OrganModel, TriangleTiles)>,
    seen: TileMask,
    /// The triangles on seen tiles.
    indices: RawBufferVec<u32>,
}

impl MapTextures {
    fn new(device: &RenderDevice, size: MapSize, model: u64) -> Self {
        let texture = |label, format| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.width_px, height: size.height_px, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
                view_formats: &[],
            })
        };
        let gloss = texture("reaction_gloss", TextureFormat::R8Unorm);
        Self {
            size,
            model,
            revision: 0,
            // Not an sRGB format: colours are premultiplied in the encoded space, and the shader decodes them.
            colour: texture("reaction_colour", TextureFormat::Rgba8Unorm),
            gloss_view: gloss.create_view(&TextureViewDescriptor::default()),
            gloss,
            bind_group: None,
            organ: None,
            seen: TileMask::new(size),
            indices: {
                let mut indices = RawBufferVec::new(BufferUsages::INDEX);
                indices.set_label(Some("reaction_indices"));
                indices
            },
        }
    }

    /// Lists the triangles that show something; the bytes sent.
    fn list_triangles(&mut self, gpu: &GpuOrganModel, device: &RenderDevice, queue: &RenderQueue) -> u64 {
        let (organ, size) = (&gpu.model, self.size);
        let indices = &organ.skin_mesh.indices;
        let is_of = self.organ.as_ref().is_some_and(|(own, _)| own.is_same(organ));
        if !is_of {
            let tiles = TriangleTiles::new(&organ.corner_vertices(), indices, !organ.atlas.is_spherical(), size);
            self.organ = Some((organ.clone(), tiles));
        }
        let Some((_, tiles)) = &self.organ else { return 0 };
        *self.indices.values_mut() = tiles.visible(indices, &self.seen);
        self.indices.write_buffer(device, queue);
        size_of_val(self.indices.values().as_slice()) as u64
    }

    fn write(&self, queue: &RenderQueue, part: &ExtractedRect) {
        let rect = part.rect;
        for (texture, bytes, texel_bytes) in [(&self.colour, &part.colour, 4), (&self.gloss, &part.gloss, 1)] {
            queue.write_texture(
                TexelCopyTextureInfo {
                    texture,
                    mip_level: 0,
                    origin: Origin3d { x: rect.x, y: rect.y, z: 0 },
                    aspect: TextureAspect::All,
                },
                bytes,
                TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(texel_bytes * rect.width),
                    rows_per_image: None,
                },
                Extent3d { width: rect.width, height: rect.height, depth_or_array_layers: 1 },
            );
        }
    }
}

/// Reaction maps by organ, kept between frames.
#[derive(Resource, Default)]
pub(super) struct ReactionTextures(BTreeMap<MainEntity, MapTextures>);

impl ReactionTextures {
    /// The revision of a model's map that the GPU has.
    pub fn revision(&self, entity: MainEntity, model: u64, size: MapSize) -> Option<u64> {
        self.0.get(&entity).filter(|map| map.model == model && map.size == size).map(|map| map.revision)
    }

    /// Tiles for which the triangles are listed.
    pub fn seen(&self, entity: MainEntity) -> Option<&TileMask> {
        self.0.get(&entity).filter(|map| map.organ.is_some()).map(|map| &map.seen)
    }

    pub fn part(&self, entity: MainEntity) -> Option<OrganPart<'_>> {
        let map = self.0.get(&entity)?;
        let indices = (map.indices.buffer()?, map.indices.len() as u32);
        (indices.1 > 0).then_some(OrganPart { group: map.bind_group.as_ref()?, indices: Some(indices) })
    }
}

pub(super) fn write_textures(
    mut textures: ResMut<ReactionTextures>,
    mut gloss: ResMut<OrganGloss>,
    mut extracted: ResMut<ExtractedReactions>,
    models: Res<RenderAssets<GpuOrganModel>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    uploads: Option<Res<Uploads>>,
) {
    let is_here = |entity: &MainEntity| extracted.maps.binary_search_by_key(entity, |map| map.entity).is_ok();
    textures.0.retain(|entity, _| {
        let stays = is_here(entity);
        if !stays {
            gloss.maps.remove(entity);
        }
        stays
    });
    for map in &mut extracted.maps {
        if textures.revision(map.entity, map.model, map.size).is_none() {
            let made = MapTextures::new(&device, map.size, map.model);
            gloss.maps.insert(map.entity, made.gloss_view.clone());
            textures.0.insert(map.entity, made);
        }
        let Some(copy) = textures.0.get_mut(&map.entity) else { continue };
        let mut bytes = 0;
        for part in &map.rects {
            copy.write(&queue, part);
            bytes += (part.colour.len() + part.gloss.len()) as u64;
        }
        if let Some(uploads) = &uploads {
            uploads.add_rectangles(map.rects.len() as u64, bytes);
        }
        copy.revision = map.revision;
        let gpu = models.get(map.organ);
        let is_other = gpu.is_some_and(|gpu| !copy.organ.as_ref().is_some_and(|(own, _)| own.is_same(&gpu.model)));
        let is_news = map.seen.is_some();
        if let Some(seen) = map.seen.take() {
            copy.seen = seen;
        }
        if let Some(gpu) = gpu.filter(|_| is_news || is_other) {
            let bytes = copy.list_triangles(gpu, &device, &queue);
            if let Some(uploads) = &uploads {
                uploads.add(bytes);
            }
        }
        map.rects.clear();
    }
}

pub(super) fn prepare_bind_groups(
    mut textures: ResMut<ReactionTextures>,
    layer: Res<OrganLayer<ReactionLayer>>,
    gloss: Res<OrganGloss>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let layout = cache.get_bind_group_layout(&layer.own_groups[0]);
    for map in textures.0.values_mut().filter(|map| map.bind_group.is_none()) {
        let view = map.colour.create_view(&TextureViewDescriptor::default());
        let entries = BindGroupEntries::sequential((&view, &gloss.sampler));
        map.bind_group = Some(device.create_bind_group("reactions", &layout, &entries));
    }
}
