//! The lattice without drawing: what a frame needs at level 3, and the warp of whole volumes.
//!
//! The warp is what `c_deform.py` of our collection of peers times: one volume through one displacement grid, trilinear, on four
//! threads. There numba takes 25 ms at 128^3 and 240 ms at 256^3 in single precision, and SimpleITK and VTK several times as much.

use bevy_surgery::deform::{AffineField, DeformLattice};
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, UVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::hint::black_box;
use std::time::Duration;

/// Vertices of an organ that rides in a lattice.
const POINTS: usize = 4400;

/// A lattice whose inner vertices are moved at random, as in the paper's table 1, as far as it does not fold.
fn random_lattice(level: u32) -> DeformLattice {
    let mut random = Pcg32::seed_from_u64(1);
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, level).expect("a lattice");
    let most = 0.16 / f64::from(1 << level);
    let inner = |place: DVec3| place.min_element() > 0.0 && place.max_element() < 1.0;
    let mut part = || random.random_range(-most..most);
    lattice
        .set_from(|place| if inner(place) { DVec3::new(part(), part(), part()) } else { DVec3::ZERO })
        .expect("numbers");
    lattice
}

fn a_frame(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("deform, level 3");
    let mut lattice = random_lattice(3);
    let translations = lattice.translations().to_vec();
    group.bench_function("set all translations", |b| b.iter(|| lattice.set_translations(black_box(&translations))));
    group.bench_function("look for folds", |b| b.iter(|| black_box(&lattice).check_folds()));
    group.bench_function("begin the inverse", |b| b.iter(|| black_box(&lattice).inverse().is_ok()));
    let mut affine = AffineField::new(&lattice);
    group.bench_function("affine maps", |b| b.iter(|| affine.update(black_box(&lattice))));
    let mut random = Pcg32::seed_from_u64(2);
    let rests: Vec<DVec3> =
        (0..POINTS).map(|_| DVec3::from_array(std::array::from_fn(|_| random.random_range(0.0..1.0)))).collect();
    let inverse = lattice.inverse().expect("no folds");
    group.bench_function("4,400 points back, one thread", |b| {
        b.iter(|| rests.iter().map(|&rest| inverse.shown_from_rest(rest)).sum::<DVec3>());
    });
    group.bench_function("4,400 points back", |b| b.iter(|| inverse.all_shown_from_rest(black_box(&rests))));
    let before = inverse.all_shown_from_rest(&rests);
    let moved: Vec<Vec3> = lattice.translations().iter().map(|translation| *translation * 1.02).collect();
    let mut next = lattice.clone();
    next.set_translations(&moved).expect("numbers");
    let inverse = next.inverse().expect("no folds");
    group.bench_function("4,400 points back from a frame ago, one thread", |b| {
        b.iter(|| {
            rests.iter().zip(&before).map(|(&rest, &was)| inverse.shown_from_rest_near(rest, was)).sum::<DVec3>()
        });
    });
    group.finish();
}

fn fits(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("deform, fit of 800 pairs");
    group.sample_size(10);
    let mut random = Pcg32::seed_from_u64(3);
    let pairs: Vec<(DVec3, DVec3)> = (0..800)
        .map(|_| DVec3::from_array(std::array::from_fn(|_| random.random_range(0.0..1.0))))
        .map(|shown| (shown + 0.03 * DVec3::new((4.0 * shown.y).sin(), (5.0 * shown.z).cos(), 0.0), shown))
        .collect();
    for level in [2, 3] {
        let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, level).expect("a lattice");
        group.bench_function(format!("level {level}"), |b| b.iter(|| lattice.fit_points(&pairs, 1e-6)));
    }
    group.finish();
}

fn warps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("deform, warp");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    for side in [128, 256] {
        let mut random = Pcg32::seed_from_u64(4);
        let grid = VolumeGrid::upright(UVec3::splat(side), DVec3::ONE);
        let voxels = Voxels::U8((0..grid.count()).map(|_| random.random()).collect());
        let volume = Volume::new(grid, voxels, 1.0, 0.0).expect("a volume");
        let lattice = random_lattice(3);
        group.bench_function(format!("{side}^3 of bytes"), |b| b.iter(|| volume.warped(&lattice)));
    }
    group.finish();
}

criterion_group!(benches, a_frame, fits, warps);
criterion_main!(benches);
