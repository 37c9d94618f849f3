//! Tiles become texture arrays, once per set of options, off the main thread, and go when nobody wears them.

use crate::skin::tiles::{TILE_COUNT, TileError, TileSet};
use crate::skin::{Skin, TileSource};
use bevy::asset::{AssetPath, AssetServerMode, RenderAssetUsages};
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
    source: SourceKey,
}

/// A [`TileSource`] bit by bit. `==` on the source itself would never find options that hold a NaN again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct SourceKey(Vec<u8>);

impl SourceKey {
    fn new(source: &TileSource) -> Self {
        Self(postcard::to_stdvec(source).expect("numbers, strings and lists of known length always serialise"))
    }
}

enum Tiles {
    Making(Task<Result<TileSet, TileError>>),
    Ready(Handle<Image>),
    Failed(TileError),
}

impl Tiles {
    /// For how many updates they are kept after the last skin that names them.
    fn grace_updates(&self) -> u32 {
        match self {
            // Long enough for a skin that is taken off and put on again, short enough that a slider which is dragged
            // through many seeds does not queue them all.
            Self::Making(_) => 2,
            // Switching back to a skin that was just seen costs nothing.
            Self::Ready(_) => 60,
            // What made it fail may be repaired by the time it is asked for again.
            Self::Failed(_) => 0,
        }
    }
}

struct LibrarySet {
    source: TileSource,
    key: SourceKey,
    tiles: Tiles,
    /// Updates since a skin last named it.
    unnamed_updates: u32,
}

/// The tile sets of the app: each is made once, however many organs wear it.
///
/// A set is dropped about a second (60 updates) after the last skin that names it, one that is still being made after
/// two updates. One that failed is forgotten in the first update in which no skin names it: after a painted file has
/// been repaired, give the organ another skin, or none, for an update and then the painted one again.
#[derive(Resource, Default)]
pub struct SkinTileLibrary {
    sets: Vec<LibrarySet>,
}

impl SkinTileLibrary {
    /// Whether some set is still being made.
    pub fn is_busy(&self) -> bool {
        self.sets.iter().any(|set| matches!(set.tiles, Tiles::Making(_)))
    }

    /// Why sets could not be made; skins that want them are not drawn with them.
    pub fn failures(&self) -> impl Iterator<Item = &TileError> {
        self.sets.iter().filter_map(|set| match &set.tiles {
            Tiles::Failed(error) => Some(error),
            _ => None,
        })
    }

    fn named(&mut self, key: &SourceKey) -> Option<&mut LibrarySet> {
        let set = self.sets.iter_mut().find(|set| set.key == *key)?;
        set.unnamed_updates = 0;
        Some(set)
    }
}

/// Starts missing sets, collects finished ones, hands them to the skins, and drops those that no skin names.
pub(super) fn dress_skins(
    mut commands: Commands,
    mut library: ResMut<SkinTileLibrary>,
    mut images: ResMut<Assets<Image>>,
    assets: Res<AssetServer>,
    skins: Query<(Entity, &Skin, Option<&SkinTexture>)>,
    bare: Query<Entity, (With<SkinTexture>, Without<Skin>)>,
) {
    for set in &mut library.sets {
        set.unnamed_updates = set.unnamed_updates.saturating_add(1);
        let Tiles::Making(task) = &mut set.tiles else { continue };
        set.tiles = match check_ready(task) {
            None => continue,
            Some(Ok(tiles)) => Tiles::Ready(images.add(texture_array(&tiles))),
            Some(Err(error)) => {
                error!("skin tiles {:?}: {error}", set.source);
                Tiles::Failed(error)
            }
        };
    }
    for entity in &bare {
        commands.entity(entity).remove::<SkinTexture>();
    }
    for (entity, skin, texture) in &skins {
        let key = SourceKey::new(&skin.tiles);
        let is_worn = texture.is_some_and(|texture| texture.source == key);
        if let Some(texture) = texture {
            // Until other tiles are ready the organ shows the old ones, and may want them back.
            library.named(&texture.source);
        }
        match library.named(&key) {
            Some(LibrarySet { tiles: Tiles::Ready(tiles), .. }) if !is_worn => {
                commands.entity(entity).insert(SkinTexture { tiles: tiles.clone(), source: key });
            }
            Some(_) => {}
            None => {
                let tiles = Tiles::Making(start(&skin.tiles, &assets));
                library.sets.push(LibrarySet { source: skin.tiles.clone(), key, tiles, unnamed_updates: 0 });
            }
        }
    }
    // Dropping a task cancels it.
    library.sets.retain(|set| set.unnamed_updates <= set.tiles.grace_updates());
}

fn start(source: &TileSource, assets: &AssetServer) -> Task<Result<TileSet, TileError>> {
    let pool = AsyncComputeTaskPool::get();
    match source.clone() {
        TileSource::Generated(options) => pool.spawn(async move { TileSet::generate(&options) }),
        TileSource::Painted(files) => {
            let assets = assets.clone();
            pool.spawn(async move {
                let mut contents: [Vec<u8>; TILE_COUNT] = default();
                for (file, bytes) in files.iter().zip(&mut contents) {
                    *bytes = read(file, &assets)
                        .await
                        .map_err(|error| TileError::Png { name: file.clone(), what: error.to_string() })?;
                }
                TileSet::from_png_bytes(std::array::from_fn(|tile| (files[tile].as_str(), contents[tile].as_slice())))
            })
        }
    }
}

async fn read(file: &str, assets: &AssetServer) -> Result<Vec<u8>, Box<dyn std::error::Error + Send + Sync>> {
    if Path::new(file).is_absolute() {
        return Ok(std::fs::read(file)?);
    }
    let path = AssetPath::try_parse(file)?;
    let source = assets.get_source(path.source())?;
    let reader = match assets.mode() {
        AssetServerMode::Unprocessed => source.reader(),
        AssetServerMode::Processed => source.processed_reader()?,
    };
    let mut bytes = Vec::new();
    reader.read(path.path()).await?.read_to_end(&mut bytes).await?;
    Ok(bytes)
}

fn texture_array(set: &TileSet) -> Image {
    let side = set.resolution_px;
    // Made empty and filled after: `Image::new` checks the size of the first level only.
    let mut image = Image::new_uninit(
        Extent3d { width: side, height: side, depth_or_array_layers: 4 },
        TextureDimension::D2,
        TextureFormat::Rgba8UnormSrgb,
        // Kept in the main world too: after a lost device Bevy uploads it again from there.
        RenderAssetUsages::default(),
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
