//! A deformed volume on the CPU: passing over what is empty leaves the picture as it is.

use super::{perspective, rays_from, scene};
use bevy::math::{DVec3, UVec2, Vec3};
use bevy_surgery::volume::blocks::{BlockDistances, BlockRanges};
use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::software::{MarchScene, RenderField, composite_slices, march};
use bevy_surgery::volume::transfer::TransferFunction;
use bevy_surgery::volume::{Volume, VoxelLattice};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// Random translations of up to a share of a patch's side, everywhere, also on the box's sides.
fn shaken(volume: &Volume, level: u32, most: f64, seed: u64) -> VoxelLattice {
    let mut lattice = volume.grid().lattice(level).expect("a level that can be");
    let number = lattice.tree().patch_at(DVec3::splat(0.6));
    let patch = lattice.tree().patches()[number];
    lattice.subdivide(patch).expect("it is there");
    let mut random = Pcg32::seed_from_u64(seed);
    let most = most / f64::from(1_u32 << level);
    let mut part = || random.random_range(-most..most);
    lattice.set_from(|_| DVec3::new(part(), part(), part())).expect("finite numbers");
    VoxelLattice::new(&lattice, volume.grid())
}

#[test]
fn passing_over_empty_space_changes_no_picture() {
    let volume = phantom(&PhantomOptions { size: 64, ..PhantomOptions::default() }).expect("a phantom");
    let step_m = volume.grid().spacing_mm().min_element() as f32 * 1e-3;
    let half = volume.grid().half_axes_m().into_iter().map(|half| half.length_squared()).sum::<f32>().sqrt();
    let table = TransferFunction::bone().bake(volume.range(), step_m.into());
    let distances = BlockDistances::new(&BlockRanges::new(&volume), table.entries());
    let field = RenderField::new(&volume);
    let size_px = UVec2::new(96, 72);
    // From gentle to so wild that the lattice folds.
    for (seed, (level, most)) in [(0, 0.3), (1, 0.1), (2, 0.25), (3, 0.25), (2, 0.8)].into_iter().enumerate() {
        let lattice = shaken(&volume, level, most, seed as u64);
        for direction in [Vec3::Z, Vec3::new(0.8, 0.5, 0.6), Vec3::new(-0.7, -0.2, 0.4)] {
            let eye = direction.normalize() * half * 2.0;
            let rays = rays_from(&volume, size_px, perspective(size_px, 1.0), eye, Vec3::ZERO);
            let everywhere = MarchScene { step_m, lattice: Some(&lattice), ..scene(&field, table.entries()) };
            let all = march(&rays, &everywhere);
            let some = march(&rays, &MarchScene { distances: Some(&distances), ..everywhere });
            assert!(all.counts.covered > 500, "{:?}", all.counts);
            assert!(
                some.counts.samples * 2 < all.counts.samples,
                "level {level}: {} samples of {}",
                some.counts.samples,
                all.counts.samples
            );
            assert!(all.colour == some.colour && all.normal == some.normal && all.depth_m == some.depth_m);
            // Slices take the same samples in another order.
            let sliced = composite_slices(&rays, &everywhere);
            let furthest = all.colour.iter().zip(&sliced.colour).map(|(a, b)| (a[3] - b[3]).abs()).fold(0.0, f32::max);
            assert!(furthest < 0.021, "{furthest}");
        }
    }
}

#[test]
fn what_moves_out_of_the_grid_is_still_seen() {
    let volume = super::ball();
    let mut lattice = volume.grid().lattice(1).expect("a level that can be");
    // Half a box to the left of the picture: matter moves against the translations.
    lattice.set_from(|_| DVec3::new(0.5, 0.0, 0.0)).expect("finite numbers");
    let lattice = VoxelLattice::new(&lattice, volume.grid());
    let (field, table) = (RenderField::new(&volume), super::solid_table(1.0));
    let size_px = UVec2::new(96, 72);
    let moved = Vec3::new(-0.032, 0.0, 0.0);
    let towards = |target: Vec3| rays_from(&volume, size_px, perspective(size_px, 1.0), target + Vec3::Z * 0.1, target);
    let image = march(&towards(moved), &MarchScene { lattice: Some(&lattice), ..scene(&field, &table) });
    let at_rest = march(&towards(Vec3::ZERO), &scene(&field, &table));
    let apart = image.colour.iter().zip(&at_rest.colour).filter(|(a, b)| (a[3] - b[3]).abs() > 0.01).count();
    assert!(at_rest.counts.covered > 500 && apart < 20, "{apart} pixels differ");
}
