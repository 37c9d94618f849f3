//! How near every way of drawing comes to the volume warped voxel by voxel in double precision, drawn by rays on the CPU.

use super::methods::{LEAST_PSNR, psnr};
use super::points;
use super::stage::{Shot, Stage};
use crate::support::real_file;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::volume::load::load_path;
use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::transfer::TransferFunction;
use bevy_surgery::volume::{CtVolume, Volume, VolumeMethod};

const ALL: [VolumeMethod; 3] = [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices];

/// Opacity that rises over most of the values: what is interpolated twice is softer than what is interpolated once, and a steep
/// function would show that instead of the way of drawing.
fn gentle() -> TransferFunction {
    points(&[(0.05, [40, 60, 220], 0.0), (0.5, [220, 120, 60], 0.04), (0.95, [250, 220, 190], 0.15)])
}

/// A wave that leaves the box's sides where they are, as in the paper: a warped volume ends at its grid.
fn wave(volume: &Volume, level: u32, share: f64) -> DeformLattice {
    let mut lattice = volume.grid().lattice(level).expect("a level that can be");
    if level > 1 {
        let number = lattice.tree().patch_at(DVec3::splat(0.4));
        let patch = lattice.tree().patches()[number];
        lattice.subdivide(patch).expect("it is there");
    }
    let bump = |at: DVec3| (at * std::f64::consts::PI).map(f64::sin).element_product();
    let turn = |at: DVec3| DVec3::new((9.0 * at.y).sin(), (8.0 * at.z).cos(), (7.0 * at.x + 1.0).sin());
    lattice.set_from(|at| 2.0 * share * bump(at) * turn(at)).expect("finite numbers");
    lattice.check_folds().expect("it does not fold");
    lattice
}

/// A volume as large as the others, so that the lamps suit it.
fn stage_of(volume: &Volume, transfer: &TransferFunction, is_lit: bool) -> Stage {
    let half = volume.grid().half_axes_m().into_iter().map(|half| half.length_squared()).sum::<f32>().sqrt();
    let mut stage = Stage::new(volume.clone(), transfer.clone());
    let entity = stage.volume;
    stage.look().wet.is_shaded = is_lit;
    stage.set(entity, Transform::from_scale(Vec3::splat(0.035 / half)));
    stage.app.warm_up();
    stage
}

/// What the CPU draws.
fn twin(stage: &Stage) -> Shot {
    Shot { colour: stage.twin().colour, depth_m: Vec::new() }
}

const DIRECTIONS: [Vec3; 3] = [Vec3::new(0.2, 0.3, 0.9), Vec3::new(-0.7, -0.2, 0.4), Vec3::new(0.6, 0.7, -0.5)];

/// All ways without light.
fn compare_unlit(name: &str, volume: &Volume) {
    let mut stage = stage_of(volume, &gentle(), false);
    let entity = stage.volume;
    let source = stage.app.world().get::<CtVolume>(entity).expect("a volume").clone();
    for (level, share) in [(1, 0.03), (2, 0.03), (3, 0.02)] {
        let lattice = wave(volume, level, share);
        let warped = volume.warped(&lattice).expect("a volume of the same grid");
        let warped = stage.app.world_mut().resource_mut::<Assets<Volume>>().add(warped);
        for direction in DIRECTIONS {
            stage.aim(direction.normalize() * 0.12, Vec3::ZERO);
            stage.look().method = VolumeMethod::Rays;
            stage.set(entity, CtVolume(warped.clone()));
            stage.app.world_mut().entity_mut(entity).remove::<DeformLattice>();
            stage.app.warm_up();
            let reference = twin(&stage);
            stage.set(entity, source.clone());
            stage.app.warm_up();
            let at_rest = psnr(&twin(&stage), &reference);
            stage.set(entity, lattice.clone());
            stage.app.warm_up();
            let mut ways = vec![("rays on the CPU".to_string(), twin(&stage))];
            for method in ALL {
                stage.look().method = method;
                ways.push((format!("{method:?}"), stage.shot()));
            }
            for (way, shot) in ways {
                let likeness = psnr(&shot, &reference);
                println!("{name}, level {level}, from {direction}, {way}: {likeness:.1} dB, at rest {at_rest:.1} dB");
                assert!(likeness > LEAST_PSNR, "{name}, level {level}, from {direction}, {way}: {likeness} dB");
                assert!(at_rest < likeness - 3.0, "{name}: without a lattice it would be {at_rest} dB");
            }
        }
    }
}

#[test]
fn all_ways_show_the_warped_phantom() {
    compare_unlit("phantom", &phantom(&PhantomOptions { size: 96, ..default() }).expect("a phantom"));
}

#[test]
fn all_ways_show_the_warped_head() {
    let Some(path) = real_file("ct/head.nii.gz") else { return };
    let (volume, _) = load_path(&path, &default()).expect("a real head loads");
    compare_unlit("head", &volume);
}

/// Lit surfaces under a steep transfer function. Rays and slices take their samples at different depths, those of aligned slices
/// farther apart where they are met askew, and a sample more or less under the surface is another normal. Rays with whole steps are as
/// far from rays with short ones as slices are, and shorter steps bring all of them together: no way of drawing is wrong by itself.
/// What is left at the shortest steps are single pixels whose gradients cancel, so that rounding chooses the normal.
fn compare_steps(name: &str, volume: &Volume, transfer: &TransferFunction) {
    let mut stage = stage_of(volume, transfer, true);
    let entity = stage.volume;
    let lattice = wave(volume, 2, 0.03);
    stage.set(entity, lattice);
    for direction in DIRECTIONS {
        stage.aim(direction.normalize() * 0.12, Vec3::ZERO);
        stage.look().method = VolumeMethod::Rays;
        stage.look().step_voxels = 0.25;
        let finest = stage.shot();
        let mut likeness = [[0.0; 3]; 3];
        for (row, step_voxels) in [1.0, 0.5, 0.25].into_iter().enumerate() {
            stage.look().step_voxels = step_voxels;
            for (column, method) in ALL.into_iter().enumerate() {
                stage.look().method = method;
                likeness[row][column] = psnr(&stage.shot(), &finest);
            }
            println!("{name} from {direction}, steps of {step_voxels}: {:.1?} dB from the finest rays", likeness[row]);
        }
        let [whole, half, quarter] = likeness;
        let what = format!("{name} from {direction}: {likeness:.1?} dB");
        assert!(whole[2] > whole[0] - 4.0, "{what}: aligned slices are farther off than their samples are apart");
        // The finest rays are no end either: on thin walls askew half steps bring little more than 2 dB.
        assert!((0..3).all(|way| half[way] > whole[way] + 2.0), "{what}: half steps");
        assert!((1..3).all(|way| quarter[way] > whole[way] + 5.0), "{what}: quarter steps");
    }
}

#[test]
fn shorter_steps_bring_lit_slices_and_rays_together() {
    let volume = phantom(&PhantomOptions { size: 96, ..default() }).expect("a phantom");
    compare_steps("phantom", &volume, &TransferFunction::bone());
}

#[test]
fn shorter_steps_bring_a_lit_head_together() {
    let Some(path) = real_file("ct/head.nii.gz") else { return };
    let (volume, _) = load_path(&path, &default()).expect("a real head loads");
    let transfer = TransferFunction::for_volume(&volume);
    compare_steps("head", &volume, &transfer);
}
