//! Layer 3 of an organ: the lamp's reflections on its moist surface (paper of 2002, sections 3.4 and 4.3).
//!
//! An endoscope's lamp is a ring around the optic, and smooth wet tissue shows it as a ring; rough tissue blurs it. The
//! [`profile`] of that reflection is computed on the CPU for each camera, each ring light and the roughness of wet and
//! dry tissue, uploaded as a small table, and looked up per pixel by a constant radial ramp. Bevy's own lights have no
//! ring and leave a plain glint.
//!
//! How wet or dull a place is comes from the organ's gloss map, which the reactions write: blood shines, burnt tissue
//! does not. Without a map the whole organ is as the skin.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_surgery::prelude::*;
//! # fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//! commands.spawn((Organ(assets.load("liver.obj")), Skin::liver(), Highlights::default()));
//! # }
//! ```

pub mod profile;
#[cfg(feature = "render")]
mod radiance;
#[cfg(feature = "render")]
mod render;

#[cfg(feature = "render")]
pub use radiance::highlight_radiance;
#[cfg(feature = "render")]
pub use render::{HighlightRing, HighlightsUniform};

use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// The lamp's reflections on an organ. Lengths in metres, angles in radians.
///
/// Numbers out of range are clamped where they are drawn; for those that are not finite the default's are taken.
#[derive(Component, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub struct Highlights {
    /// Multiplies the reflections, 0 to 100; 1 is what physics gives.
    pub strength: f32,
    /// Standard deviation of the surface normal where nothing was spilt, radians, 0.002 to 0.7.
    pub dry_roughness: f32,
    /// The same for wet places, radians, 0.002 to 0.7. The ring is seen as a ring where this is smaller than half the
    /// ring's radius over its distance.
    pub wet_roughness: f32,
    /// Share of light that is mirrored at right angles, 0 to 1; about 0.02 for a film of water.
    pub reflectance: f32,
    /// How far wet places stand above dry ones, metres, 0 to 0.01: drops get glints of their own.
    pub film_relief_m: f32,
    /// How strongly fine grain tilts the surface, radians (standard deviation), 0 to 0.5: it breaks the reflections of
    /// the skin up. Wet places are smooth.
    pub grain_tilt: f32,
    /// Size of this grain, metres, 1e-5 to 1.
    pub grain_size_m: f32,
    /// Whether drops shine.
    pub cover: HighlightCover,
}

impl Default for Highlights {
    fn default() -> Self {
        Self {
            strength: 1.0,
            dry_roughness: 0.06,
            wet_roughness: 0.005,
            reflectance: 0.02,
            film_relief_m: 0.000_2,
            grain_tilt: 0.08,
            grain_size_m: 0.001_2,
            cover: HighlightCover::OverDrops,
        }
    }
}

/// Which of the organ's other layers the reflections lie over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum HighlightCover {
    /// Over skin and drops, which shine by their wetness: drawn in `OrganPasses::Highlights`.
    #[default]
    OverDrops,
    /// Over the skin alone, and drops hide them: drawn in `OrganPasses::HighlightsUnder`.
    UnderDrops,
}

#[cfg(feature = "render")]
impl Highlights {
    /// As it is drawn: every number within its bounds.
    pub fn clamped(&self) -> Self {
        use crate::render::finite_within;
        let default = Self::default();
        Self {
            strength: finite_within(self.strength, 0.0, 100.0, default.strength),
            dry_roughness: finite_within(self.dry_roughness, 0.002, 0.7, default.dry_roughness),
            wet_roughness: finite_within(self.wet_roughness, 0.002, 0.7, default.wet_roughness),
            reflectance: finite_within(self.reflectance, 0.0, 1.0, default.reflectance),
            film_relief_m: finite_within(self.film_relief_m, 0.0, 0.01, default.film_relief_m),
            grain_tilt: finite_within(self.grain_tilt, 0.0, 0.5, default.grain_tilt),
            grain_size_m: finite_within(self.grain_size_m, 1e-5, 1.0, default.grain_size_m),
            cover: self.cover,
        }
    }
}

/// Draws [`Highlights`]. See the [module](self).
pub struct HighlightsPlugin;

impl Plugin for HighlightsPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Highlights>()
            .register_type::<HighlightCover>()
            .register_type::<profile::RingProfile>()
            .register_type::<profile::DistanceSlices>();
        #[cfg(feature = "render")]
        render::build(app);
    }
}
