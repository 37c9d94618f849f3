//! The liver and the temporal bone that ship with the crate, one of each: what ready scenes and scenarios are made of.

use crate::highlights::Highlights;
use crate::organ::{LoadOrgan, OrganOptions, OrganSource};
use crate::pool::Pool;
use crate::reactions::Reactions;
use crate::skin::{OrganPreset, Skin};
use crate::volume::phantom::PhantomOptions;
use crate::volume::{MakePhantom, WatchCritical};
use bevy::prelude::*;

/// A liver that bleeds, burns and shines: 22 cm wide, its middle at its origin.
pub(crate) fn liver() -> (LoadOrgan, Skin, Reactions, Highlights) {
    let extent_m = OrganPreset::Liver.typical_extent_m();
    let options = OrganOptions::default().with_largest_extent_m(extent_m).centred();
    // The sharp reflections take the place of most of the soft sheen.
    let skin = Skin { sheen: 0.15, ..Skin::liver() };
    let highlights = Highlights { grain_tilt: 0.02, dry_roughness: 0.016, ..Highlights::default() };
    (LoadOrgan { source: OrganSource::default(), options }, skin, Reactions::default(), highlights)
}

/// From where a liver is looked at: 20 cm in front of it and above.
pub(crate) fn before_liver() -> Transform {
    Transform::from_xyz(0.0, 0.09, 0.18).looking_at(Vec3::ZERO, Vec3::Y)
}

/// The phantom of a temporal bone, whose mastoid faces +Z. Distances to what must not be drilled are known up to 6 mm.
pub(crate) fn mastoid_bone(options: PhantomOptions) -> (MakePhantom, WatchCritical) {
    // The farthest warning, 2 mm from the surface of a burr, is given 5 mm from its middle.
    (MakePhantom(options), WatchCritical { band_mm: 6.0 })
}

/// Where water lies over that bone, level under the microscope.
pub(crate) fn over_mastoid() -> Transform {
    Pool::facing(Vec3::ZERO, Vec3::Z)
}

/// From where that bone is looked at through a microscope that works so far away, metres: in focus between its surface and its middle.
pub(crate) fn before_mastoid(working_distance_m: f32) -> Transform {
    Transform::from_xyz(0.0, 0.0, working_distance_m + 0.012)
}
