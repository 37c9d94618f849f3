//! The component that lets an organ react.

use super::burn::BurnRamp;
use super::heat::HeatSettings;
use bevy::prelude::*;

/// Lets an [`Organ`](crate::organ::Organ) bleed, turn pale and burn.
///
/// [`ReactionModel`](super::ReactionModel) is added beside it once the organ is loaded; instruments act on it with
/// [`OrganTouch`](super::OrganTouch). Changing the map's width begins a new model.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct Reactions {
    /// Texels per row of the reaction map, 64 to 8192 in steps of 64; it is half as high. What a texel measures on the
    /// organ says [`ReactionModel::texel_size`](super::ReactionModel::texel_size).
    pub map_width_px: u32,
    /// Most sprites at a time, 1 to 100,000: beyond, the oldest go.
    pub max_sprites: u32,
    /// Most touches that are taken in a step; of more, the newest.
    pub max_touches_per_step: u32,
    /// How heat spreads and cools.
    pub heat: HeatSettings,
    /// Which colours burns have.
    pub burns: BurnRamp,
}

impl Default for Reactions {
    fn default() -> Self {
        Self {
            map_width_px: 1024,
            max_sprites: 8192,
            max_touches_per_step: 32,
            heat: HeatSettings::default(),
            burns: BurnRamp::default(),
        }
    }
}

/// What went wrong on an organ. Each is told once; an exchanged model at each exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect)]
pub enum ReactionFault {
    /// A touch at a face that the organ does not have, or at no numbers.
    BadPlace,
    /// A radius, volume, rate or power that is not a positive number or larger than the organ: left out, or made smaller.
    BadSize,
    /// A snake of a kind that nobody registered: left out.
    UnknownKind,
    /// More sprites, wounds or touches than allowed: the oldest went.
    TooMany,
    /// Vertices that are no numbers: what moved there is gone.
    BrokenSurface,
    /// The organ's model was exchanged: what lay on it is gone.
    ModelExchanged,
}

impl ReactionFault {
    /// What to tell a user.
    pub fn message(self) -> &'static str {
        match self {
            Self::BadPlace => {
                "a touch names a face that the organ does not have, or a place of no numbers; it is left out"
            }
            Self::BadSize => {
                "a radius, volume, rate, pressure or power is not a positive number, or too large for an organ; it is left out \
                 or made smaller"
            }
            Self::UnknownKind => "a snake is of a kind that is not registered; it is left out",
            Self::TooMany => "there are more sprites, wounds or touches than `Reactions` allows; the oldest go",
            Self::BrokenSurface => "a drop lies where the organ's vertices are no numbers; it is gone",
            Self::ModelExchanged => {
                "the organ's model or the size of its map changed; blood and burns of the old one are gone"
            }
        }
    }
}
