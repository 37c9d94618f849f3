//! The heat map against closed forms: conduction, cooling, doses.

mod bounds;
mod burns;
mod phantom;

use bevy_surgery::organ::atlas::Atlas;
use bevy_surgery::organ::chart::{self, ChartOptions};
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::reactions::burn::Cautery;
use bevy_surgery::reactions::heat::{HeatMap, HeatSettings};
use bevy_surgery::reactions::texels::MapSize;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use phantom::{Phantom, STEP_S, all_doses, lossless, sphere};
use std::f64::consts::PI;

#[test]
fn a_gaussian_on_a_plane_widens_by_twice_diffusivity_times_time() {
    // Upright, stretched, and slanted texels; a mirrored chart; texels of 0.03 mm, which ask for many stages.
    for (u, v, deviation_m, seconds) in [
        (Vec2::new(0.06, 0.0), Vec2::new(0.0, 0.03), 0.002, 10.0),
        (Vec2::new(0.06, 0.0), Vec2::new(0.0, 0.05), 0.002, 10.0),
        (Vec2::new(0.06, 0.0), Vec2::new(0.012, 0.035), 0.002, 10.0),
        (Vec2::new(0.06, 0.0), Vec2::new(0.012, -0.035), 0.002, 10.0),
        (Vec2::new(0.00768, 0.0), Vec2::new(0.0, 0.00384), 2.5e-4, 0.5),
    ] {
        let plane = Phantom::plane(u, v, MapSize::from_width(256));
        let mut heat = HeatMap::new(plane.size, lossless());
        heat.deposit(&plane.surface(), &plane.gaussian(DVec2::splat(0.5), deviation_m), 0.1);
        let (_, place, before) = plane.moments(&heat);
        assert!((before.x_axis.x / deviation_m.powi(2) - 1.0).abs() < 0.01, "{before}");
        plane.rest(&mut heat, seconds);
        let (_, place_after, after) = plane.moments(&heat);
        let grown = 2.0 * 1.4e-7 * seconds;
        let growth = after - before;
        assert!((growth.x_axis.x / grown - 1.0).abs() < 0.02, "{u} {v}: {growth}");
        assert!((growth.y_axis.y / grown - 1.0).abs() < 0.02, "{u} {v}: {growth}");
        assert!(growth.x_axis.y.abs() < 0.02 * grown, "{u} {v}: {growth}");
        assert!(place.distance(place_after) < 1e-5, "{place} {place_after}");
    }
}

#[test]
fn a_gaussian_on_a_sphere_widens_alike_at_equator_date_line_and_poles() {
    let sphere = sphere();
    for uv in [(0.3, 0.5), (0.0, 0.45), (0.2, 0.12), (0.7, 0.02), (0.0, 0.0), (0.4, 1.0)] {
        let mut heat = HeatMap::new(sphere.size, lossless());
        heat.deposit(&sphere.surface(), &sphere.gaussian(uv.into(), 0.002), 5.0);
        let (_, place, before) = sphere.moments(&heat);
        sphere.rest(&mut heat, 10.0);
        let (_, place_after, after) = sphere.moments(&heat);
        let trace = |m: DMat3| m.x_axis.x + m.y_axis.y + m.z_axis.z;
        let growth = (trace(after) - trace(before)) / (4.0 * 1.4e-7 * 10.0);
        // The chords are a little shorter than the arcs.
        assert!((growth - 1.0).abs() < 0.03, "{uv:?}: {growth}");
        assert!(place.distance(place_after) < 1e-4, "{uv:?}: {place} {place_after}");
        // Round: the two directions along the surface grow alike.
        let normal = place.normalize();
        let (a, b) = normal.any_orthonormal_pair();
        let (a2, b2, ab) = (a.dot((after - before) * a), b.dot((after - before) * b), a.dot((after - before) * b));
        let ratio = ((a2 + b2) / 2.0 + ((a2 - b2) / 2.0).hypot(ab)) / ((a2 + b2) / 2.0 - ((a2 - b2) / 2.0).hypot(ab));
        assert!(ratio < 1.05, "{uv:?}: {ratio}");
    }
}

#[test]
fn cooling_alone_is_exponential() {
    let plane = Phantom::grid(2.5e-4);
    let settings = HeatSettings { diffusivity_m2_per_s: 0.0, ..Default::default() };
    let spot = plane.spot(DVec2::splat(0.5), 0.002, |_| 1.0);
    let (x, y, _) = spot[spot.len() / 2];
    for (dt_s, steps) in [(STEP_S, 300), (0.5, 10), (5.0, 1)] {
        let mut heat = HeatMap::new(plane.size, settings);
        heat.deposit(&plane.surface(), &spot, 2.0);
        let before = heat.temperature_rise_k(x, y);
        for _ in 0..steps {
            heat.step(&plane.surface(), dt_s);
        }
        let wanted = before * (-5.0f32 / 2.9).exp();
        assert!((heat.temperature_rise_k(x, y) / wanted - 1.0).abs() < 1e-4, "{dt_s}");
    }
}

