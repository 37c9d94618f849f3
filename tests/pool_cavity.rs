//! Cavities by formula: what they hold, where they run over, which cells are wet.

use bevy_surgery::pool::{Cavity, PoolGrid};
use glam::{UVec2, Vec2};
use proptest::prelude::*;
use std::f64::consts::PI;

fn grid(side: u32, cell_m: f32) -> PoolGrid {
    PoolGrid::new(UVec2::splat(side), cell_m).expect("a good grid")
}

fn all(grid: &PoolGrid) -> [UVec2; 2] {
    [UVec2::ZERO, grid.size()]
}

/// A plane at height 0 with a hemisphere under its middle.
fn hemisphere(radius_m: f32) -> Cavity {
    let grid = grid(256, 5e-5);
    let mut cavity = Cavity::new(grid, -0.02, |_| Some(0.0));
    cavity.measure(all(&grid), |at| Some(-(radius_m * radius_m - at.length_squared()).max(0.0).sqrt()));
    cavity
}

/// Volume of a cap of a sphere, millilitres.
fn cap_ml(radius_m: f64, height_m: f64) -> f64 {
    PI * height_m * height_m * (3.0 * radius_m - height_m) / 3.0 * 1e6
}

#[test]
fn a_hemisphere_holds_what_it_should() {
    let radius_m = 4e-3;
    let cavity = hemisphere(radius_m);
    for share in [0.1, 0.3, 0.5, 0.8, 1.0] {
        let height_m = f64::from(radius_m * share);
        let level_m = -radius_m * (1.0 - share);
        let expected = cap_ml(f64::from(radius_m), height_m);
        let held = cavity.volume_ml(level_m);
        assert!((held / expected - 1.0).abs() < 0.01, "{share}: {held} of {expected} ml");
        let found = cavity.level_m(expected, 0.0, -radius_m).expect("it is drilled");
        assert!((found - level_m).abs() < 2e-5, "{share}: {found} instead of {level_m} m");
        let wet = cavity.mask(level_m).count() as f64 * 25e-10;
        let disk = PI * height_m * (2.0 * f64::from(radius_m) - height_m);
        assert!((wet / disk - 1.0).abs() < 0.05, "{share}: {wet} of {disk} m2");
    }
    assert_eq!(cavity.rim_m(), Some(0.0));
    assert_eq!(cavity.level_m(1e3, 0.0, 0.0), Some(0.0), "no more than what fits");
    assert_eq!(cavity.level_m(0.0, 0.0, 0.0), Some(cavity.deepest().expect("drilled").1));
}

#[test]
fn fluid_runs_over_the_lowest_part_of_the_rim() {
    let grid = grid(128, 1e-4);
    // The bone falls towards +x, with a pit of 2 mm radius and 2 mm depth.
    let slope = |at: Vec2| -0.2 * at.x;
    let pit = |at: Vec2| if at.length() < 2e-3 { slope(at) - 2e-3 } else { slope(at) };
    let mut cavity = Cavity::new(grid, -0.02, |at| Some(slope(at)));
    assert_eq!((cavity.rim_m(), cavity.deepest(), cavity.mask(0.0).count()), (None, None, 0));
    cavity.measure(all(&grid), |at| Some(pit(at)));
    let rim_m = cavity.rim_m().expect("drilled");
    assert!((rim_m - -4e-4).abs() < 3e-5, "{rim_m}");
    // A notch of one cell is bridged by surface tension, one of a millimetre is not, and it leads outside.
    for (half_width_m, expected_m) in [(5e-5, -4e-4), (5e-4, -9e-4)] {
        let mut notched = cavity.clone();
        notched.measure(all(&grid), |at| {
            let is_notch = at.x > 0.0 && at.y.abs() < half_width_m;
            let floor_m = if is_notch { slope(at).min(-9e-4) } else { slope(at) };
            Some(floor_m.min(pit(at)))
        });
        let rim_m = notched.rim_m().expect("drilled");
        assert!((rim_m - expected_m).abs() < 3e-5, "{half_width_m}: {rim_m}");
    }
    // Over the side of the grid.
    let mut open = cavity.clone();
    open.measure(all(&grid), |at| Some(if at.y.abs() < 1e-3 { -5e-3 } else { slope(at) }));
    assert_eq!(open.rim_m(), Some(-5e-3));
}

#[test]
fn the_mask_is_where_bone_was_above_the_level_and_is_below_it() {
    let grid = grid(64, 1e-4);
    let mut cavity = Cavity::new(grid, -0.02, |at| (at.x < 2.5e-3).then_some(if at.y > 0.0 { 1e-3 } else { -1e-3 }));
    // A trough along x, over high and low bone and beyond its end.
    cavity.measure(all(&grid), |at| Some(if at.y.abs() < 1e-3 { -3e-3 } else { 1.0 }));
    let wet = cavity.mask(0.0);
    for y in 0..64 {
        for x in 0..64 {
            let at = grid.pool_from_cell(UVec2::new(x, y));
            // Straight sides lose nothing to the first look for grains, and the second moves them out by a cell.
            let is_wet = |beyond_m: f32| at.x < 2.5e-3 + beyond_m && at.y > -beyond_m && at.y < 1e-3 + beyond_m;
            assert!(!is_wet(-1.2e-4) || wet.is_wet(UVec2::new(x, y)), "{at}");
            assert!(is_wet(1.2e-4) || !wet.is_wet(UVec2::new(x, y)), "{at}");
        }
    }
    // Bone never grows back, and is never below the floor.
    let cell = UVec2::new(10, 60);
    assert_eq!((cavity.original_m(cell), cavity.cut_m(cell)), (1e-3, 1e-3));
    cavity.measure([cell, cell + 1], |_| None);
    assert_eq!(cavity.cut_m(cell), -0.02);
    cavity.measure([cell, cell + 1], |_| Some(f32::NAN));
    assert_eq!(cavity.cut_m(cell), 1e-3);
}

proptest! {
    /// What is poured in is what is held, whatever the ground is like.
    #[test]
    fn level_and_volume_agree(seed in 0_u32..1000, share in 0.01_f64..0.99) {
        let grid = grid(24, 1e-3);
        let noise = |at: Vec2, k: f32| {
            ((at.x * 1e3 + 0.37 * seed as f32).sin() * 43.7 * k + (at.y * 1e3 + seed as f32).cos() * 91.3).fract().abs()
        };
        let mut cavity = Cavity::new(grid, -0.02, |at| Some(noise(at, 1.0) * 1e-3));
        cavity.measure(all(&grid), |at| Some(-noise(at, 2.0) * 8e-3));
        let most_m = 1e-3;
        let wanted = cavity.volume_ml(most_m) * share;
        let level_m = cavity.level_m(wanted, most_m, 0.0).expect("drilled");
        let held = cavity.volume_ml(level_m);
        prop_assert!((held / wanted - 1.0).abs() < 1e-4, "{} of {}", held, wanted);
    }
}
