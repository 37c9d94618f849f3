//! Bad input, odd sizes, any number of threads: nothing breaks and nothing is forgotten.

use super::phantom::{Phantom, STEP_S, all_doses, lossless, sphere};
use bevy_surgery::organ::atlas::Atlas;
use bevy_surgery::organ::chart::{self, ChartOptions};
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::reactions::burn::Cautery;
use bevy_surgery::reactions::heat::{HeatMap, HeatSettings, MOST_HOT_TILES};
use bevy_surgery::reactions::texels::MapSize;
use glam::{DVec2, Vec3};
use proptest::prelude::*;

#[test]
fn bad_input_changes_nothing() {
    let mut phantom = Phantom::ellipsoid(512);
    let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
    let spot = phantom.spot(DVec2::new(0.5, 0.5), 0.002, |_| 1.0);
    for energy in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0] {
        heat.deposit(&phantom.surface(), &spot, energy);
    }
    let with = |weight: f32| spot.iter().map(|&(x, y, _)| (x, y, weight)).collect::<Vec<_>>();
    for weight in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        heat.deposit(&phantom.surface(), &with(weight), 1.0);
    }
    heat.deposit(&phantom.surface(), &[], 1.0);
    heat.deposit(&phantom.surface(), &[(512, 0, 1.0), (0, 256, 1.0), (u32::MAX, u32::MAX, 1.0)], 1.0);
    let rest_m = phantom.positions_m.clone();
    for odd in [Vec3::NAN, Vec3::INFINITY, Vec3::ZERO] {
        phantom.positions_m.fill(odd);
        heat.surface_moved();
        heat.deposit(&phantom.surface(), &spot, 1.0);
    }
    phantom.positions_m.truncate(3);
    heat.surface_moved();
    heat.deposit(&phantom.surface(), &spot, 1.0);
    assert_eq!((heat.hot_tiles(), heat.total_energy_j(), heat.dose(256, 128)), (0, 0.0, 0.0));
    assert_eq!((heat.temperature_rise_k(u32::MAX, 0), heat.dose(0, u32::MAX)), (0.0, 0.0));

    // A texel beside the map does not take the others' share.
    phantom.positions_m.clone_from(&rest_m);
    heat.surface_moved();
    let mut mixed = spot.clone();
    mixed.extend([(512, 3, 1.0), (3, 3, f32::NAN)]);
    heat.deposit(&phantom.surface(), &mixed, 2.0);
    assert!((heat.total_energy_j() - 2.0).abs() < 1e-5);
    for dt_s in [0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
        heat.step(&phantom.surface(), dt_s);
        assert!((heat.total_energy_j() - 2.0).abs() < 1e-5, "{dt_s}");
    }
    // Vertices lost and found again under a hot spot.
    for odd in [Vec3::NAN, Vec3::MAX] {
        phantom.positions_m.fill(odd);
        heat.surface_moved();
        phantom.rest(&mut heat, 0.2);
        assert!(
            phantom.texels().all(|(x, y)| heat.temperature_rise_k(x, y).is_finite() && heat.dose(x, y).is_finite())
        );
    }
    phantom.positions_m.clone_from(&rest_m);
    heat.surface_moved();
    phantom.rest(&mut heat, 0.2);
    assert!(heat.total_energy_j() > 1.0 && heat.total_energy_j() < 2.0, "{}", heat.total_energy_j());
    for dt_s in [1e3, 1e300, f64::INFINITY] {
        heat.step(&phantom.surface(), dt_s);
        assert!(heat.total_energy_j() >= 0.0 && heat.hot_tiles() < 20, "{dt_s}");
    }
    assert_eq!(heat.total_energy_j(), 0.0);
}

#[test]
fn enormous_heat_everywhere_stays_bounded() {
    let phantom = Phantom::ellipsoid(2048);
    let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
    let all: Vec<(u32, u32, f32)> = phantom.texels().map(|(x, y)| (x, y, 1.0)).collect();
    heat.deposit(&phantom.surface(), &all, 1e300);
    assert_eq!(heat.hot_tiles(), MOST_HOT_TILES);
    for _ in 0..3 {
        heat.step(&phantom.surface(), STEP_S);
    }
    assert_eq!(heat.hot_tiles(), MOST_HOT_TILES);
    let finite = |value: f32| value.is_finite() && value >= 0.0;
    assert!(phantom.texels().all(|(x, y)| finite(heat.temperature_rise_k(x, y)) && finite(heat.dose(x, y))));
    assert!(phantom.texels().all(|(x, y)| heat.temperature_rise_k(x, y) < 263.01));
}

#[test]
fn maps_of_one_tile_and_of_odd_sizes_work() {
    let ellipsoid = procedural_ellipsoid(Vec3::splat(0.05), 4);
    let (chart, _) = chart::build(&ellipsoid, &ChartOptions::default()).expect("a sphere has a chart");
    for (width_px, height_px) in [(0, 0), (32, 32), (64, 32), (96, 64), (50, 40), (576, 288)] {
        let size = MapSize { width_px, height_px };
        let phantom = Phantom::new(&ellipsoid, Atlas::Spherical(chart.clone()), size);
        let mut heat = HeatMap::new(size, lossless());
        let all: Vec<(u32, u32, f32)> = phantom.texels().map(|(x, y)| (x, y, if y < 8 { 1.0 } else { 1e-3 })).collect();
        heat.deposit(&phantom.surface(), &all, 10.0);
        let given = if width_px >= 32 { 10.0 } else { 0.0 };
        phantom.rest(&mut heat, 1.0);
        assert!((heat.total_energy_j() - given).abs() < 1e-4, "{width_px} x {height_px}: {}", heat.total_energy_j());
    }
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    let phantom = Phantom::ellipsoid(2048);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
            let unit = Cautery::coagulate(80.0);
            phantom.pass(&mut heat, &unit, DVec2::new(0.9, 0.3), DVec2::new(1.15, 0.5), 0.2);
            phantom.pass(&mut heat, &unit, DVec2::new(0.2, 0.001), DVec2::new(0.2, 0.1), 0.2);
            heat.surface_moved();
            phantom.rest(&mut heat, 0.5);
            assert!(heat.hot_tiles() > 100, "enough for several threads: {}", heat.hot_tiles());
            let bits = |value: f32| value.to_bits();
            let texels = phantom.texels();
            texels.map(|(x, y)| (bits(heat.temperature_rise_k(x, y)), bits(heat.dose(x, y)))).collect::<Vec<_>>()
        })
    };
    assert!(run(1) == run(4));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..Default::default() })]

    #[test]
    fn doses_never_fall(
        deposits in prop::collection::vec(
            (0.0..1.0f64, 0.0..1.0f64, 2e-4..6e-3f64, -0.5..30.0f64, 0.0..0.2f64, any::<bool>()), 1..12),
    ) {
        let phantom = sphere();
        let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
        let mut before = all_doses(phantom, &heat);
        for (u, v, radius_m, energy_j, dt_s, moves) in deposits {
            heat.deposit(&phantom.surface(), &phantom.spot(DVec2::new(u, v), radius_m, Cautery::weight), energy_j);
            if moves {
                heat.surface_moved();
            }
            heat.step(&phantom.surface(), dt_s);
            let after = all_doses(phantom, &heat);
            prop_assert!(before.iter().zip(&after).all(|(before, after)| before <= after && after.is_finite()));
            before = after;
        }
    }
}
