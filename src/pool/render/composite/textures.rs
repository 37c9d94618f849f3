//! The texels of pools on the GPU, kept between frames.

use super::extract::ExtractedPools;
use crate::pool::PoolGrid;
use crate::render::Uploads;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// A pool on the GPU.
struct GpuPool {
    grid: PoolGrid,
    revision: u64,
    texture: Texture,
    view: TextureView,
    /// Rows that hold fluid.
    wet_rows: [u32; 2],
    tiles: RawBufferVec<[u32; 2]>,
}

/// Where the texels of pools come from: uploaded from [`PoolSurface`](crate::pool::PoolSurface), or made on the GPU.
#[derive(Resource, Default)]
pub struct PoolTextures {
    uploaded: BTreeMap<MainEntity, GpuPool>,
    made: BTreeMap<MainEntity, TextureView>,
}

impl PoolTextures {
    /// The texels of these pools are those of textures that the GPU writes: `Rgba16Float`, a texel for each cell of its grid, as in
    /// [`PoolSurface::texels`](crate::pool::PoolSurface). The tiles stay those of the component.
    pub(in crate::pool::render) fn supply(&mut self, made: impl Iterator<Item = (MainEntity, TextureView)>) {
        self.made = made.collect();
    }

    /// The texels of a pool, and its tiles (`[u32; 2]` each) with their number.
    pub(super) fn get(&self, pool: MainEntity) -> Option<(&TextureView, &Buffer, u32)> {
        let own = self.uploaded.get(&pool)?;
        Some((self.made.get(&pool).unwrap_or(&own.view), own.tiles.buffer()?, own.tiles.len() as u32))
    }

    /// Whether a pool must be uploaded, and if its texture stays which of its rows held fluid.
    pub(super) fn needs(&self, pool: MainEntity, grid: &PoolGrid, revision: u64) -> Option<Option<[u32; 2]>> {
        match self.uploaded.get(&pool).filter(|own| own.grid.size() == grid.size()) {
            Some(own) => (own.revision != revision).then_some(Some(own.wet_rows)),
            None => Some(None),
        }
    }
}

/// Makes textures for pools that came, writes what changed, and forgets those that left.
pub(super) fn write_textures(
    mut textures: ResMut<PoolTextures>,
    mut extracted: ResMut<ExtractedPools>,
    uploaded: Option<Res<Uploads>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let textures = &mut *textures;
    let pools = &extracted.pools;
    let is_here = |entity: &MainEntity| pools.binary_search_by_key(entity, |pool| pool.entity).is_ok();
    textures.uploaded.retain(|entity, _| is_here(entity));
    textures.made.retain(|entity, _| is_here(entity));
    for pool in &mut extracted.pools {
        let Some(changed) = pool.changed.take() else { continue };
        let size = pool.grid.size();
        if textures.uploaded.get(&pool.entity).is_none_or(|own| own.grid.size() != size) {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some("pool_surface"),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: TextureFormat::Rgba16Float,
                usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
                view_formats: &[],
            });
            let view = texture.create_view(&default());
            let mut tiles = RawBufferVec::new(BufferUsages::VERTEX);
            tiles.set_label(Some("pool_tiles"));
            let made = GpuPool { grid: pool.grid, revision: 0, texture, view, wet_rows: [0; 2], tiles };
            textures.uploaded.insert(pool.entity, made);
        }
        let Some(own) = textures.uploaded.get_mut(&pool.entity) else { continue };
        (own.grid, own.revision, own.wet_rows) = (pool.grid, pool.revision, changed.wet_rows);
        *own.tiles.values_mut() = changed.tiles.iter().map(|tile| tile.to_array()).collect();
        own.tiles.write_buffer(&device, &queue);
        let mut bytes = size_of_val(own.tiles.values().as_slice()) as u64;
        let texels: &[u8] = bytemuck::cast_slice(&changed.texels);
        // What the GPU makes itself is not uploaded.
        if !textures.made.contains_key(&pool.entity) {
            let rows = changed.texels.len() as u32 / size.x;
            queue.write_texture(
                TexelCopyTextureInfo {
                    texture: &own.texture,
                    mip_level: 0,
                    origin: Origin3d { x: 0, y: changed.first_row, z: 0 },
                    aspect: TextureAspect::All,
                },
                texels,
                TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(size.x * size_of::<[u16; 4]>() as u32),
                    rows_per_image: Some(rows),
                },
                Extent3d { width: size.x, height: rows, depth_or_array_layers: 1 },
            );
            bytes += texels.len() as u64;
        }
        if let Some(uploaded) = &uploaded {
            uploaded.add_rectangles(1, bytes);
        }
    }
}
