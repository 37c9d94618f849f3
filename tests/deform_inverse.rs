//! Folds and the way back through a lattice.

use crate::deform_support::{gently_moved, moved, random_place, random_tree};
use bevy::math::{Affine3A, DVec3, Quat, UVec3, Vec3};
use bevy_surgery::deform::{DeformLattice, LatticeError};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

fn uniform(level: u32) -> DeformLattice {
    DeformLattice::new(Vec3::ZERO, Vec3::ONE, level).expect("a lattice")
}

/// Least determinant at many places, also beyond the box, and a patch of it.
fn sampled(lattice: &DeformLattice, per_side: u32) -> f64 {
    let mut least = f64::INFINITY;
    for patch in lattice.tree().patches() {
        for n in 0..per_side.pow(3) {
            let cell = UVec3::new(n % per_side, n / per_side % per_side, n / per_side.pow(2)).as_dvec3();
            // Just inside, so that the place is of this patch; and out of the box where the patch is at its side.
            let share = 1e-9 + cell / f64::from(per_side - 1) * (1.0 - 2e-9);
            let place = patch.low() + share * patch.side();
            least = least.min(lattice.jacobian_at(place).determinant());
            for away in 1..8 {
                let is_away = |axis: usize| away >> axis & 1 == 1;
                let end = |axis: usize| if place[axis] < 1e-6 { -0.1 } else { 0.1 };
                let beyond = DVec3::from_array(std::array::from_fn(|axis| {
                    place[axis] + if is_away(axis) { end(axis) } else { 0.0 }
                }));
                let all_on_side = (0..3).all(|axis| !is_away(axis) || beyond[axis] < 0.0 || beyond[axis] > 1.0);
                if all_on_side && (0..3).all(|axis| !is_away(axis) || place[axis] < 1e-6 || place[axis] > 1.0 - 1e-6) {
                    least = least.min(lattice.jacobian_at(beyond).determinant());
                }
            }
        }
    }
    least
}

#[test]
fn folds_are_found_where_dense_sampling_finds_them() {
    let (mut folded, mut fine, mut hard) = (0, 0, 0);
    for seed in 0..400 {
        let tree = random_tree(seed, 3, seed as u32 % 4);
        let side = 1.0 / f64::from(1 << tree.tree().deepest());
        let most = [0.2, 0.3, 0.4, 0.5, 0.6][seed as usize % 5] * side;
        let lattice = moved(tree, seed, most);
        let least = sampled(&lattice, 9);
        match lattice.check_folds() {
            Ok(()) => {
                assert!(least > 0.0, "field {seed} has a determinant of {least} somewhere");
                fine += 1;
                hard += usize::from(least < 0.1);
            }
            Err(LatticeError::Folded { patch, determinant }) => {
                folded += 1;
                assert!(lattice.tree().number_of(patch).is_some());
                assert!(determinant <= 1e-6 && determinant <= least + 0.011, "{determinant} and {least}");
                // It is not far below what samples find either.
                assert!(least < 0.1, "field {seed}: {determinant} was found, samples have {least}");
            }
            other => panic!("{other:?}"),
        }
    }
    println!("{folded} folded, {fine} not, {hard} of these nearly");
    assert!(folded > 50 && fine > 50 && hard > 5);
}

#[test]
fn a_folded_patch_is_named() {
    let mut lattice = uniform(2);
    let vertex = lattice.tree().nearest_vertex(DVec3::splat(0.5));
    // Its neighbour's matter and beyond.
    lattice.set_translation(vertex, Vec3::new(0.3, 0.0, 0.0)).expect("free");
    let Err(LatticeError::Folded { patch, determinant }) = lattice.check_folds() else { panic!("it folds") };
    assert!((determinant + 0.2).abs() < 1e-6, "1 - 0.3 / 0.25 is {determinant}");
    assert_eq!((patch.level, patch.cell.x), (2, 2));
    let message = lattice.inverse().expect_err("no way back").to_string();
    assert!(message.contains("folds") && message.contains("-0.200"), "{message}");
    let at_rest = uniform(2);
    assert_eq!(at_rest.check_folds(), Ok(()));
}