#[test]
fn energy_stays_over_date_line_and_poles() {
    let ellipsoid = Phantom::ellipsoid(512);
    for uv in [(0.0, 0.4), (0.3, 0.0), (0.9, 1.0), (0.999, 0.01), (0.5, 0.5)] {
        let mut heat = HeatMap::new(ellipsoid.size, lossless());
        heat.deposit(&ellipsoid.surface(), &ellipsoid.gaussian(uv.into(), 0.0015), 3.0);
        assert!((heat.total_energy_j() / 3.0 - 1.0).abs() < 1e-6, "{uv:?}: {}", heat.total_energy_j());
        ellipsoid.rest(&mut heat, 10.0);
        assert!((heat.total_energy_j() / 3.0 - 1.0).abs() < 2e-6, "{uv:?}: {}", heat.total_energy_j());
    }
}

#[test]
fn a_single_tiny_texel_spreads_without_loss_or_overshoot() {
    // From texels that need one stage to those whose exchange is bounded.
    for texel_m in [1e-4, 4e-5, 2e-5, 5e-6] {
        let plane = Phantom::grid(texel_m);
        let mut heat = HeatMap::new(plane.size, lossless());
        let energy_j = 1000.0 * 3800.0 * f64::from(texel_m).powi(2);
        heat.deposit(&plane.surface(), &[(128, 64, 1.0)], energy_j);
        let mut peak_k = heat.temperature_rise_k(128, 64);
        for _ in 0..20 {
            heat.step(&plane.surface(), STEP_S);
            let highest_k = plane.texels().map(|(x, y)| heat.temperature_rise_k(x, y)).fold(0.0, f32::max);
            assert!(highest_k <= peak_k, "{texel_m}: {highest_k} after {peak_k}");
            peak_k = highest_k;
            assert!((heat.total_energy_j() / energy_j - 1.0).abs() < 1e-3, "{texel_m}: {}", heat.total_energy_j());
        }
    }
}

#[test]
fn heat_goes_over_date_line_and_pole_as_over_a_plane() {
    let ellipsoid = Phantom::ellipsoid(512);
    let (seconds, rise_k) = (10.0, 100.0f64);
    let place = |x: u32, y: u32| ellipsoid.position_m(ellipsoid.uv(x, y));
    // Half a disk that ends at the date line, or at the pole; texels on its own and on the other side.
    for (uv, is_source, probes) in [
        (
            (0.0, 0.5),
            (|x| x > 256) as fn(u32) -> bool,
            [(509, 1, 128), (511, 1, 128), (0, 1, 128), (1, 1, 128), (3, 1, 128)],
        ),
        // About the pole a quarter of the row is one cell.
        ((0.25, 0.0), |x| x < 256, [(128, 1, 4), (128, 1, 2), (128, 128, 0), (256, 128, 0), (384, 1, 3)]),
    ] {
        let mut texels = ellipsoid.spot(uv.into(), 0.003, |_| 1.0);
        texels.retain(|&(x, _, _)| is_source(x));
        let areas_m2: Vec<f64> = texels.iter().map(|&(x, y, _)| ellipsoid.area_m2(x, y)).collect();
        let mut heat = HeatMap::new(ellipsoid.size, lossless());
        let capacity = heat.settings().areal_capacity_j_per_m2_k();
        heat.deposit(&ellipsoid.surface(), &texels, rise_k * capacity * areas_m2.iter().sum::<f64>());
        ellipsoid.rest(&mut heat, seconds);
        for (x, count, y) in probes {
            // Every texel of the source spreads as the plane's heat kernel.
            let four_at_m2 = 4.0 * 1.4e-7 * seconds;
            let kernel = |&(from_x, from_y, _): &(u32, u32, f32), to: DVec3| {
                (-place(from_x, from_y).distance_squared(to) / four_at_m2).exp() / (PI * four_at_m2)
            };
            let at = |to: DVec3| texels.iter().zip(&areas_m2).map(|(from, area)| area * kernel(from, to)).sum::<f64>();
            let wanted = rise_k * (x..x + count).map(|x| at(place(x, y))).sum::<f64>() / f64::from(count);
            let got = f64::from(heat.temperature_rise_k(x, y));
            assert!((got / wanted - 1.0).abs() < 0.03, "{x}, {y}: {got} {wanted}");
        }
    }
}

