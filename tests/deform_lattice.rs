//! The lattice: octrees, constraints, the field between the vertices (paper of 2001, section 3).

use crate::deform_support::{moved, random_lattice, random_place, random_tree, recipe};
use bevy::math::{DVec3, UVec3, Vec3};
use bevy_surgery::deform::lattice::{MAX_LEVEL, Tree};
use bevy_surgery::deform::{DeformLattice, LatticeError, Patch};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_pcg::Pcg32;
use std::collections::BTreeSet;

/// Corners of a patch on a grid of 2^6 cells: all patches have whole numbers there.
fn extent(patch: Patch) -> (UVec3, UVec3) {
    let side = 1 << (MAX_LEVEL - patch.level);
    (patch.cell * side, (patch.cell + 1) * side)
}

/// Patches that a place lies in or on.
fn touching(tree: &Tree, place: DVec3) -> BTreeSet<usize> {
    let corners = (0..8).map(|n| DVec3::new(f64::from(n & 1), f64::from(n >> 1 & 1), f64::from(n >> 2)) - 0.5);
    corners.map(|away| tree.patch_at(place + away * 1e-7)).collect()
}

/// Places on the sides of a patch: corners, middles of edges and faces, and two odd ones per face.
fn border(patch: Patch) -> Vec<DVec3> {
    let mut shares: Vec<DVec3> = (0..27)
        .map(|n| DVec3::new(f64::from(n % 3), f64::from(n / 3 % 3), f64::from(n / 9)) * 0.5)
        .filter(|share| *share != DVec3::splat(0.5))
        .collect();
    for axis in 0..3 {
        for (end, (a, b)) in [(0.0, (0.23, 0.71)), (1.0, (0.61, 0.38))] {
            let mut share = DVec3::splat(end);
            share[(axis + 1) % 3] = a;
            share[(axis + 2) % 3] = b;
            shares.push(share);
        }
    }
    shares.into_iter().map(|share| patch.low() + share * patch.side()).collect()
}

/// Largest jump of the field over any border.
fn largest_jump(lattice: &DeformLattice) -> f64 {
    let tree = lattice.tree();
    let mut jump = 0.0_f64;
    for (number, &patch) in tree.patches().iter().enumerate() {
        for place in border(patch) {
            let here = lattice.translation_in(number, place);
            for other in touching(tree, place) {
                jump = jump.max(here.distance(lattice.translation_in(other, place)));
            }
        }
    }
    jump
}

/// What kinds of constraints a tree has: ends of edges, corners of faces, and vertices that are both on a coarse edge and the
/// middle of a finer face.
fn check_tree(tree: &Tree) -> [usize; 2] {
    let patches = tree.patches();
    let volume: f64 = patches.iter().map(|patch| patch.side().powi(3)).sum();
    assert!((volume - 1.0).abs() < 1e-12, "the patches fill the box: {volume}");
    for (number, &a) in patches.iter().enumerate() {
        let (low, high) = extent(a);
        for &b in &patches[number + 1..] {
            let (low_b, high_b) = extent(b);
            let touch = low.cmple(high_b).all() && low_b.cmple(high).all();
            assert!(!touch || a.level.abs_diff(b.level) <= 1, "{a} touches {b}");
        }
    }
    let constrained: BTreeSet<usize> = tree.constraints().iter().map(|constraint| constraint.vertex).collect();
    assert_eq!(constrained.len(), tree.constraints().len(), "a vertex follows once");
    for vertex in 0..tree.vertex_count() {
        let place = tree.place_of(vertex);
        // A vertex hangs where a patch has it on its side but not at a corner.
        let hangs = touching(tree, place).into_iter().any(|number| !tree.corners(number).contains(&vertex));
        assert_eq!(hangs, tree.is_constrained(vertex), "vertex {vertex} at {place}");
        assert_eq!(hangs, constrained.contains(&vertex), "vertex {vertex} is both free and constrained");
    }
    let mut kinds = [0; 2];
    for constraint in tree.constraints() {
        assert!(!constraint.of.iter().any(|master| constrained.contains(master)), "{constraint:?} is recursive");
        let middle: DVec3 = constraint.of.iter().map(|&master| tree.place_of(master)).sum();
        assert_eq!(middle / constraint.of.len() as f64, tree.place_of(constraint.vertex));
        match constraint.of.len() {
            2 => kinds[0] += 1,
            4 => kinds[1] += 1,
            other => panic!("a constraint with {other} masters"),
        }
    }
    kinds
}

