//! What instruments do to an organ.

use super::burn::Cautery;
use super::kind::KindId;
use crate::organ::sphere::SurfacePoint;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// What happens at a place of an organ in one step.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub enum ReactionAction {
    /// A drop of blood lies there.
    Bleed {
        /// Its volume, cubic metres (a millilitre is 1e-6).
        volume_m3: f64,
    },
    /// A vessel is opened: it bleeds drop by drop until it clots, or is sealed by a burn.
    Wound(Wound),
    /// An instrument presses; send it in every step while it does.
    Press {
        /// Share of the pressure that drives all blood out, 0 to 1.
        pressure: f32,
        /// Radius of the skin that turns pale under full pressure, metres.
        radius_m: f32,
    },
    /// An electrode is switched on; send it in every step while it is. Between the places of two successive steps the heat
    /// is laid along the way.
    Cauterize(Cautery),
    /// A snake of any kind begins: yours, for instance. Whitening lives by what presses and cauterization by its heat: for
    /// those there are the actions above.
    Start {
        /// Its kind.
        kind: KindId,
        /// Radius of its head, metres; for liquids the volume decides.
        radius_m: f32,
        /// Liquid in it, cubic metres.
        volume_m3: f64,
    },
}

/// An opened vessel: a first drop wells up at once, then it bleeds.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct Wound {
    /// Bleeding at the beginning, cubic metres per second (1 ml/min is 1.7e-8).
    pub rate_m3_per_s: f64,
    /// Time in which the bleeding falls to 1/e as the blood clots, seconds.
    pub clotting_time_s: f32,
    /// Volume at which a drop comes loose, cubic metres.
    pub drop_volume_m3: f64,
}

impl Default for Wound {
    /// The hole of a biopsy needle: 0.25 ml/min at first, drops of 8 microlitres, clotted within a minute.
    fn default() -> Self {
        Self { rate_m3_per_s: 4.2e-9, clotting_time_s: 25.0, drop_volume_m3: 8e-9 }
    }
}

/// Something done to an organ in this step. Write it in [`SurgerySystems::Touch`](crate::schedule::SurgerySystems::Touch)
/// or earlier.
///
/// Lengths and volumes are the organ's own: where its transform scales, they are scaled with it.
///
/// Each organ takes a bounded number in a step ([`Reactions::max_touches_per_step`](super::Reactions)): beyond, the
/// oldest are dropped and counted, and the newest kept (paper of 2002, section 5.4).
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
pub struct OrganTouch {
    /// The organ.
    pub organ: Entity,
    /// Where on its surface.
    pub point: SurfacePoint,
    /// Which instrument does it: successive touches of one are one stroke.
    pub instrument: u32,
    /// What it does.
    pub action: ReactionAction,
}