#[test]
fn no_heat_leaves_the_borders_of_an_open_surface() {
    let plane = Phantom::grid(2.5e-4);
    let mut heat = HeatMap::new(plane.size, lossless());
    heat.deposit(&plane.surface(), &plane.spot(DVec2::new(0.0, 0.5), 0.002, |_| 1.0), 1.0);
    plane.rest(&mut heat, 10.0);
    assert!((heat.total_energy_j() - 1.0).abs() < 2e-6, "{}", heat.total_energy_j());
    assert_eq!(heat.temperature_rise_k(255, 64), 0.0, "nothing wraps");
    // The profile is the even one of a plane without a border, and such a bell falls by 1 : 2 over its first texels.
    let [a, b, c] = [0, 1, 2].map(|x| heat.temperature_rise_k(x, 64).ln());
    assert!(((b - c) / (a - b) - 2.0).abs() < 0.05, "{a} {b} {c}");
}

#[test]
fn all_energy_arrives_at_any_resolution() {
    let mesh = procedural_ellipsoid(Vec3::new(0.06, 0.04, 0.05), 12);
    let (chart, _) = chart::build(&mesh, &ChartOptions::default()).expect("an ellipsoid has a chart");
    let unit = Cautery::default();
    let centre = DVec2::new(0.31, 0.42);
    let mut peaks = Vec::new();
    for width in [512, 1024, 2048, 4096] {
        let phantom = Phantom::new(&mesh, Atlas::Spherical(chart.clone()), MapSize::from_width(width));
        let mut heat = HeatMap::new(phantom.size, lossless());
        heat.deposit(&phantom.surface(), &phantom.spot(centre, 0.003, Cautery::weight), 1.5);
        let spot = phantom.spot(centre, 0.004, |_| 1.0);
        let measured: f64 =
            spot.iter().map(|&(x, y, _)| f64::from(heat.temperature_rise_k(x, y)) * phantom.area_m2(x, y)).sum();
        let measured_j = measured * heat.settings().areal_capacity_j_per_m2_k();
        assert!((measured_j / 1.5 - 1.0).abs() < 0.01, "{width}: {measured_j}");

        let mut heat = HeatMap::new(phantom.size, HeatSettings::default());
        let (from, to) =
            (phantom.beside(centre, DVec2::new(-0.006, -0.002)), phantom.beside(centre, DVec2::new(0.006, 0.002)));
        phantom.pass(&mut heat, &unit, from, to, 0.02);
        phantom.rest(&mut heat, 1.0);
        peaks.push(phantom.peak_dose(&heat, centre, 0.001));
    }
    assert!(peaks.iter().all(|peak| (peak / peaks[3] - 1.0).abs() < 0.03), "{peaks:?}");
}

#[test]
fn conducted_heat_above_the_threshold_counts() {
    let plane = Phantom::grid(2.5e-4);
    let spot = plane.spot(DVec2::splat(0.5), 0.0015, |_| 1.0);
    let beside = plane.beside(DVec2::splat(0.5), DVec2::new(0.0019, 0.0));
    let mut heat = HeatMap::new(plane.size, HeatSettings { ceiling_rise_k: 2000.0, ..Default::default() });
    // Two hundred and fifty kelvin in the spot.
    heat.deposit(&plane.surface(), &spot, 250.0 * 3800.0 * spot.len() as f64 * 6.25e-8);
    let direct = plane.dose_at(&heat, DVec2::splat(0.5));
    assert!((direct / ((250.0 - 23.0) * 3800.0 * 1e-6) - 1.0).abs() < 1e-4, "{direct}");
    assert_eq!(plane.dose_at(&heat, beside), 0.0);
    plane.rest(&mut heat, 2.0);
    let conducted = plane.dose_at(&heat, beside);
    assert!(conducted > 0.02 && conducted < 0.5 * direct, "{conducted}");
    assert_eq!(plane.dose_at(&heat, DVec2::splat(0.5)), direct, "cooling neither adds nor takes");
    // Below the threshold nothing lasts.
    let mut mild = HeatMap::new(plane.size, HeatSettings::default());
    mild.deposit(&plane.surface(), &spot, 20.0 * 3800.0 * spot.len() as f64 * 6.25e-8);
    plane.rest(&mut mild, 2.0);
    assert!(all_doses(&plane, &mild).iter().all(|&dose| dose == 0.0));
}

