//! Tiles become texture arrays, once per set of options, off the main thread.

use crate::skin::tiles::{TileError, TileSet};
use crate::skin::{Skin, TileSource};
use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, TextureDataOrder, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use std::path::Path;
use tracing::error;

/// The texture array that a skin is drawn with; added once its tiles are there.
#[derive(Component, Clone, Debug, Reflect)]
pub struct SkinTexture {
    /// Four layers, mipmapped.
    pub tiles: Handle<Image>,
    /// Where these tiles came from: another source needs other tiles.
    #[reflect(ignore)]
    source: Option<TileSource>,
}

enum Tiles {
    Making(Task<Result<TileSet, TileError>>),
    Ready(Handle<Image>),
    Failed(TileError),
}

/// The tile sets of the app: each is made once, however many organs wear it.
#[derive(Resource, Default)]
pub struct SkinTileLibrary {
    sets: Vec<(TileSource, Tiles)>,
}

impl SkinTileLibrary {
    /// Whether some set is still being made.
    pub fn is_busy(&self) -> bool {
        self.sets.iter().any(|(_, tiles)| matches!(tiles, Tiles::Making(_)))
    }

    /// Why sets could not be made; skins that want them are not drawn.
    pub fn failures(&self) -> impl Iterator<Item = &TileError> {
        self.sets.iter().filter_map(|(_, tiles)| match tiles {
            Tiles::Failed(error) => Some(error),
            _ => None,
        })
    }
}

/// Starts missing sets, collects finished ones, and hands them to the skins.
pub(super) fn dress_skins(
    mut commands: Commands,
    mut library: ResMut<SkinTileLibrary>,
    mut images: ResMut<Assets<Image>>,
    skins: Query<(Entity, &Skin, Option<&SkinTexture>)>,
) {
    for (source, tiles) in &mut library.sets {
        let Tiles::Making(task) = tiles else { continue };
        *tiles = match check_ready(task) {
            None => continue,
            Some(Ok(set)) => Tiles::Ready(images.add(texture_array(&set))),
            Some(Err(error)) => {
                error!("skin tiles {source:?}: {error}");
                Tiles::Failed(error)
            }
        };
    }
    for (entity, skin, texture) in &skins {
        if texture.is_some_and(|texture| texture.source.as_ref() == Some(&skin.tiles)) {
            continue;
        }
        match library.sets.iter().find(|(source, _)| *source == skin.tiles) {
            Some((source, Tiles::Ready(tiles))) => {
                commands.entity(entity).insert(SkinTexture { tiles: tiles.clone(), source: Some(source.clone()) });
            }
            Some(_) => {}
            None => {
                let source = skin.tiles.clone();
                let task = AsyncComputeTaskPool::get().spawn(async move {
                    match &source {
                        TileSource::Generated(options) => TileSet::generate(options),
                        TileSource::Painted(files) => TileSet::from_png_files(files.each_ref().map(Path::new)),
                    }
                });
                library.sets.push((skin.tiles.clone(), Tiles::Making(task)));
            }
        }
    }
}

fn texture_array(set: &TileSet) -> Image {
    let side = set.resolution_px;
    // Made empty and filled after: `Image::new` checks the size of the first level only.
    let mut image = Image::new_uninit(
        Extent3d { width: side, height: side, depth_or_array_layers: 4 },
        TextureDimension::D2,
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.data = Some(set.gpu_bytes());
    image.data_order = TextureDataOrder::LayerMajor;
    image.texture_descriptor.label = Some("skin_tiles");
    image.texture_descriptor.mip_level_count = set.mips.len() as u32;
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..default() });
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        label: Some("skin_tiles".into()),
        mag_filter: ImageFilterMode::Linear,
        min_filter: ImageFilterMode::Linear,
        mipmap_filter: ImageFilterMode::Linear,
        address_mode_u: ImageAddressMode::ClampToEdge,
        address_mode_v: ImageAddressMode::ClampToEdge,
        ..default()
    });
    image
}
