//! Deformed volumes: the GPU's picture is the CPU's, and what only moves along stays.

use super::methods::{LEAST_PSNR, psnr};
use super::stage::{Difference, Stage};
use super::twin::check;
use super::{SIZE, specimen, veil, volume_of};
use crate::support::real_file;
use bevy::math::{DVec3, UVec3};
use bevy::prelude::*;
use bevy_surgery::deform::{DeformLattice, NormalDeformation};
use bevy_surgery::volume::load::load_path;
use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::transfer::TransferFunction;
use bevy_surgery::volume::{CtVolume, Volume, VolumeMethod};

/// A lattice over the specimen that a wave goes through, with a patch that is finer than the others.
pub fn wavy(stage: &Stage, level: u32, share: f64) -> DeformLattice {
    let mut lattice = stage.source().grid().lattice(level).expect("a level that can be");
    if level > 0 {
        let number = lattice.tree().patch_at(DVec3::splat(0.4));
        let patch = lattice.tree().patches()[number];
        lattice.subdivide(patch).expect("it is there");
    }
    let wave = |at: DVec3| {
        let turn = at * std::f64::consts::TAU;
        share * DVec3::new((turn.y + 0.5).sin(), (turn.z + turn.x).cos(), (turn.x * 1.5).sin())
    };
    lattice.set_from(wave).expect("finite numbers");
    lattice
}

#[test]
fn a_deformed_volume_gives_the_picture_of_the_cpu() {
    let mut stage = Stage::new(volume_of(SIZE, DVec3::new(0.9, 1.1, 1.0), specimen), veil());
    let volume = stage.volume;
    for (level, share) in [(0, 0.08), (1, 0.05), (3, 0.04)] {
        let lattice = wavy(&stage, level, share);
        stage.set(volume, lattice);
        check(&mut stage, &format!("level {level}, waves of {share}"), 1300);
    }
    for normals in [NormalDeformation::PerPatch, NormalDeformation::Smoothed] {
        let lattice = wavy(&stage, 2, 0.04);
        stage.set(volume, lattice);
        stage.look().deformed_normals = normals;
        check(&mut stage, &format!("normals {normals:?}"), 1300);
    }
    stage.look().deformed_normals = NormalDeformation::Exact;
    // Beyond the box and back to rest.
    let mut lattice = wavy(&stage, 1, 0.0);
    lattice.set_from(|_| DVec3::new(0.3, -0.1, 0.2)).expect("finite numbers");
    stage.set(volume, lattice);
    check(&mut stage, "moved as a whole", 1000);
    let whole = stage.shot();
    stage.app.world_mut().entity_mut(volume).remove::<DeformLattice>();
    check(&mut stage, "without a lattice", 1500);
    assert!(whole != stage.shot());
}

#[test]
fn a_lattice_at_rest_changes_nothing() {
    let mut stage = Stage::new(volume_of(SIZE, DVec3::ONE, specimen), veil());
    for method in [VolumeMethod::Rays, VolumeMethod::Slices] {
        stage.look().method = method;
        let volume = stage.volume;
        stage.app.world_mut().entity_mut(volume).remove::<DeformLattice>();
        stage.shot();
        let (plain, twin) = (stage.shot(), stage.twin());
        let lattice = wavy(&stage, 2, 0.0);
        stage.set(volume, lattice);
        stage.shot();
        let deformed = stage.shot();
        let furthest = plain.colour.iter().zip(&deformed.colour);
        let furthest = furthest.flat_map(|(a, b)| (0..4).map(move |k| (a[k] - b[k]).abs())).fold(0.0, f32::max);
        assert!(furthest < 2e-3, "{method:?}: {furthest}");
        let edge_m = stage.rays(Vec3::ZERO).voxel_edge_m();
        assert!(Difference::between(&deformed, &twin, edge_m).is_small());
    }
}

#[test]
fn only_what_moved_travels_and_is_drawn_anew() {
    for method in [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices] {
        let mut stage = Stage::new(volume_of(UVec3::splat(64), DVec3::splat(0.5), |at| specimen(at * 0.6)), veil());
        stage.look().method = method;
        let volume = stage.volume;
        let lattice = wavy(&stage, 3, 0.01);
        stage.set(volume, lattice);
        stage.shot();
        assert_eq!(stage.redrawn(), [0, 0], "{method:?}: nothing moved");
        let mut lattice = stage.app.world_mut().get_mut::<DeformLattice>(volume).expect("it was inserted");
        let moved: Vec<Vec3> = lattice.translations().iter().map(|by| *by * 1.5).collect();
        lattice.set_translations(&moved).expect("as many as there are");
        let [walked, _] = stage.redrawn();
        assert!(walked > 1000);
        let bytes = stage.uploaded();
        // The lattice's vertices; for slices their corners, for those of patches the numbers of the polygons that show something.
        let most = if method == VolumeMethod::PatchSlices { 131_072 } else { 65_536 };
        assert!((5_000..most).contains(&bytes), "{method:?}: {bytes} bytes");
        // A change that changes nothing.
        stage.app.world_mut().get_mut::<DeformLattice>(volume).expect("it was inserted").set_changed();
        assert_eq!(stage.redrawn(), [0, 0], "{method:?}");
    }
}

