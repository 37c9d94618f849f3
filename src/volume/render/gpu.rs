//! Textures of volumes, kept between frames.

use super::extract::{ExtractedVolumes, TexelKind};
use crate::render::Uploads;
use crate::volume::VoxelBox;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// A volume on the GPU.
pub(super) struct GpuVolume {
    revision: u64,
    pub field: TextureView,
    pub gradients: TextureView,
    pub blocks: TextureView,
    pub table: TextureView,
    pub colours: Option<TextureView>,
    textures: Vec<(TexelKind, Texture)>,
}

/// Every volume's textures.
#[derive(Resource, Default)]
pub(super) struct VolumeTextures(BTreeMap<MainEntity, GpuVolume>);

impl VolumeTextures {
    pub fn revision(&self, entity: MainEntity) -> Option<u64> {
        self.0.get(&entity).map(|volume| volume.revision)
    }

    pub fn get(&self, entity: MainEntity) -> Option<&GpuVolume> {
        self.0.get(&entity)
    }
}

fn texture_format(kind: TexelKind) -> TextureFormat {
    match kind {
        TexelKind::Field(format) => format,
        TexelKind::Gradients => TextureFormat::Rgba8Snorm,
        TexelKind::Colours => TextureFormat::Rgba8UnormSrgb,
        TexelKind::Blocks => TextureFormat::R8Uint,
        TexelKind::Table => TextureFormat::Rgba32Float,
    }
}

fn create(device: &RenderDevice, kind: TexelKind, size: UVec3) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some("volume"),
        size: extent(size),
        mip_level_count: 1,
        sample_count: 1,
        dimension: if kind == TexelKind::Table { TextureDimension::D2 } else { TextureDimension::D3 },
        format: texture_format(kind),
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

fn extent(size: UVec3) -> Extent3d {
    Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z }
}

fn write(queue: &RenderQueue, kind: TexelKind, texture: &Texture, of: VoxelBox, texels: &[u8]) {
    let size = of.size();
    let bytes_per_texel = texture_format(kind).block_copy_size(None).unwrap_or(1);
    queue.write_texture(
        TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: Origin3d { x: of.min.x, y: of.min.y, z: of.min.z },
            aspect: TextureAspect::All,
        },
        texels,
        TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size.x * bytes_per_texel),
            rows_per_image: Some(size.y),
        },
        extent(size),
    );
}

/// Makes textures for volumes that came, writes what changed of the others, and forgets those that left.
pub(super) fn write_textures(
    mut textures: ResMut<VolumeTextures>,
    mut extracted: ResMut<ExtractedVolumes>,
    uploaded: Option<Res<Uploads>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    textures.0.retain(|&entity, _| extracted.get(entity).is_some());
    for volume in &mut extracted.0 {
        let uploads = std::mem::take(&mut volume.uploads);
        if volume.is_whole {
            let made: Vec<_> =
                uploads.iter().map(|upload| (upload.kind, create(&device, upload.kind, upload.of.max))).collect();
            let view = |wanted: fn(TexelKind) -> bool| {
                made.iter().find(|(kind, _)| wanted(*kind)).map(|(_, texture)| texture.create_view(&default()))
            };
            let (Some(field), Some(gradients), Some(blocks), Some(table)) = (
                view(|kind| matches!(kind, TexelKind::Field(_))),
                view(|kind| kind == TexelKind::Gradients),
                view(|kind| kind == TexelKind::Blocks),
                view(|kind| kind == TexelKind::Table),
            ) else {
                continue;
            };
            let colours = view(|kind| kind == TexelKind::Colours);
            let gpu = GpuVolume { revision: volume.revision, field, gradients, blocks, table, colours, textures: made };
            textures.0.insert(volume.entity, gpu);
        }
        let Some(gpu) = textures.0.get_mut(&volume.entity) else { continue };
        gpu.revision = volume.revision;
        for upload in uploads {
            if !gpu.textures.iter().any(|(kind, _)| *kind == upload.kind) {
                let texture = create(&device, upload.kind, upload.of.max);
                gpu.colours = Some(texture.create_view(&default()));
                gpu.textures.push((upload.kind, texture));
            }
            if let Some((kind, texture)) = gpu.textures.iter().find(|(kind, _)| *kind == upload.kind) {
                write(&queue, *kind, texture, upload.of, &upload.texels);
            }
            if let Some(uploaded) = uploaded.as_ref().filter(|_| !volume.is_whole) {
                uploaded.add_rectangles(1, upload.texels.len() as u64);
            }
        }
    }
}