#[test]
fn steps_of_any_length_tell_the_same_story() {
    let plane = Phantom::grid(2.5e-4);
    let spot = plane.spot(DVec2::splat(0.5), 0.00125, Cautery::weight);
    let after = |per_second: u32| {
        let mut heat = HeatMap::new(plane.size, HeatSettings::default());
        for _ in 0..per_second {
            heat.deposit(&plane.surface(), &spot, 4.0 / f64::from(per_second));
            heat.step(&plane.surface(), 1.0 / f64::from(per_second));
        }
        for _ in 0..3 * per_second {
            heat.step(&plane.surface(), 1.0 / f64::from(per_second));
        }
        let beside = plane.beside(DVec2::splat(0.5), DVec2::new(0.0015, 0.0));
        [plane.dose_at(&heat, DVec2::splat(0.5)), plane.dose_at(&heat, beside)]
    };
    let fine = after(240);
    for per_second in [25, 60, 120] {
        let coarse = after(per_second);
        assert!(coarse.iter().zip(&fine).all(|(a, b)| (a / b - 1.0).abs() < 0.05), "{per_second}: {coarse:?} {fine:?}");
    }
}

#[test]
fn energy_beyond_the_ceiling_leaves_and_still_counts() {
    let plane = Phantom::grid(2.5e-4);
    let settings = HeatSettings { ceiling_rise_k: 263.0, ..lossless() };
    let mut heat = HeatMap::new(plane.size, settings);
    let spot = plane.spot(DVec2::splat(0.5), 0.002, |_| 1.0);
    for _ in 0..60 {
        heat.deposit(&plane.surface(), &spot, 1.0);
        heat.step(&plane.surface(), STEP_S);
    }
    let sum = heat.total_energy_j() + heat.vented_energy_j();
    assert!((sum / 60.0 - 1.0).abs() < 1e-5 && heat.vented_energy_j() > 20.0, "{sum}");
    assert!(plane.texels().all(|(x, y)| heat.temperature_rise_k(x, y) <= 263.001));
    let per_mm2 = 60.0 / (spot.len() as f64 * 0.0625);
    let received = f64::from(plane.dose_at(&heat, DVec2::splat(0.5))) + 23.0 * 3800e-6;
    assert!((received / per_mm2 - 1.0).abs() < 0.01, "{received} {per_mm2}");
}

#[test]
fn texels_keep_their_temperature_when_the_surface_moves() {
    let mut phantom = Phantom::ellipsoid(512);
    let settings = HeatSettings { diffusivity_m2_per_s: 0.0, ..lossless() };
    let mut heat = HeatMap::new(phantom.size, settings);
    heat.deposit(&phantom.surface(), &phantom.spot(DVec2::new(0.5, 0.5), 0.01, |_| 1.0), 1.0);
    let tiles = heat.hot_tiles();
    for position in &mut phantom.positions_m {
        *position *= 2.0;
    }
    heat.surface_moved();
    phantom.rest(&mut heat, 1.0);
    assert!((heat.total_energy_j() / 4.0 - 1.0).abs() < 1e-5, "four times the area: {}", heat.total_energy_j());
    assert_eq!(heat.hot_tiles(), tiles);
    // New heat is spread over the new areas at once.
    for position in &mut phantom.positions_m {
        *position *= 0.5;
    }
    heat.surface_moved();
    let mut fresh = HeatMap::new(phantom.size, settings);
    let spot = phantom.spot(DVec2::new(0.5, 0.5), 0.004, |_| 1.0);
    let (x, y, _) = spot[spot.len() / 2];
    let before = heat.temperature_rise_k(x, y);
    heat.deposit(&phantom.surface(), &spot, 1.0);
    fresh.deposit(&phantom.surface(), &spot, 1.0);
    assert!((heat.temperature_rise_k(x, y) - before - fresh.temperature_rise_k(x, y)).abs() < 1e-3);
}

#[test]
fn other_settings_hold_from_the_next_step_on() {
    let plane = Phantom::grid(2.5e-4);
    let mut heat = HeatMap::new(plane.size, lossless());
    heat.deposit(&plane.surface(), &plane.gaussian(DVec2::splat(0.5), 0.002), 0.5);
    plane.rest(&mut heat, 0.1);
    let (_, _, before) = plane.moments(&heat);
    heat.set_settings(HeatSettings { diffusivity_m2_per_s: 5.6e-7, ..lossless() });
    plane.rest(&mut heat, 5.0);
    let (_, _, after) = plane.moments(&heat);
    let growth = (after - before).x_axis.x / (2.0 * 5.6e-7 * 5.0);
    assert!((growth - 1.0).abs() < 0.02, "{growth}");
    heat.set_settings(HeatSettings { cooling_time_s: -1.0, ..lossless() });
    assert_eq!(heat.settings().cooling_time_s, 0.01);
    plane.rest(&mut heat, 1.0);
    assert_eq!(heat.hot_tiles(), 0);
}