#[test]
fn a_patch_may_be_squeezed_but_not_to_nothing() {
    // The slope along x is 1 + step / 0.5 on one side.
    for (step, folds) in [(0.4999, false), (0.49999, false), (0.5, true), (0.50001, true)] {
        let mut lattice = uniform(1);
        lattice.set_from(|place| DVec3::X * if place.x == 0.5 { step } else { 0.0 }).expect("numbers");
        assert_eq!(lattice.check_folds().is_err(), folds, "a step of {step}");
    }
    // All eight corners are fine, and it folds inside: the top is turned by 120 degrees against the bottom.
    let mut lattice = uniform(0);
    let turn = |angle: f64| {
        move |p: DVec3| {
            let (sin, cos) = (angle * (p.z - 0.5)).sin_cos();
            let (x, y) = (p.x - 0.5, p.y - 0.5);
            DVec3::new(x * cos - y * sin - x, x * sin + y * cos - y, 0.0)
        }
    };
    lattice.set_from(turn(100_f64.to_radians())).expect("numbers");
    let at_corners = |lattice: &DeformLattice| {
        let corner = |n: u32| {
            UVec3::new(n & 1, n >> 1 & 1, n >> 2).as_dvec3().clamp(DVec3::splat(1e-9), DVec3::splat(1.0 - 1e-9))
        };
        (0..8).map(|n| lattice.jacobian_at(corner(n)).determinant()).fold(f64::INFINITY, f64::min)
    };
    assert!(at_corners(&lattice) > 0.2);
    assert_eq!(lattice.check_folds(), Ok(()), "turned by 100 degrees");
    lattice.set_from(turn(std::f64::consts::PI)).expect("numbers");
    assert!(matches!(lattice.check_folds(), Err(LatticeError::Folded { determinant, .. }) if determinant.abs() < 1e-6));
}

#[test]
fn folds_beyond_the_box_count_too() {
    let mut lattice = uniform(1);
    lattice
        .set_from(|place| if place == DVec3::new(0.5, 0.5, 1.0) { DVec3::new(0.6, 0.0, 0.0) } else { DVec3::ZERO })
        .expect("numbers");
    assert!(lattice.check_folds().is_err());
    assert!(sampled(&lattice, 5) < 0.0);
    // The whole box turned by half a turn about y: no fold inside, but the space beyond does not turn with it.
    let mut lattice = uniform(0);
    lattice.set_from(|p| DVec3::new(1.0 - 2.0 * p.x, 0.0, 1.0 - 2.0 * p.z)).expect("numbers");
    let inside = lattice.jacobian_at(DVec3::splat(0.5)).determinant();
    let beyond = lattice.jacobian_at(DVec3::new(0.5, 0.5, 1.5)).determinant();
    assert!(inside > 0.0 && beyond < 0.0, "{inside} inside, {beyond} beyond");
    assert!(matches!(lattice.check_folds(), Err(LatticeError::Folded { .. })));
}

#[test]
fn there_and_back_is_where_it_began() {
    let mut worst = 0.0_f64;
    for seed in 0..300 {
        let tree = random_tree(seed, 5, seed as u32 % 9);
        let lattice = if seed % 2 == 0 { gently_moved(tree, seed, 0.55) } else { smoothly_moved(tree, seed) };
        let Ok(inverse) = lattice.inverse() else { continue };
        let mut random = Pcg32::seed_from_u64(seed);
        let mut places: Vec<DVec3> = (0..200).map(|_| random_place(&mut random)).collect();
        // Corners, edges, faces and middles of patches, shown and at rest.
        for patch in lattice.tree().patches().iter().take(20) {
            places.extend((0..27).map(|n| {
                patch.low() + DVec3::new(f64::from(n % 3), f64::from(n / 3 % 3), f64::from(n / 9)) * 0.5 * patch.side()
            }));
        }
        places.extend([DVec3::splat(-7.0), DVec3::new(0.5, 90.0, 0.1), DVec3::new(1e6, 0.0, -1e6)]);
        for place in places {
            let reach = place.abs().max_element().max(1.0);
            let shown = inverse.shown_from_rest(place);
            let error = lattice.rest_from_shown(shown).distance(place) / reach;
            assert!(error < 1e-10, "tree {seed}: {place} comes back {error} away");
            let back = inverse.shown_from_rest(lattice.rest_from_shown(place)).distance(place) / reach;
            assert!(back < 1e-10, "tree {seed}: {place} goes and comes back {back} away");
            worst = worst.max(error).max(back);
        }
    }
    println!("worst: {worst}");
    assert!(worst < 1e-11);
}

/// A smooth field of some tenths of the box.
fn smoothly_moved(mut lattice: DeformLattice, seed: u64) -> DeformLattice {
    let mut random = Pcg32::seed_from_u64(seed);
    let waves: Vec<(DVec3, DVec3)> = (0..3)
        .map(|_| {
            let mut part = |most: f64| DVec3::from_array(std::array::from_fn(|_| random.random_range(-most..most)));
            (part(4.0), part(0.06))
        })
        .collect();
    lattice.set_from(|p| waves.iter().map(|(wave, by)| *by * (wave.dot(p)).sin()).sum()).expect("numbers");
    lattice
}

