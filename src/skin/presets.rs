//! Skins of organs: only parameters.

use super::tiles::TileOptions;
use super::{Skin, TileSource};
use bevy::prelude::*;
use std::str::FromStr;

/// Organs with a ready skin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Default, Clone)]
pub enum OrganPreset {
    /// Red-brown, fine lobules.
    #[default]
    Liver,
    /// Grey-green, fine net of vessels.
    Gallbladder,
    /// Dark purple, faintly granular.
    Spleen,
    /// Smooth red-brown.
    Kidney,
    /// Pink, soft, glossy: stomach and bowel from inside.
    Mucosa,
}

impl OrganPreset {
    /// All presets.
    pub const ALL: [Self; 5] = [Self::Liver, Self::Gallbladder, Self::Spleen, Self::Kidney, Self::Mucosa];

    /// Lower-case name, as [`FromStr`] takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Gallbladder => "gallbladder",
            Self::Spleen => "spleen",
            Self::Kidney => "kidney",
            Self::Mucosa => "mucosa",
        }
    }

    /// Largest side of the box around a grown person's organ, metres: for files of unknown unit. Of the mucosa, a
    /// piece.
    pub fn typical_extent_m(self) -> f32 {
        match self {
            Self::Liver => 0.22,
            Self::Gallbladder => 0.09,
            Self::Spleen => 0.12,
            Self::Kidney => 0.11,
            Self::Mucosa => 0.2,
        }
    }

    /// Its skin.
    pub fn skin(self) -> Skin {
        match self {
            Self::Liver => Skin::liver(),
            Self::Gallbladder => Skin::gallbladder(),
            Self::Spleen => Skin::spleen(),
            Self::Kidney => Skin::kidney(),
            Self::Mucosa => Skin::mucosa(),
        }
    }
}

impl FromStr for OrganPreset {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|preset| preset.name() == name);
        found.ok_or_else(|| format!("{name} is no organ preset; there are {}", Self::ALL.map(Self::name).join(", ")))
    }
}

impl Skin {
    fn with_tiles(tiles: TileOptions) -> Self {
        Self {
            tiles: TileSource::Generated(tiles),
            tint: Color::WHITE,
            mottle: 0.3,
            mottle_size_m: 0.035,
            scatter: 0.18,
            sheen: 1.0,
            sheen_roughness: 0.3,
            relief_m: 0.0009,
            seed: 1,
        }
    }

    /// A liver's capsule.
    pub fn liver() -> Self {
        Self { tint: Color::linear_rgb(0.86, 0.72, 0.7), mottle: 0.36, ..Self::with_tiles(TileOptions::liver()) }
    }

    /// A gallbladder.
    pub fn gallbladder() -> Self {
        Self { mottle: 0.3, mottle_size_m: 0.02, scatter: 0.25, ..Self::with_tiles(TileOptions::gallbladder()) }
    }

    /// A spleen.
    pub fn spleen() -> Self {
        Self { mottle: 0.25, ..Self::with_tiles(TileOptions::spleen()) }
    }

    /// A kidney.
    pub fn kidney() -> Self {
        Self { mottle: 0.15, sheen_roughness: 0.36, ..Self::with_tiles(TileOptions::kidney()) }
    }

    /// The mucous lining of stomach or bowel; add [`Hollow`](crate::organ::Hollow) to see it from inside.
    pub fn mucosa() -> Self {
        let tiles = TileOptions::mucosa();
        Self { mottle: 0.18, scatter: 0.35, sheen: 1.4, sheen_roughness: 0.3, ..Self::with_tiles(tiles) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_back_and_others_are_refused() {
        for preset in OrganPreset::ALL {
            assert_eq!(preset.name().parse(), Ok(preset));
        }
        let error = "lung".parse::<OrganPreset>().expect_err("there is no lung");
        assert!(error.contains("lung") && error.contains("spleen"), "{error}");
    }

    #[test]
    fn extents_are_those_of_organs() {
        assert!(OrganPreset::ALL.iter().all(|preset| (0.05..0.3).contains(&preset.typical_extent_m())));
        let [liver, gallbladder] = [OrganPreset::Liver, OrganPreset::Gallbladder].map(OrganPreset::typical_extent_m);
        assert!(liver > 2.0 * gallbladder, "a gallbladder lies under the liver");
    }
}
