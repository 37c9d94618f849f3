//! Figures of the paper of 2009, of one drilled cavity: where fluid can be (4), the meniscus (5), four ways of shading (7).

use crate::common::Pictures;
use crate::{LAMP, LIGHT_CD, LookAtVolume, Patient};
use bevy::prelude::*;
use bevy_surgery::pool::{Cavity, PoolLook, PoolSurface, WetMask};
use bevy_surgery::prelude::*;
use bevy_surgery::volume::cut::{Burr, BurrPose, BurrStroke};
use bevy_surgery::volume::{CtVolume, CutVolume, PickedVolume, SmoothedNormals, Volume, VolumeLook, WetShading};

/// The name of each picture, and how it is shaded.
pub const SHADINGS: [(&str, bool, SmoothedNormals); 4] = [
    ("fig7-a", true, SmoothedNormals::None),
    ("fig7-b", true, SmoothedNormals::All),
    ("fig7-c", true, SmoothedNormals::Reflections),
    ("fig7-d", false, SmoothedNormals::None),
];

/// Where the bone is drilled, as shares of the volume's half width and height; how wide and how deep, metres.
const AT: Vec2 = Vec2::new(-0.12, 0.05);
const WIDTH_M: f32 = 15e-3;
const DEPTH_M: f32 = 6e-3;
/// Steps of drilling, of a sixtieth of a second, in which the burr goes out and back so many times.
const STEPS: u32 = 900;
const ROUNDS: f32 = 4.0;
/// The step of the microscope's changer.
const MAGNIFICATION: usize = 2;
/// As many passes as a picture of this magnification needs for its normals to be smoothed over more than a voxel.
const PASSES: u32 = 12;

/// Shades a volume in one of the four ways.
pub fn shade(look: &mut VolumeLook, number: usize) {
    let (_, is_shaded, smoothed) = SHADINGS[number % SHADINGS.len()];
    look.wet = WetShading { is_shaded, smoothed, ..look.wet };
}

pub fn build(app: &mut App, number: u32) {
    let pictures: Vec<&str> = match number {
        4 => vec!["fig4-a", "fig4-b"],
        5 => vec!["fig5-a", "fig5-b"],
        _ => SHADINGS.map(|(name, ..)| name).into(),
    };
    app.insert_resource(Pictures(pictures.into_iter().map(String::from).collect()))
        .add_systems(Update, drill_cavity.after(LookAtVolume));
    match number {
        4 => app.add_systems(FixedUpdate, paint_mask.in_set(SurgerySystems::Judge)),
        5 => app.add_systems(FixedUpdate, lay_water.in_set(SurgerySystems::Judge)),
        _ => app.add_systems(FixedUpdate, shade_next.in_set(SurgerySystems::Sense)),
    };
}

/// How far under its rim the cavity is filled, metres.
const UNDER_RIM_M: f32 = 4e-4;

/// Figure 4: (a) where bone lies below the level, wherever that is; (b) the mask.
fn paint_mask(mut step: Local<usize>, mut pools: Query<(&Cavity, &mut PoolSurface, &mut PoolLook)>) {
    for (cavity, mut surface, mut look) in &mut pools {
        let Some(level_m) = cavity.rim_m().map(|rim_m| rim_m - UNDER_RIM_M) else { continue };
        let mask = match *step {
            0 => WetMask::from_fn(cavity.grid(), |cell| cavity.cut_m(cell) < level_m),
            _ => cavity.mask(level_m),
        };
        let mut painted = PoolSurface::calm(*cavity.grid(), level_m, &mask);
        // Opaque and blue: full of a dust of that colour.
        painted.texels.iter_mut().for_each(|texel| texel[2] = texel[3]);
        painted.revision = surface.revision + 1;
        *surface = painted;
        *look = PoolLook {
            dust_colour: Vec3::new(0.02, 0.07, 0.9),
            dust_scattering_per_m: 1e6,
            environment_strength: 0.0,
            meniscus: [0.0; 6],
            ..default()
        };
        *step += 1;
    }
}

