//! What a lattice does to gradients and light (paper of 2001, section 5).

use crate::deform_support::{moved, random_place, random_tree};
use bevy::math::{DMat3, DVec3, Vec3};
use bevy_surgery::deform::{AffineField, DeformLattice, NormalDeformation};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

const ALL: [NormalDeformation; 3] =
    [NormalDeformation::PerPatch, NormalDeformation::Smoothed, NormalDeformation::Exact];

/// A smooth field that bends and twists the box.
fn field(p: DVec3) -> DVec3 {
    DVec3::new(0.06 * (5.0 * p.y).sin(), 0.05 * (4.0 * p.z + 2.0 * p.x).sin(), 0.06 * (6.0 * p.x - p.y).cos())
}

/// Its Jacobian, with the identity.
fn analytic_jacobian(p: DVec3) -> DMat3 {
    let (b, c) = ((4.0 * p.z + 2.0 * p.x).cos(), (6.0 * p.x - p.y).sin());
    DMat3::from_cols(
        DVec3::new(1.0, 0.1 * b, -0.36 * c),
        DVec3::new(0.3 * (5.0 * p.y).cos(), 1.0, 0.06 * c),
        DVec3::new(0.0, 0.2 * b, 1.0),
    )
}

fn lattice_of(level: u32) -> DeformLattice {
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, level).expect("a lattice");
    lattice.set_from(field).expect("numbers");
    lattice
}

/// Places at rest on a sphere about the middle, and their normals.
fn sphere() -> Vec<(DVec3, DVec3)> {
    // Fibonacci's spiral.
    (0..2000)
        .map(|n| {
            let z = 1.0 - (2.0 * f64::from(n) + 1.0) / 2000.0;
            let (sin, cos) = (f64::from(n) * 2.399_963_229_728_653).sin_cos();
            let normal = DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
            (DVec3::splat(0.5) + 0.35 * normal, normal)
        })
        .collect()
}

/// Mean and largest angle between the normals of each way and the true ones, degrees.
fn angle_errors(lattice: &DeformLattice, true_normal: impl Fn(DVec3, DVec3) -> DVec3) -> [[f64; 2]; 3] {
    let affine = AffineField::new(lattice);
    let inverse = lattice.inverse().expect("no folds");
    ALL.map(|by| {
        let angles: Vec<f64> = sphere()
            .into_iter()
            .map(|(rest, normal)| {
                let shown = inverse.shown_from_rest(rest);
                let ours = affine.space_from_rest_gradient(lattice, shown, by) * normal;
                ours.angle_between(true_normal(shown, normal)).to_degrees()
            })
            .collect();
        [angles.iter().sum::<f64>() / angles.len() as f64, angles.iter().copied().fold(0.0, f64::max)]
    })
}

#[test]
fn exact_normals_are_those_of_the_shown_surface() {
    println!("angle errors on a deformed sphere, degrees: mean (largest)");
    println!("level  against  per patch        smoothed         exact");
    let mut before: Option<[f64; 2]> = None;
    for level in 1..=4 {
        let lattice = lattice_of(level);
        // The surface that is shown: where the distance of `rest_from_shown` from the middle is the radius. Its normal by
        // differences.
        let distance = |p: DVec3| lattice.rest_from_shown(p).distance(DVec3::splat(0.5));
        let shown_surface = angle_errors(&lattice, |shown, _| {
            let step = 1e-7;
            let along = |axis: DVec3| distance(shown + axis * step) - distance(shown - axis * step);
            DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
        });
        // The smooth field that the lattice follows at its vertices.
        let smooth_field = angle_errors(&lattice, |shown, normal| analytic_jacobian(shown).transpose() * normal);
        for (against, [patch, smoothed, exact]) in [("lattice", shown_surface), ("field", smooth_field)] {
            let show = |[mean, most]: [f64; 2]| format!("{mean:6.3} ({most:6.3})");
            println!("{level:5}  {against:7}  {}  {}  {}", show(patch), show(smoothed), show(exact));
        }
        // Of what is shown, nothing comes near the exact ones. Averaging blurs the field, so smoothed normals lie farther from
        // it than those of the patches, which are right in their middles.
        let [patch, smoothed, exact] = shown_surface.map(|[mean, _]| mean);
        assert!(exact < 1e-3 && patch < 1.5 && smoothed < 6.0, "level {level}: {exact}, {smoothed}, {patch}");
        if let Some([was_patch, was_smoothed]) = before.replace([patch, smoothed]) {
            assert!(patch < 0.8 * was_patch && smoothed < 0.9 * was_smoothed, "finer lattices, smaller errors");
        }
        // But the blurred slopes are central differences of the smooth field, and those are nearer to it once the lattice
        // follows it at all.
        let [patch, smoothed, exact] = smooth_field.map(|[mean, _]| mean);
        assert!(exact <= patch, "level {level}: {exact} and {patch}");
        assert!(level < 3 || smoothed < 0.8 * exact, "level {level}: {exact} and {smoothed}");
    }
}