#[test]
fn a_thousand_random_octrees_have_a_continuous_field() {
    let (mut deepest, mut edges, mut faces, mut between) = (0, 0, 0, 0);
    for seed in 0..1000 {
        let lattice = moved(random_tree(seed, 5, 9), seed, 0.3);
        let tree = lattice.tree();
        let [on_edges, on_faces] = check_tree(tree);
        edges += on_edges;
        faces += on_faces;
        // A coarse edge with patches of both levels around it, whose end is the corner of a face that is constrained too.
        between += usize::from(on_edges > 0 && on_faces > 0 && tree.deepest() >= 3);
        deepest = deepest.max(tree.deepest());
        let jump = largest_jump(&lattice);
        assert!(jump < 1e-15, "tree {seed}: the field jumps by {jump}");
    }
    println!(
        "{edges} vertices on edges, {faces} on faces, {between} trees with both at several levels, level {deepest}"
    );
    assert_eq!(deepest, 5);
    assert!(edges > 1000 && faces > 1000 && between > 100);
}

/// How many vertices the one at a place follows.
fn masters(lattice: &DeformLattice, place: DVec3) -> Option<usize> {
    let tree = lattice.tree();
    let vertex = tree.nearest_vertex(place);
    assert_eq!(tree.place_of(vertex), place);
    tree.constraints().iter().find(|constraint| constraint.vertex == vertex).map(|constraint| constraint.of.len())
}

#[test]
fn every_kind_of_constraint_occurs() {
    // One of eight halved: three faces towards coarse neighbours, and the edges between two of them.
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a lattice");
    lattice.subdivide(Patch { level: 1, cell: UVec3::ZERO }).expect("it is there");
    assert_eq!(masters(&lattice, DVec3::new(0.5, 0.25, 0.25)), Some(4), "in the middle of a coarse face");
    assert_eq!(masters(&lattice, DVec3::new(0.5, 0.5, 0.25)), Some(2), "on an edge between two coarse faces");
    assert_eq!(
        masters(&lattice, DVec3::new(0.5, 0.25, 0.0)),
        Some(2),
        "on an edge of a coarse face and the box's side"
    );
    assert_eq!(masters(&lattice, DVec3::new(0.5, 0.5, 0.5)), None, "a corner of all");
    assert_eq!(masters(&lattice, DVec3::new(0.25, 0.25, 0.0)), None, "on the box's side, and of fine patches only");
    assert_eq!(masters(&lattice, DVec3::new(0.25, 0.25, 0.25)), None, "inside");
    // Three halved around a coarse one: what lies on faces of the same level is free, and the edges still follow.
    let three = [UVec3::new(1, 0, 0), UVec3::new(0, 1, 0), UVec3::new(0, 0, 1)].map(|cell| Patch { level: 1, cell });
    lattice.subdivide_all(&three).expect("they are there");
    assert_eq!(masters(&lattice, DVec3::new(0.5, 0.25, 0.25)), None, "both sides are fine now");
    assert_eq!(
        masters(&lattice, DVec3::new(0.5, 0.5, 0.25)),
        Some(2),
        "three fine patches around it, and a coarse one"
    );
}

