//! Random lattices for the tests of `deform`.

use bevy::math::{DVec3, Vec3};
use bevy_surgery::deform::DeformLattice;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// How a random lattice is made: the seed, how deep it may get, how often a patch of it is halved.
#[derive(Clone, Copy, Debug)]
pub struct Recipe {
    pub seed: u64,
    pub deepest: u32,
    pub times: u32,
}

pub fn recipe(deepest: u32, most: u32) -> impl Strategy<Value = Recipe> {
    (any::<u32>(), 0..=most).prop_map(move |(seed, times)| Recipe { seed: seed.into(), deepest, times })
}

/// A lattice at rest over the unit cube: random patches halved, half of the time one of the deepest.
pub fn random_tree(seed: u64, deepest: u32, times: u32) -> DeformLattice {
    let mut random = Pcg32::seed_from_u64(seed);
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, random.random_range(0..2)).expect("a lattice");
    for _ in 0..times {
        let tree = lattice.tree();
        let of_deepest = tree.deepest() < deepest && random.random_bool(0.5);
        let may = |level: u32| if of_deepest { level == tree.deepest() } else { level < deepest };
        let patches: Vec<_> = tree.patches().iter().copied().filter(|patch| may(patch.level)).collect();
        if let Some(&patch) = patches.get(random.random_range(0..patches.len().max(1))) {
            lattice.subdivide(patch).expect("it is there");
        }
    }
    lattice
}

/// Random translations, up to a share of the box along each axis.
pub fn moved(mut lattice: DeformLattice, seed: u64, most: f64) -> DeformLattice {
    let mut random = Pcg32::seed_from_u64(seed ^ 0x5eed);
    let mut part = || random.random_range(-most..=most);
    lattice.set_from(|_| DVec3::new(part(), part(), part())).expect("numbers");
    lattice
}

pub fn random_lattice(recipe: &Recipe, most: f64) -> DeformLattice {
    moved(random_tree(recipe.seed, recipe.deepest, recipe.times), recipe.seed, most)
}

/// Random translations that cannot fold: along each edge of a patch they differ by less than a share of its length.
pub fn gently_moved(lattice: DeformLattice, seed: u64, share: f64) -> DeformLattice {
    let side = 1.0 / f64::from(1 << lattice.tree().deepest());
    moved(lattice, seed, 0.5 * share * side)
}

/// A random place: in the box, or up to half of its size beyond it.
pub fn random_place(random: &mut Pcg32) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| random.random_range(-0.5..1.5)))
}