#[test]
fn smoothed_maps_have_no_jumps_and_those_of_patches_have() {
    let mut largest = [0.0_f64; 2];
    for seed in 0..100 {
        let lattice = moved(random_tree(seed, 4, 7), seed, 0.02);
        let affine = AffineField::new(&lattice);
        let tree = lattice.tree();
        for (number, patch) in tree.patches().iter().enumerate() {
            for share in [DVec3::new(1.0, 0.3, 0.6), DVec3::new(0.7, 1.0, 0.2), DVec3::new(0.5, 0.5, 1.0), DVec3::ONE] {
                let place = patch.low() + share * patch.side();
                let other = tree.patch_at(place);
                let jump = |a: DMat3, b: DMat3| {
                    (a - b).to_cols_array().into_iter().fold(0.0, |most: f64, d| most.max(d.abs()))
                };
                let smoothed = jump(affine.smoothed_in(tree, number, place), affine.smoothed_in(tree, other, place));
                let per_patch = jump(affine.per_patch()[number].as_dmat3(), affine.per_patch()[other].as_dmat3());
                largest = [largest[0].max(smoothed), largest[1].max(per_patch)];
            }
        }
    }
    println!("largest jump of smoothed maps {:.1e}, of the patches' {:.1}", largest[0], largest[1]);
    assert!(largest[0] < 1e-5 && largest[1] > 0.1, "{largest:?}");
}

#[test]
fn light_may_be_turned_instead_of_gradients() {
    // Equation 13, for lights that are turned at the vertices and interpolated, as the paper does it.
    let lattice = moved(random_tree(8, 3, 4), 8, 0.05);
    let affine = AffineField::new(&lattice);
    let tree = lattice.tree();
    let mut random = Pcg32::seed_from_u64(2);
    for _ in 0..200 {
        let place = random_place(&mut random).clamp(DVec3::ZERO, DVec3::ONE);
        let mut part = || DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
        let (gradient, light) = (part(), part());
        let number = tree.patch_at(place);
        let patch = tree.patches()[number];
        let share = (place - patch.low()) / patch.side();
        let turned: DVec3 = tree
            .corners(number)
            .into_iter()
            .enumerate()
            .map(|(n, vertex)| {
                let weight: f64 = (0..3).map(|a| if n >> a & 1 == 1 { share[a] } else { 1.0 - share[a] }).product();
                weight * (affine.at_vertices()[vertex].as_dmat3() * light)
            })
            .sum();
        let in_space = affine.space_from_rest_gradient(&lattice, place, NormalDeformation::Smoothed) * gradient;
        assert!((in_space.dot(light) - gradient.dot(turned)).abs() < 1e-12);
    }
}

#[test]
fn gradients_in_space_are_the_derivative_of_what_is_shown() {
    let lattice = lattice_of(3);
    let affine = AffineField::new(&lattice);
    // A value at rest whose gradient is known.
    let value = |p: DVec3| (3.0 * p.x).sin() + p.y * p.z;
    let gradient = |p: DVec3| DVec3::new(3.0 * (3.0 * p.x).cos(), p.z, p.y);
    for place in [DVec3::new(0.31, 0.44, 0.77), DVec3::new(1.2, 0.3, 0.55), DVec3::new(-0.1, 1.4, 0.3)] {
        let shown = |p: DVec3| value(lattice.rest_from_shown(p));
        let along = |axis: DVec3| (shown(place + axis * 1e-6) - shown(place - axis * 1e-6)) / 2e-6;
        let by_differences = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
        let rest = gradient(lattice.rest_from_shown(place));
        let exact = affine.space_from_rest_gradient(&lattice, place, NormalDeformation::Exact) * rest;
        assert!(exact.distance(by_differences) < 1e-7, "{exact} and {by_differences}");
        for by in ALL {
            let near = affine.space_from_rest_gradient(&lattice, place, by) * rest;
            assert!(near.distance(by_differences) < 0.3, "{by:?}: {near} and {by_differences}");
        }
    }
}

#[test]
fn at_rest_all_maps_are_the_identity() {
    let lattice = random_tree(3, 4, 6);
    let mut affine = AffineField::new(&lattice_of(1));
    affine.update(&lattice);
    assert_eq!(affine.per_patch().len(), lattice.tree().patches().len());
    for by in ALL {
        assert_eq!(affine.jacobian_at(&lattice, DVec3::new(0.2, 0.9, 1.3), by), DMat3::IDENTITY);
    }
    assert_eq!(NormalDeformation::default(), NormalDeformation::Exact);
}
