//! The scripted run: a cavity drilled under irrigation, a vein that is opened and sealed, always the same.

use crate::drill::{Aim, Drill};
use crate::irrigate::OtherHand;
use bevy::prelude::*;
use bevy_surgery::pool::Bleeder;
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

/// Steps in which the other hand sucks.
const SUCKS: [(u32, u32); 3] = [(240, 270), (470, 560), (600, 640)];
/// The step in which a vein on the way to the skull's inside is opened under the burr, and the one in which it is sealed.
const VEIN: (u32, u32) = (445, 540);

pub fn build(app: &mut App) {
    app.add_systems(FixedUpdate, perform.before(crate::drill::hold).in_set(SurgerySystems::Sense));
}

fn perform(
    mut commands: Commands,
    mut drill: ResMut<Drill>,
    mut hand: ResMut<OtherHand>,
    mut step: Local<u32>,
    microscopes: Query<(&GlobalTransform, &Microscope)>,
    cuts: Query<(Entity, &GlobalTransform), With<CutVolume>>,
) {
    // The clock starts when the bone is there.
    let Some((patient, place)) = cuts.iter().next() else { return };
    let now = *step;
    *step += 1;
    hand.is_sucking = SUCKS.iter().any(|&(from, to)| (from..to).contains(&now));
    hand.seals |= now == VEIN.1;
    if let Some(pose) = drill.pose.filter(|_| now == VEIN.0) {
        let at_m = place.affine().inverse().transform_point3(pose.centre_m);
        let vein = Bleeder { rate_ml_s: 0.15, clotting_s: 120.0, ..default() };
        commands.spawn((vein, Transform::from_translation(at_m), ChildOf(patient)));
    }
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