/// Figure 5: calm water, without a meniscus (a) and with one (b).
fn lay_water(mut step: Local<usize>, mut pools: Query<(&Cavity, &mut PoolSurface, &mut PoolLook)>) {
    for (cavity, mut surface, mut look) in &mut pools {
        let Some(level_m) = cavity.rim_m().map(|rim_m| rim_m - UNDER_RIM_M) else { continue };
        let mut calm = PoolSurface::calm(*cavity.grid(), level_m, &cavity.mask(level_m));
        calm.revision = surface.revision + 1;
        *surface = calm;
        *look = PoolLook::default();
        if *step == 0 {
            look.meniscus = [0.0; 6];
        }
        *step += 1;
    }
}

/// Drills a cavity at once, without the ECS, and looks at it from near.
fn drill_cavity(
    volumes: Res<Assets<Volume>>,
    mut patients: Query<(&CtVolume, &PickedVolume, &Transform, &mut CutVolume), (With<Patient>, Added<PickedVolume>)>,
    mut microscopes: Query<(&mut Microscope, &mut Transform), Without<Patient>>,
    mut lamps: Query<(&mut MicroscopeLamp, &mut ScopeLight)>,
) {
    let Some((source, PickedVolume(picker), place, mut cut)) = patients.iter_mut().next() else { return };
    let Some(volume) = volumes.get(&source.0) else { return };
    let Some(structures) = volume.structures() else { return };
    let half_m: Vec3 = volume.grid().half_axes_m().iter().map(|half| (place.rotation * *half).abs()).sum();
    let volume_from_world = place.compute_affine().inverse();
    // From in front of the volume, to where it meets what is left of the bone.
    let hit = |at: Vec2, cut: &CutVolume| {
        let from = place.translation + at.extend(2.0 * half_m.z);
        let (from, along) =
            (volume_from_world.transform_point3(from), volume_from_world.transform_vector3(Vec3::NEG_Z));
        picker.pick(from, along, 4.0 * half_m.z, |voxel| cut.remaining(voxel)).map(|hit| hit.position_m)
    };
    let middle = AT * half_m.truncate();
    let Some(surface_m) = hit(middle, &cut) else { return };
    let out = volume_from_world.transform_vector3(Vec3::Z);
    let burr = Burr { diameter_m: 6e-3, ..default() };
    let radius_m = 0.5 * burr.diameter_m;
    let mut from = None;
    for step in 0..STEPS {
        let round = step as f32 / STEPS as f32 * ROUNDS;
        // The root gives every part of the disk the same time.
        let outwards = (1.0 - (2.0 * round.fract() - 1.0).abs()).sqrt();
        let at = middle + Vec2::from_angle(30.0 * round) * (outwards * (0.5 * WIDTH_M - radius_m));
        let Some(bone_m) = hit(at, &cut) else { continue };
        let above_floor_m = (bone_m - surface_m).dot(out) + DEPTH_M;
        let press_m = (0.4 * radius_m).min(above_floor_m);
        let to = BurrPose { centre_m: bone_m + out * (radius_m - press_m), axis: out };
        let stroke = BurrStroke { burr, from: from.unwrap_or(to), to, force_n: 5.0, speed_rpm: 80_000.0 };
        cut.drill(volume, structures, &stroke, 1.0 / 60.0);
        from = Some(to);
    }
    for (mut microscope, mut transform) in &mut microscopes {
        *microscope = Microscope { step: MAGNIFICATION, ..default() };
        let surface_world_m = place.transform_point(surface_m);
        transform.translation = surface_world_m + Vec3::Z * microscope.working_distance_m;
    }
    for (mut lamp, mut light) in &mut lamps {
        (lamp.offset_m, light.intensity_cd) = (LAMP.offset_m, LIGHT_CD);
    }
}

/// One way per step.
fn shade_next(mut step: Local<usize>, mut looks: Query<&mut VolumeLook>) {
    for mut look in &mut looks {
        look.wet.passes = PASSES;
        shade(&mut look, *step);
    }
    *step += 1;
}
