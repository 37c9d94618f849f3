//! The scripted run: a cavity, always the same.

use crate::drill::{Aim, Drill};
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::volume::CutVolume;
use bevy_surgery::volume::cut::{Burr, BurrKind};

/// What is drilled from one step to another: a disk, over which the burr winds outwards and back. Lengths are shares of half
/// the picture's height, from its middle.
struct Act {
    steps: (u32, u32),
    kind: BurrKind,
    diameter_m: f32,
    force_n: f32,
    middle: Vec2,
    radius: f32,
    windings: f32,
}

/// A wide saucer through the cortex, the cells beneath it, deeper towards the ear canal, then the walls with diamond grit.
const ACTS: [Act; 4] = [
    cutting((15, 290), 6e-3, 5.0, Vec2::new(-0.02, 0.02), 0.25, 9.0),
    cutting((290, 420), 6e-3, 5.0, Vec2::new(0.0, 0.03), 0.2, 5.0),
    cutting((430, 560), 4e-3, 4.0, Vec2::new(0.04, 0.05), 0.2, 5.0),
    Act { kind: BurrKind::Diamond, ..cutting((570, 625), 3e-3, 2.0, Vec2::new(0.06, 0.05), 0.2, 2.0) },
];

const fn cutting(steps: (u32, u32), diameter_m: f32, force_n: f32, middle: Vec2, radius: f32, windings: f32) -> Act {
    Act { steps, kind: BurrKind::Cutting, diameter_m, force_n, middle, radius, windings }
}

const SPEED_RPM: f32 = 80_000.0;

pub fn build(app: &mut App) {
    app.add_systems(FixedUpdate, perform.in_set(SurgerySystems::Sense));
}

fn perform(
    mut drill: ResMut<Drill>,
    mut step: Local<u32>,
    microscopes: Query<(&GlobalTransform, &Microscope)>,
    cuts: Query<(), With<CutVolume>>,
) {
    // The clock starts when the bone is there.
    if cuts.is_empty() {
        return;
    }
    let now = *step;
    *step += 1;
    (drill.aim, drill.is_on) = (None, false);
    let Some((eye, microscope)) = microscopes.iter().next() else { return };
    let Some(act) = ACTS.iter().find(|act| (act.steps.0..act.steps.1).contains(&now)) else { return };
    drill.burr = Burr { kind: act.kind, diameter_m: act.diameter_m, ..default() };
    (drill.force_n, drill.speed_rpm) = (act.force_n, SPEED_RPM);
    let share = (now - act.steps.0) as f32 / (act.steps.1 - act.steps.0) as f32;
    // Out and back, with even spacing between windings: the root gives every part of the disk the same time.
    let outwards = 1.0 - (2.0 * share - 1.0).abs();
    let turn = Vec2::from_angle(std::f32::consts::TAU * act.windings * share);
    let at = act.middle + turn * act.radius * outwards.sqrt();
    let extent = (0.5 * microscope.field_of_view_rad()).tan();
    let direction = eye.affine().transform_vector3(Vec3::new(at.x * extent, at.y * extent, -1.0));
    let Ok(direction) = Dir3::new(direction) else { return };
    drill.aim = Some(Aim::of_right_hand(eye, Ray3d::new(eye.translation(), direction)));
    drill.is_on = true;
}