#[test]
fn a_cut_shows_where_the_matter_is_shown() {
    let mut stage = Stage::new(volume_of(SIZE, DVec3::ONE, specimen), veil());
    let volume = stage.volume;
    let lattice = wavy(&stage, 2, 0.06);
    stage.set(volume, lattice);
    stage.shot();
    stage.drill(Vec3::new(-0.012, -0.002, 0.012), Vec3::new(-0.004, -0.006, 0.004), 6e-3);
    let [walked, _] = stage.redrawn();
    assert!(walked > 0);
    check(&mut stage, "cut and deformed", 1000);
}

/// Draws a deformed volume in every way, and beside it the same volume warped voxel by voxel in double precision.
fn compare_with_warped(name: &str, volume: Volume, transfer: &TransferFunction) {
    let half = volume.grid().half_axes_m().into_iter().map(|half| half.length_squared()).sum::<f32>().sqrt();
    let mut stage = Stage::new(volume.clone(), transfer.clone());
    let entity = stage.volume;
    // Without light, and with a gentle transfer function: what is interpolated twice is softer than what is interpolated once.
    // Normals are held against their twin above.
    stage.look().wet.is_shaded = false;
    // As large as the others, so that the lamps suit it.
    stage.set(entity, Transform::from_scale(Vec3::splat(0.035 / half)));
    for (level, share) in [(1, 0.03), (2, 0.03), (3, 0.02)] {
        let mut lattice = volume.grid().lattice(level).expect("a level that can be");
        // The box's sides stay where they are, as in the paper: a warped volume ends at its grid.
        let bump = |at: DVec3| (at * std::f64::consts::PI).map(f64::sin).element_product();
        let wave = |at: DVec3| {
            share * bump(at) * DVec3::new((9.0 * at.y).sin(), (8.0 * at.z).cos(), (7.0 * at.x + 1.0).sin()) * 2.0
        };
        lattice.set_from(wave).expect("finite numbers");
        lattice.check_folds().expect("it does not fold");
        let warped = volume.warped(&lattice).expect("a volume of the same grid");
        let handle = stage.app.world_mut().resource_mut::<Assets<Volume>>().add(warped);
        let source = stage.app.world().get::<CtVolume>(entity).expect("a volume").clone();
        for direction in [Vec3::new(0.2, 0.3, 0.9), Vec3::new(-0.7, -0.2, 0.4)] {
            stage.aim(direction.normalize() * 0.12, Vec3::ZERO);
            stage.look().method = VolumeMethod::Rays;
            stage.set(entity, CtVolume(handle.clone()));
            stage.app.world_mut().entity_mut(entity).remove::<DeformLattice>();
            stage.shot();
            let reference = stage.shot();
            stage.set(entity, source.clone());
            stage.set(entity, lattice.clone());
            stage.shot();
            for method in [VolumeMethod::Rays, VolumeMethod::Slices] {
                stage.look().method = method;
                stage.shot();
                let likeness = psnr(&stage.shot(), &reference);
                println!("{name}, level {level}, from {direction}, {method:?}: {likeness:.1} dB");
                assert!(likeness > LEAST_PSNR, "{name}, level {level}, from {direction}, {method:?}: {likeness} dB");
            }
            // What is not deformed is another picture.
            stage.app.world_mut().entity_mut(entity).remove::<DeformLattice>();
            stage.shot();
            let likeness = psnr(&stage.shot(), &reference);
            assert!(likeness < LEAST_PSNR - 5.0, "{name}, level {level}: {likeness} dB without a lattice");
        }
    }
}

#[test]
fn the_phantom_looks_as_if_it_were_warped() {
    let volume = phantom(&PhantomOptions { size: 128, ..default() }).expect("a phantom");
    compare_with_warped("phantom", volume, &veil());
}

#[test]
fn a_head_looks_as_if_it_were_warped() {
    let Some(path) = real_file("ct/head.nii.gz") else { return };
    let (volume, _) = load_path(&path, &default()).expect("a real head loads");
    compare_with_warped("head", volume, &veil());
}

#[test]
fn a_tooth_looks_as_if_it_were_warped() {
    let Some(path) = real_file("ct/tooth.nhdr") else { return };
    let (volume, _) = load_path(&path, &default()).expect("a real tooth loads");
    let transfer = TransferFunction::for_volume(&volume);
    compare_with_warped("tooth", volume, &transfer);
}