#[test]
fn a_field_is_interpolated_as_equation_2_says() {
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 0).expect("a lattice");
    // What is trilinear is met exactly.
    let field = |p: DVec3| DVec3::new(p.x * p.y, p.y * p.z * p.x, 1.0 - p.z) * 0.25;
    lattice.set_from(field).expect("numbers");
    for place in [DVec3::splat(0.3), DVec3::new(0.1, 0.9, 0.5), DVec3::ONE] {
        assert!(lattice.translation_at(place).distance(field(place)) < 1e-7);
        assert!(lattice.rest_from_shown(place).distance(place + field(place)) < 1e-7);
    }
    let beyond = DVec3::new(1.5, 0.5, -3.0);
    assert_eq!(lattice.translation_at(beyond), lattice.translation_at(DVec3::new(1.0, 0.5, 0.0)), "it goes on");
    lattice.drag_vertex(0, Vec3::splat(0.125)).expect("free");
    assert_eq!(lattice.translations()[0], Vec3::new(-0.125, -0.125, 0.125), "equation 3");
}

#[test]
fn the_jacobian_is_the_derivative() {
    for seed in 0..20 {
        let lattice = moved(random_tree(seed, 3, 4), seed, 0.05);
        for place in [DVec3::new(0.31, 0.72, 0.13), DVec3::new(-0.2, 0.3, 0.4), DVec3::new(1.2, -0.3, 0.61)] {
            let jacobian = lattice.jacobian_at(place);
            for axis in 0..3 {
                let step = DVec3::AXES[axis] * 1e-6;
                let slope = (lattice.rest_from_shown(place + step) - lattice.rest_from_shown(place - step)) / 2e-6;
                assert!(jacobian.col(axis).distance(slope) < 1e-6, "{place}: {} and {slope}", jacobian.col(axis));
            }
        }
    }
}

