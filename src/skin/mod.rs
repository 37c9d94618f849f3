//! Layer 1 of an organ: its skin (paper of 2002, sections 3.1, 3.2 and 4.1).
//!
//! Four triangular tiles of cell noise ([`tiles`]) are laid on the near-regular triangles of the organ's texture mesh,
//! so the pattern is undistorted whatever the organ's shape. The skin is lit by [`ScopeLight`](crate::view::ScopeLight)
//! and by Bevy's own lights. Presets such as [`Skin::liver`] are only parameters.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_surgery::prelude::*;
//! # fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//! commands.spawn((Organ(assets.load("liver.obj")), Skin::liver()));
//! # }
//! ```

mod presets;
#[cfg(feature = "render")]
mod render;
pub mod tiles;

pub use presets::OrganPreset;
#[cfg(feature = "render")]
pub use render::{SkinTexture, SkinTileLibrary, SkinUniform};

use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};
use tiles::TileOptions;

/// How an organ's skin looks. Lengths in metres, colours as Bevy's.
///
/// Numbers out of range are clamped where they are drawn. For numbers that are not finite it draws no mottle, scatter,
/// sheen or relief, patches of 35 mm, a roughness of 0.3 and a tint of 1.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct Skin {
    /// Where the four tiles come from.
    pub tiles: TileSource,
    /// Multiplies the tiles' colour; linear channels from 0 to 10.
    pub tint: Color,
    /// How strongly the colour wanders over the organ in soft patches, 0 to 1.
    pub mottle: f32,
    /// Size of these patches, metres.
    pub mottle_size_m: f32,
    /// How far light creeps round into the shade, as it does in flesh, 0 to 1.
    pub scatter: f32,
    /// Strength of the soft sheen of the moist capsule, 0 to 100; about 1 is natural. The sharp reflections of the lamp
    /// are the third layer's.
    pub sheen: f32,
    /// Roughness of this sheen, 0.05 to 1.
    pub sheen_roughness: f32,
    /// How far dark texels of the tiles are raised over white ones, metres, -0.1 to 0.1: it breaks the sheen into
    /// glints.
    pub relief_m: f32,
    /// Chooses tile and rotation for each texture triangle.
    pub seed: u64,
}

impl Default for Skin {
    fn default() -> Self {
        Self::liver()
    }
}

/// Where the tiles of a skin come from.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum TileSource {
    /// Made once for all organs that name the same options, off the main thread.
    Generated(TileOptions),
    /// Four PNG files that a designer painted, in the layout that [`tiles::TileSet::save_png`] writes.
    ///
    /// They are asset paths such as `skins/liver-0.png` or `mods://liver-0.png`, read by the asset source's
    /// [`AssetReader`](bevy::asset::io::AssetReader) when an organ first names them. An absolute path is opened in the
    /// file system, wherever it leads. Changes of the files are not watched.
    Painted([String; 4]),
}

/// Gives organs their skin. See the [module](self).
pub struct SkinPlugin;

impl Plugin for SkinPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Skin>()
            .register_type::<OrganPreset>()
            .register_type::<tiles::TileSet>()
            .register_type::<tiles::TilePoints>()
            .register_type::<tiles::TileChoice>()
            .register_type::<tiles::EdgeMismatch>()
            .register_type::<tiles::TileError>();
        #[cfg(feature = "render")]
        render::build(app);
    }
}
