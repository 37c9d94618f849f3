//! Figure 7 of the paper of 2001: a sphere at rest, and deformed with the three ways of finding normals.

use crate::Patient;
use crate::common::Pictures;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use std::f64::consts::TAU;

const SIDE: u32 = 128;

/// Names of the pictures, and where their normals come from.
const PICTURES: [(&str, Option<NormalDeformation>); 4] = [
    ("fig7-rest", None),
    ("fig7-patches", Some(NormalDeformation::PerPatch)),
    ("fig7-smoothed", Some(NormalDeformation::Smoothed)),
    ("fig7-exact", Some(NormalDeformation::Exact)),
];

pub fn build(app: &mut App) {
    app.insert_resource(Pictures(PICTURES.iter().map(|(name, _)| name.to_string()).collect()))
        .add_systems(FixedUpdate, next_picture.in_set(SurgerySystems::Deform));
}

/// A solid sphere.
pub fn sphere(volumes: &mut Assets<Volume>) -> Result<impl Bundle> {
    let grid = VolumeGrid::upright(UVec3::splat(SIDE), DVec3::splat(1.0));
    let middle = Vec3::splat(0.5 * (SIDE - 1) as f32);
    let voxels = (0..grid.count() as u32).map(|place| {
        let at = UVec3::new(place % SIDE, place / SIDE % SIDE, place / (SIDE * SIDE)).as_vec3();
        ((0.34 * SIDE as f32 - at.distance(middle)) / 8.0 + 0.5).clamp(0.0, 1.0) * 255.0
    });
    let volume = Volume::new(grid, Voxels::U8(voxels.map(|value| value.round() as u8).collect()), 1.0, 0.0)?;
    let look = VolumeLook {
        wet: WetShading { smoothed: SmoothedNormals::None, shine: 0.6, shine_exponent: 24.0, ..default() },
        ..default()
    };
    let point = |value, opacity| ControlPoint { value, colour: [224, 196, 160], opacity };
    let transfer = TransferFunction {
        points: vec![point(0.0, 0.0), point(100.0, 0.0), point(156.0, 0.9), point(255.0, 0.9)],
        ..TransferFunction::window(0.5, 1.0)
    };
    Ok((CtVolume(volumes.add(volume)), transfer, look))
}

fn next_picture(
    mut step: Local<usize>,
    mut patients: Query<(&mut DeformLattice, &mut VolumeLook), With<Patient>>,
) -> Result {
    let Ok((mut lattice, mut look)) = patients.single_mut() else { return Ok(()) };
    let (_, normals) = PICTURES[(*step).min(PICTURES.len() - 1)];
    *step += 1;
    let Some(normals) = normals else { return Ok(()) };
    look.deformed_normals = normals;
    // As far as it goes without folding.
    let wave = |at: DVec3| {
        let turn = at * TAU;
        DVec3::new(0.10 * turn.y.sin(), 0.10 * (turn.x + 0.7).sin(), 0.05 * (turn.x + turn.y).cos())
    };
    Ok(lattice.set_from(wave)?)
}
