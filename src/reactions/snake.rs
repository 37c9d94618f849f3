//! Snakes of sprites: an active head and the fading memory of where it was (paper of 2002, section 5.1).

use super::footprint::Footprint;
use super::kind::{KindId, SpriteLook};
use super::texels::TexelRect;
use crate::organ::sphere::SurfacePoint;
use bevy::reflect::Reflect;
use glam::DVec3;
use std::collections::VecDeque;

/// A disk on the surface.
#[derive(Clone, Debug, Default, Reflect)]
pub struct Sprite {
    /// Where its middle lies; it stays on its face while the organ moves.
    pub point: SurfacePoint,
    /// Radius on the surface, metres.
    pub radius_m: f32,
    /// Time since it was made, seconds.
    pub age_s: f32,
    /// Opacity of its middle, 0 to 1.
    pub opacity: f32,
    /// Liquid that lies in it, cubic metres.
    pub volume_m3: f64,
    /// Whether its liquid was taken by another drop: it only fades out.
    pub is_cancelled: bool,
    /// Radius that it strives for while its cause lasts, metres.
    pub full_radius_m: f32,
    /// Heat that it brings to the surface in this step, joules.
    pub heat_j: f64,
    /// Texels that it covers, where that is known.
    #[reflect(ignore)]
    pub(crate) footprint: Option<Footprint>,
    /// How it was painted last.
    #[reflect(ignore)]
    pub(crate) painted: Option<Painted>,
}

/// What a sprite's texels show: it is painted again only when this changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Painted {
    pub look: SpriteLook,
    pub radius_m: f32,
    /// Which of the kinds that had its id.
    pub version: u32,
}

impl Sprite {
    /// The texels that it covers, boxed: two rectangles over the date line, none before it was first painted.
    pub fn rects(&self) -> &[TexelRect] {
        self.footprint.as_ref().map_or(&[], Footprint::rects)
    }

    /// The same sprite for a trail: not painted yet, without liquid and heat.
    pub fn left_behind(&self) -> Self {
        Self { volume_m3: 0.0, heat_j: 0.0, is_cancelled: false, painted: None, ..self.clone() }
    }
}

/// An effect: its kind, how its head moves, and its sprites.
#[derive(Clone, Debug, Default, Reflect)]
pub struct Snake {
    /// What it is.
    pub kind: KindId,
    /// Number of the snake on its organ; younger snakes have greater ones.
    pub id: u64,
    /// Whether the head still lives: moves, or is kept up by an instrument. A snake without a head only fades.
    pub is_active: bool,
    /// Velocity of the head along the surface, organ space, metres per second.
    pub velocity_m_per_s: DVec3,
    /// Whether the head ran on the trail of another drop in the last step.
    pub is_wet: bool,
    /// The head first, then the trail from young to old.
    #[reflect(ignore)]
    pub sprites: VecDeque<Sprite>,
    /// Liquid shed since the last sprite was left behind, cubic metres.
    pub(crate) shed_m3: f64,
    /// Length of the way since then, metres.
    pub(crate) way_m: f64,
    /// Share of the full cause that acts on the head in this step.
    pub(crate) cause: f32,
    /// Texels of sprites that have gone since the map was last painted.
    #[reflect(ignore)]
    pub(crate) erased: Vec<TexelRect>,
}

impl Snake {
    /// The active spot, if there is one.
    pub fn head(&self) -> Option<&Sprite> {
        self.sprites.front().filter(|_| self.is_active)
    }

    /// Liquid in the head, the trail, and what the head has shed since the trail's youngest sprite, cubic metres.
    pub fn volume_m3(&self) -> f64 {
        self.shed_m3 + self.sprites.iter().map(|sprite| sprite.volume_m3).sum::<f64>()
    }
}