#[test]
fn hardly_unfolded_fields_are_undone_too() {
    let mut random = Pcg32::seed_from_u64(3);
    let mut tried = 0;
    for seed in 0..400 {
        let tree = random_tree(seed, 3, seed as u32 % 3);
        let side = 1.0 / f64::from(1 << tree.tree().deepest());
        let lattice = moved(tree, seed, 0.42 * side);
        let Ok(inverse) = lattice.inverse() else { continue };
        tried += 1;
        for _ in 0..300 {
            let place = random_place(&mut random);
            let back = inverse.shown_from_rest(lattice.rest_from_shown(place));
            assert!(back.distance(place) < 1e-9, "tree {seed}: {place} comes back as {back}");
            // Also from a guess that is no help.
            let rest = lattice.rest_from_shown(place);
            let back = inverse.shown_from_rest_near(rest, DVec3::new(5.0, -3.0, 0.5));
            assert!(back.distance(place) < 1e-9, "tree {seed}: {place} comes back as {back} from far away");
        }
    }
    assert!(tried > 30, "{tried}");
}

#[test]
fn the_approximate_inverse_errs_with_the_square() {
    // Equation 4: a tenth of the magnitude, a hundredth of the error.
    let mut shape = uniform(2);
    shape.set_from(|p| DVec3::new((5.0 * p.y).sin(), (4.0 * p.z + p.x).sin(), (6.0 * p.x).cos())).expect("numbers");
    let error = |magnitude: f32| {
        let mut lattice = uniform(2);
        let translations: Vec<Vec3> = shape.translations().iter().map(|t| *t * magnitude).collect();
        lattice.set_translations(&translations).expect("numbers");
        let mut random = Pcg32::seed_from_u64(9);
        let places = (0..2000).map(|_| random_place(&mut random).clamp(DVec3::ZERO, DVec3::ONE));
        places.map(|x| lattice.approximate_shown_from_rest(lattice.rest_from_shown(x)).distance(x)).fold(0.0, f64::max)
    };
    let points: Vec<(f64, f64)> =
        (0..6).map(|n| 0.03 * 0.5_f64.powi(n)).map(|size| (size.ln(), error(size as f32).ln())).collect();
    let mean = |pick: fn(&(f64, f64)) -> f64| points.iter().map(pick).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
    println!("the error grows with the magnitude to the power of {slope:.3}");
    assert!((slope - 2.0).abs() < 0.05, "{slope}");
    // The exact one has no such error.
    let mut lattice = uniform(2);
    lattice.set_translations(&shape.translations().iter().map(|t| *t * 0.03).collect::<Vec<_>>()).expect("numbers");
    let place = DVec3::new(0.3, 0.4, 0.8);
    let rest = lattice.rest_from_shown(place);
    assert!(lattice.inverse().expect("no folds").shown_from_rest(rest).distance(place) < 1e-13);
    assert!(lattice.approximate_shown_from_rest(rest).distance(place) > 1e-4);
}

#[test]
fn bodies_are_undone_in_metres() {
    let turned = Affine3A::from_scale_rotation_translation(
        Vec3::new(0.2, 0.1, 0.3),
        Quat::from_euler(bevy::math::EulerRot::XYZ, 0.3, 0.8, -0.2),
        Vec3::new(0.5, 0.0, -0.4),
    );
    let mut lattice = DeformLattice::over(turned, 2).expect("a lattice");
    lattice.set_from(|p| DVec3::new(0.1, 0.0, 0.0) * (3.0 * p.y).sin()).expect("numbers");
    let inverse = lattice.inverse().expect("no folds");
    let shown = DVec3::new(0.2, 0.7, 0.4);
    let to_body = |place: DVec3| turned.transform_point3(place.as_vec3());
    let back = inverse.shown_from_rest_m(to_body(lattice.rest_from_shown(shown)));
    assert!(back.distance(to_body(shown)) < 1e-6);
}

#[test]
fn many_places_are_the_same_one_by_one_and_what_is_no_number_stays_none() {
    let lattice = smoothly_moved(random_tree(4, 4, 6), 4);
    let inverse = lattice.inverse().expect("no folds");
    let mut random = Pcg32::seed_from_u64(1);
    let places: Vec<DVec3> = (0..3000).map(|_| random_place(&mut random)).collect();
    let one_by_one: Vec<DVec3> = places.iter().map(|&place| inverse.shown_from_rest(place)).collect();
    assert_eq!(inverse.all_shown_from_rest(&places), one_by_one);
    assert!(inverse.shown_from_rest(DVec3::new(0.5, f64::NAN, 0.5)).is_nan());
    assert!(inverse.shown_from_rest(DVec3::splat(f64::INFINITY)).is_nan());
    let rest = DVec3::splat(0.4);
    let warm = inverse.shown_from_rest_near(rest, DVec3::NAN);
    assert!(warm.distance(inverse.shown_from_rest(rest)) < 1e-12);
}
