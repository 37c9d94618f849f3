//! Deformed volumes: the GPU's picture is the CPU's, and what only moves along stays.

use super::stage::{Difference, Stage};
use super::twin::check;
use super::{SIZE, specimen, veil, volume_of};
use bevy::math::{DVec3, UVec3};
use bevy::prelude::*;
use bevy_surgery::deform::{DeformLattice, NormalDeformation};
use bevy_surgery::volume::VolumeMethod;

/// A lattice over the specimen that a wave goes through, with a patch that is finer than the others.
pub fn wavy(stage: &Stage, level: u32, share: f64) -> DeformLattice {
    let mut lattice = DeformLattice::over_volume(stage.source().grid(), level).expect("a level that can be");
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
    let mut stage = Stage::new(volume_of(UVec3::splat(64), DVec3::splat(0.5), |at| specimen(at * 0.6)), veil());
    let volume = stage.volume;
    let lattice = wavy(&stage, 3, 0.01);
    stage.set(volume, lattice);
    stage.shot();
    assert_eq!(stage.redrawn(), [0, 0], "nothing moved");
    let mut lattice = stage.app.world_mut().get_mut::<DeformLattice>(volume).expect("it was inserted");
    let moved: Vec<Vec3> = lattice.translations().iter().map(|by| *by * 1.5).collect();
    lattice.set_translations(&moved).expect("as many as there are");
    let [walked, _] = stage.redrawn();
    assert!(walked > 1000);
    let bytes = stage.uploaded();
    assert!((5_000..65_536).contains(&bytes), "{bytes} bytes");
    // A change that changes nothing.
    stage.app.world_mut().get_mut::<DeformLattice>(volume).expect("it was inserted").set_changed();
    assert_eq!(stage.redrawn(), [0, 0]);
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