#[test]
fn the_nearest_vertex_is_found_among_all() {
    for seed in 0..50 {
        let tree = random_tree(seed, 4, 5).tree().clone();
        let mut random = Pcg32::seed_from_u64(seed);
        for _ in 0..100 {
            let place = random_place(&mut random).clamp(DVec3::ZERO, DVec3::ONE);
            let distance = |vertex: usize| tree.place_of(vertex).distance(place);
            let least = (0..tree.vertex_count()).map(distance).fold(f64::INFINITY, f64::min);
            assert_eq!(distance(tree.nearest_vertex(place)), least, "at {place} of tree {seed}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn subdividing_says_what_it_did_and_keeps_the_field(recipe in recipe(5, 8), pick in 0_u32..1000) {
        let before = random_lattice(&recipe, 0.3);
        let patches = before.tree().patches();
        let patch = patches[pick as usize % patches.len()];
        prop_assume!(patch.level < MAX_LEVEL);
        let mut after = before.clone();
        let did = after.subdivide(patch).expect("it is there");
        prop_assert_eq!(did.halved.last(), Some(&patch));
        prop_assert!(after.revision() > before.revision());
        // Each step in its order needs no other before it.
        let mut tree = before.tree().clone();
        for &step in &did.halved {
            prop_assert!(step.level <= patch.level);
            prop_assert_eq!(&tree.subdivide(step).expect("it is there").halved, &vec![step]);
        }
        prop_assert_eq!(&tree, after.tree());
        prop_assert_eq!(after.tree().patches().len(), patches.len() + 7 * did.halved.len());
        check_tree(after.tree());
        for (number, &patch) in after.tree().patches().iter().enumerate() {
            for share in [DVec3::ZERO, DVec3::splat(0.5), DVec3::new(0.1, 0.7, 0.4), DVec3::ONE] {
                let place = patch.low() + share * patch.side();
                let (was, is) = (before.translation_at(place), after.translation_in(number, place));
                prop_assert!(was.distance(is) < 1e-6, "{} became {} at {}", was, is, place);
            }
        }
    }

    #[test]
    fn what_is_refused_changes_nothing(recipe in recipe(4, 5), vertex in 0_usize..10_000) {
        let before = random_lattice(&recipe, 0.2);
        let mut lattice = before.clone();
        let count = lattice.tree().vertex_count();
        let vertex = vertex % count;
        for bad in [Vec3::NAN, Vec3::X * f32::INFINITY, Vec3::new(0.0, f32::NEG_INFINITY, 0.0)] {
            prop_assert!(lattice.set_translation(vertex, bad).is_err());
            prop_assert!(lattice.drag_vertex(vertex, bad).is_err());
            let mut all = before.translations().to_vec();
            let free = (0..count).find(|&vertex| !before.tree().is_constrained(vertex)).expect("a corner is free");
            all[free] = bad;
            let refused = lattice.set_translations(&all);
            prop_assert!(matches!(refused, Err(LatticeError::NotFinite { vertex, .. }) if vertex == free), "{:?}", refused);
            let refused = lattice.set_from(|place| if place == DVec3::ONE { bad.as_dvec3() } else { place });
            prop_assert!(refused.is_err());
        }
        let none = LatticeError::NoVertex { vertex: count, count };
        prop_assert_eq!(lattice.set_translation(count, Vec3::ZERO), Err(none.clone()));
        prop_assert_eq!(lattice.drag_vertex(count, Vec3::ZERO), Err(none));
        let wrong = LatticeError::WrongCount { found: count + 1, expected: count };
        prop_assert_eq!(lattice.set_translations(&vec![Vec3::ZERO; count + 1]), Err(wrong));
        for constraint in before.tree().constraints() {
            let refused = LatticeError::Constrained { vertex: constraint.vertex, of: constraint.of.clone() };
            prop_assert_eq!(lattice.set_translation(constraint.vertex, Vec3::ZERO), Err(refused));
        }
        let patch = before.tree().patches()[0];
        let gone = Patch { level: patch.level + 1, cell: patch.cell * 2 };
        let outside = Patch { level: 1, cell: UVec3::splat(7) };
        for missing in [gone, outside] {
            prop_assert_eq!(lattice.subdivide(missing), Err(LatticeError::NoPatch { patch: missing }));
            prop_assert!(lattice.subdivide_all(&[patch, missing]).is_err());
        }
        for level in [MAX_LEVEL, MAX_LEVEL + 1, u32::MAX - 1] {
            let patch = Patch { level, cell: UVec3::ZERO };
            prop_assert_eq!(lattice.subdivide(patch), Err(LatticeError::TooDeep { level: level + 1 }));
        }
        prop_assert_eq!(lattice, before);
    }
}

#[test]
fn what_a_constrained_vertex_is_given_does_not_count() {
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a lattice");
    lattice.subdivide(Patch { level: 1, cell: UVec3::ONE }).expect("it is there");
    let mut all = vec![Vec3::splat(0.01); lattice.tree().vertex_count()];
    for constraint in lattice.tree().constraints() {
        all[constraint.vertex] = Vec3::NAN;
    }
    lattice.set_translations(&all).expect("those that count are numbers");
    assert!(lattice.translations().iter().all(|translation| translation.distance(Vec3::splat(0.01)) < 1e-7));
    assert!(!lattice.is_at_rest());
    lattice.reset();
    assert!(lattice.is_at_rest());
}

#[test]
fn boxes_without_an_inside_and_absurd_depths_are_refused() {
    let bad = [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, -1.0, 1.0), Vec3::NAN, Vec3::splat(f32::INFINITY)];
    for high_m in bad {
        let refused = DeformLattice::new(Vec3::ZERO, high_m, 1);
        assert!(matches!(refused, Err(LatticeError::EmptyBox { .. })), "{high_m}: {refused:?}");
    }
    let flat = bevy::math::Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0));
    assert!(matches!(DeformLattice::over(flat, 1), Err(LatticeError::EmptyBox { .. })));
    for level in [MAX_LEVEL + 1, 1000, u32::MAX] {
        assert_eq!(DeformLattice::new(Vec3::ZERO, Vec3::ONE, level), Err(LatticeError::TooDeep { level }));
    }
    let message = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 40).expect_err("too deep").to_string();
    assert!(message.contains("40") && message.contains('6'), "{message}");
}
