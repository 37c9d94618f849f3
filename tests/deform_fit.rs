//! Lattices from pairs of places, as registration needs them.

use crate::deform_support::{random_place, random_tree};
use crate::support::real_file;
use bevy::math::{DMat3, DVec3, Vec3};
use bevy_surgery::deform::{DeformLattice, LatticeError};
use bevy_surgery::volume::Volume;
use bevy_surgery::volume::load::{VolumeLoadOptions, load_path};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

fn inside(random: &mut Pcg32) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| random.random_range(0.0..1.0)))
}

/// A smooth deformation: bending, and a bulge in the middle.
fn known(p: DVec3) -> DVec3 {
    let bulge = (-8.0 * p.distance_squared(DVec3::splat(0.5))).exp();
    DVec3::new(0.03 * (4.0 * p.y).sin(), 0.02 * (5.0 * p.z + p.x).cos(), 0.0) + 0.05 * bulge * (p - 0.5)
}

/// Pairs of a field at random places, with normally distributed noise.
fn pairs(field: impl Fn(DVec3) -> DVec3, count: usize, noise: DVec3, seed: u64) -> Vec<(DVec3, DVec3)> {
    let mut random = Pcg32::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            let shown = inside(&mut random);
            let mut normal = || (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            let noise = noise * DVec3::new(normal(), normal(), normal());
            (shown + field(shown) + noise, shown)
        })
        .collect()
}

#[test]
fn a_field_of_a_lattice_is_found_again() {
    for seed in 0..6 {
        let mut truth = random_tree(seed, 3, seed as u32);
        truth.set_from(known).expect("numbers");
        let mut found = truth.clone();
        found.reset();
        let report =
            found.fit_points(&pairs(|p| truth.translation_at(p), 20_000, DVec3::ZERO, seed), 1e-10).expect("a fit");
        assert!(report.rms < 1e-5 && report.worst < 1e-3 && report.steps > 3, "{report:?}");
        let mut random = Pcg32::seed_from_u64(seed);
        for _ in 0..500 {
            let place = inside(&mut random);
            let error = found.translation_at(place).distance(truth.translation_at(place));
            assert!(error < 1e-3, "tree {seed}: {error} at {place}");
        }
    }
}

#[test]
fn affine_fields_go_on_where_no_pair_is() {
    let turned = DMat3::from_rotation_z(0.1) * DMat3::from_diagonal(DVec3::new(1.05, 0.98, 1.0));
    let affine = |p: DVec3| turned * (p - 0.5) + 0.5 - p + DVec3::new(0.02, 0.0, -0.03);
    let mut random = Pcg32::seed_from_u64(4);
    // All in one corner.
    let pairs: Vec<_> =
        (0..50).map(|_| inside(&mut random) * 0.4).map(|shown| (shown + affine(shown), shown)).collect();
    let mut lattice = random_tree(2, 3, 4);
    let report = lattice.fit_points(&pairs, 1e-4).expect("a fit");
    let worst = (0..200)
        .map(|_| inside(&mut random))
        .map(|p| lattice.translation_at(p).distance(affine(p)))
        .fold(0.0, f64::max);
    println!("{report:?}, {worst:.4} at worst in all of the box");
    assert!(report.worst < 1e-3 && worst < 0.02, "{report:?}, {worst}");
}

#[test]
fn one_pair_moves_everything_and_contradictions_meet_in_the_middle() {
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 2).expect("a lattice");
    let by = DVec3::new(0.1, 0.0, -0.05);
    let report = lattice.fit_points(&[(DVec3::splat(0.5) + by, DVec3::splat(0.5))], 1e-3).expect("a fit");
    assert!(report.worst < 1e-6, "{report:?}");
    assert!(lattice.translations().iter().all(|translation| translation.as_dvec3().distance(by) < 1e-5));
    let at = DVec3::splat(0.3);
    lattice.fit_points(&[(at + by, at), (at - 3.0 * by, at)], 1e-3).expect("a fit");
    assert!(lattice.translation_at(at).distance(-by) < 1e-6);
    // Places beyond the box count at its side.
    let beyond = DVec3::new(1.4, 0.5, 0.5);
    lattice.fit_points(&[(beyond + by, beyond)], 1e-3).expect("a fit");
    assert!(lattice.rest_from_shown(beyond).distance(beyond + by) < 1e-6);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let mut lattice = random_tree(1, 3, 4);
    lattice.set_from(known).expect("numbers");
    let before = lattice.clone();
    let good = (DVec3::splat(0.4), DVec3::splat(0.5));
    assert_eq!(lattice.fit_points(&[], 1e-3), Err(LatticeError::NoPairs));
    for place in [DVec3::NAN, DVec3::X * f64::INFINITY] {
        for bad in [(place, DVec3::ZERO), (DVec3::ZERO, place)] {
            assert!(matches!(lattice.fit_points(&[good, bad], 1e-3), Err(LatticeError::NoPlace { .. })));
        }
    }
    for smoothness in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(lattice.fit_points(&[good], smoothness), Err(LatticeError::NotSmooth { .. })));
    }
    // Finite, and more than a translation can hold.
    assert!(lattice.fit_points(&[(DVec3::splat(1e300), DVec3::ZERO)], 1e-3).is_err());
    assert_eq!(lattice, before);
}

fn psnr_db(a: &Volume, b: &Volume) -> f64 {
    let count = a.grid().count();
    let square = |index: usize| (a.value(index) - b.value(index)).powi(2);
    let mean = (0..count).map(square).sum::<f64>() / count as f64;
    let [least, greatest] = a.range();
    10.0 * ((greatest - least).powi(2) / mean).log10()
}

#[test]
fn a_known_warp_of_a_real_head_is_recovered() {
    let Some(path) = real_file("ct/head.nii.gz") else { return };
    let (head, _) = load_path(path, &VolumeLoadOptions::default()).expect("a real volume loads");
    let size = head.grid().size.as_dvec3();
    let mut truth = head.grid().lattice(5).expect("a lattice");
    truth.set_from(known).expect("numbers");
    let mut random = Pcg32::seed_from_u64(8);
    // Landmarks that are found to half a voxel.
    for (noise_voxels, count, smoothness) in [(0.0, 800, 1e-6), (0.5, 800, 1e-5)] {
        let mut found = head.grid().lattice(3).expect("a lattice");
        let report = found.fit_points(&pairs(known, count, noise_voxels / size, 3), smoothness).expect("a fit");
        let errors: Vec<f64> = (0..4000)
            .map(|_| random_place(&mut random).clamp(DVec3::splat(0.05), DVec3::splat(0.95)))
            .map(|place| ((found.translation_at(place) - known(place)) * size).length())
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let worst = errors.iter().copied().fold(0.0, f64::max);
        let (warped, wanted) = (head.warped(&found).expect("a volume"), head.warped(&truth).expect("a volume"));
        let (psnr, before) = (psnr_db(&wanted, &warped), psnr_db(&wanted, &head));
        println!(
            "{count} pairs with {noise_voxels} voxels of noise: {mean:.2} voxels off in the mean, {worst:.2} at worst, {psnr:.1} dB \
             ({before:.1} dB before), {report:?}"
        );
        assert!(mean < 0.1 + 0.8 * noise_voxels && worst < 0.5 + 2.0 * noise_voxels, "{mean} {worst}");
        assert!(psnr > 40.0 && psnr > before + 15.0, "{psnr} dB, {before} dB before");
    }
}
