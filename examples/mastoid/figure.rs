//! Figure 7 of the paper of 2009: one bone, shaded in four ways.

use crate::common::Pictures;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::volume::{SmoothedNormals, VolumeLook, WetShading};

/// The name of each picture, and how it is shaded.
pub const SHADINGS: [(&str, bool, SmoothedNormals); 4] = [
    ("fig7-a", true, SmoothedNormals::None),
    ("fig7-b", true, SmoothedNormals::All),
    ("fig7-c", true, SmoothedNormals::Reflections),
    ("fig7-d", false, SmoothedNormals::None),
];

/// Shades a volume in one of the four ways.
pub fn shade(look: &mut VolumeLook, number: usize) {
    let (_, is_shaded, smoothed) = SHADINGS[number % SHADINGS.len()];
    look.wet = WetShading { is_shaded, smoothed, ..look.wet };
}

pub fn build(app: &mut App) {
    app.insert_resource(Pictures(SHADINGS.map(|(name, ..)| name.to_string()).into()))
        .add_systems(FixedUpdate, shade_next.in_set(SurgerySystems::Sense));
}

/// One way per step.
fn shade_next(mut step: Local<usize>, mut looks: Query<&mut VolumeLook>) {
    for mut look in &mut looks {
        shade(&mut look, *step);
    }
    *step += 1;
}
