//! How much is removed: the same at every size of voxels and every length of steps.

use super::phantom::{
    BLOCK_MM, CORE, PLENTY_N, Phantom, SHELL, SPEED_RPM, all_of, ball, cylinder, matchstick, resting, upright,
};
use bevy_surgery::volume::VolumeGrid;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrStroke, Removal};
use glam::{DVec3, UVec3};
use std::f64::consts::PI;
use std::sync::LazyLock;

const SIDES: [u32; 3] = [64, 128, 256];
const STEPS_PER_S: [u32; 3] = [60, 120, 1000];

static PHANTOMS: LazyLock<[Phantom; 3]> = LazyLock::new(|| SIDES.map(Phantom::block));

/// Removed volumes for all sizes of voxels and lengths of steps.
fn volumes_mm3(removed: impl Fn(&Phantom, u32) -> Removal) -> Vec<f64> {
    PHANTOMS.iter().flat_map(|phantom| STEPS_PER_S.map(|rate| removed(phantom, rate).total_mm3)).collect()
}

/// Greatest difference from the mean, as a share of it.
fn spread(volumes: &[f64]) -> f64 {
    let mean = volumes.iter().sum::<f64>() / volumes.len() as f64;
    volumes.iter().map(|volume| (volume / mean - 1.0).abs()).fold(0.0, f64::max)
}

#[test]
fn all_that_a_burr_covers_goes_at_any_resolution_and_rate() {
    // Halfway sunk into the block's face, along a line.
    let seconds = 0.5;
    for diameter_mm in [2.0, 3.0, 4.0, 5.0, 6.0_f64] {
        let path = |t: f64| DVec3::new(-4.0 + 16.0 * t, BLOCK_MM, 0.3 + 1.1 * t);
        let volumes = volumes_mm3(|phantom, rate| {
            phantom.follow(&mut phantom.cut(), ball(diameter_mm as f32), PLENTY_N, rate, seconds, path)
        });
        let r = diameter_mm / 2.0;
        let length = path(0.0).distance(path(seconds));
        let expected = 0.5 * PI * r * r * length + 2.0 / 3.0 * PI * r.powi(3);
        println!("{diameter_mm} mm, geometry: spread {:.3} %", spread(&volumes) * 100.0);
        assert!(spread(&volumes) < 0.02, "{diameter_mm} mm: {volumes:?}");
        for volume in volumes {
            assert!((volume / expected - 1.0).abs() < 0.03, "{diameter_mm} mm: {volume} mm3, not {expected}");
        }
    }
}

#[test]
fn what_the_force_suffices_for_goes_at_any_resolution_and_rate() {
    // Pushed through the core faster than it can cut.
    let (seconds, force_n) = (0.4, 1.5);
    for (diameter_mm, kind) in
        [(2.0, BurrKind::Cutting), (4.0, BurrKind::Cutting), (4.0, BurrKind::Diamond), (6.0, BurrKind::Polishing)]
    {
        let burr = Burr { kind, ..ball(diameter_mm) };
        let volumes = volumes_mm3(|phantom, rate| {
            let path = |t: f64| DVec3::new(-5.0 + 20.0 * t, 2.0 * (9.0 * t).sin(), 0.1);
            phantom.follow(&mut phantom.cut(), burr, force_n, rate, seconds, path)
        });
        let expected = burr.cortical_mm3_per_s(force_n, SPEED_RPM) * seconds;
        println!("{diameter_mm} mm {kind:?}, force: spread {:.4} %", spread(&volumes) * 100.0);
        for volume in volumes {
            assert!((volume / expected - 1.0).abs() < 0.001, "{kind:?}: {volume} mm3, not {expected}");
        }
    }
}

#[test]
fn a_hand_that_scrubs_the_surface_removes_the_same_everywhere() {
    // To and fro, deeper and deeper: through the shell into the core, now limited by force and now by reach.
    for (burr, force_n) in [
        (ball(2.0), 3.0),
        (ball(3.0), 4.0),
        (ball(4.0), 2.0),
        (ball(4.0), 6.0),
        (ball(6.0), 3.0),
        (Burr { kind: BurrKind::Diamond, ..ball(5.0) }, 6.0),
        (cylinder(3.0, 5.0), 4.0),
        (matchstick(2.0, 6.0), 5.0),
    ] {
        let path = |t: f64| {
            let depth = 1.4 * t.powf(0.7) + 0.15 * (31.0 * t).sin();
            let radius_mm = f64::from(burr.diameter_m) * 500.0;
            DVec3::new(4.0 * (5.0 * t).sin(), 3.0 * (2.3 * t).cos() * t, BLOCK_MM + radius_mm - depth)
        };
        let volumes = volumes_mm3(|phantom, rate| phantom.follow(&mut phantom.cut(), burr, force_n, rate, 1.0, path));
        println!("{burr:?} {force_n} N, mixed: spread {:.3} % of {:.3} mm3", spread(&volumes) * 100.0, volumes[8]);
        assert!(spread(&volumes) < 0.05, "{burr:?}: {volumes:?}");
        let budget = burr.cortical_mm3_per_s(force_n, SPEED_RPM);
        assert!(volumes.iter().all(|&volume| volume < budget && volume > 0.1 * budget), "{volumes:?} of {budget}");
    }
}

#[test]
fn volume_is_proportional_to_force_speed_and_time_and_inverse_to_hardness() {
    let phantom = Phantom::block(128);
    let removed = |label: u8, force_n: f32, speed_rpm: f32, dt_s: f64, burr: Burr| {
        let at = if label == CORE.0 { DVec3::ZERO } else { DVec3::new(0.0, 9.64, 0.0) };
        let stroke = BurrStroke { speed_rpm, ..resting(burr, upright(at), force_n) };
        let removal = phantom.drill(&mut phantom.cut(), &stroke, dt_s);
        assert!((removal.total_mm3 - removal.by_label_mm3.iter().map(|(_, mm3)| mm3).sum::<f64>()).abs() < 1e-12);
        // All of it from one structure, so that its hardness counts.
        assert_eq!(removal.by_label_mm3.len(), 1, "{removal:?}");
        assert_eq!(removal.by_label_mm3[0].0, label);
        removal.total_mm3
    };
    let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 3e-4, "{a} is not {b}");
    let cutting = ball(4.0);
    let base = removed(CORE.0, 1.0, 20_000.0, 0.01, cutting);
    near(base, 0.02);
    near(removed(CORE.0, 3.0, 20_000.0, 0.01, cutting), 3.0 * base);
    near(removed(CORE.0, 1.0, 60_000.0, 0.01, cutting), 3.0 * base);
    near(removed(CORE.0, 1.0, 20_000.0, 0.07, cutting), 7.0 * base);
    near(removed(CORE.0, 1.0, 20_000.0, 0.01, ball(6.0)), 1.5 * base);
    near(removed(CORE.0, 1.0, 20_000.0, 0.1, Burr { kind: BurrKind::Diamond, ..cutting }), 2.5 * base);
    near(removed(CORE.0, 1.0, 20_000.0, 0.1, Burr { kind: BurrKind::Polishing, ..cutting }), 0.25 * base);
    near(removed(SHELL.0, 1.0, 20_000.0, 0.01, cutting), base / f64::from(SHELL.1));
}

#[test]
fn structures_add_up_to_what_left_the_volume() {
    // A block with a shell, and sheets thinner than the rows that are worked on at once.
    let grid = VolumeGrid::upright(UVec3::splat(93), DVec3::splat(0.25));
    let sheets = Phantom::new(grid, |voxel| (200, if voxel.x % 8 == 3 { SHELL.0 } else { CORE.0 }));
    for (phantom, force_n) in [(Phantom::block(96), 20.0), (sheets, 5.0)] {
        let mut cut = phantom.cut();
        let path = |t: f64| DVec3::new(-8.0 + 16.0 * t, 11.0 - 3.0 * t, 2.0);
        let burr = ball(3.4);
        let removal = phantom.follow(&mut cut, burr, force_n, 60, 1.0, path);
        let mut by_label = [0.0; 3];
        for ((remaining, &solid), &label) in
            all_of(&cut).into_iter().zip(phantom.structures.solid()).zip(phantom.structures.labels())
        {
            by_label[usize::from(label)] += (1.0 - f64::from(remaining)) * f64::from(solid) / 255.0;
        }
        assert_eq!(removal.by_label_mm3.iter().map(|(label, _)| *label).collect::<Vec<_>>(), [SHELL.0, CORE.0]);
        let mut cost = 0.0;
        for (label, mm3) in removal.by_label_mm3 {
            let expected = by_label[usize::from(label)] * phantom.grid().voxel_mm3();
            assert!(mm3 > 0.5 && (mm3 / expected - 1.0).abs() < 1e-4, "label {label}: {mm3} mm3, not {expected}");
            cost += mm3 * f64::from([0.0, SHELL.1, CORE.1][usize::from(label)]);
        }
        assert!(cost < burr.cortical_mm3_per_s(force_n, SPEED_RPM) * 1.0002, "{cost}");
    }
}

#[test]
fn a_harder_shell_delays_the_burr() {
    // One step's budget over both tissues: hardness times volume is what it costs.
    let phantom = Phantom::block(128);
    let burr = ball(5.0);
    let stroke = resting(burr, upright(DVec3::new(0.0, 9.0, 0.0)), 10.0);
    let removal = phantom.drill(&mut phantom.cut(), &stroke, 0.5);
    let cost: f64 = removal
        .by_label_mm3
        .iter()
        .map(|&(label, mm3)| mm3 * f64::from([0.0, SHELL.1, CORE.1][usize::from(label)]))
        .sum();
    let budget = burr.cortical_mm3_per_s(10.0, SPEED_RPM) * 0.5;
    assert_eq!(removal.by_label_mm3.len(), 2);
    assert!((cost / budget - 1.0).abs() < 3e-4, "{cost} of {budget}");
}

#[test]
fn the_centroid_is_where_the_burr_was() {
    let grid = VolumeGrid::upright(UVec3::new(60, 70, 80), DVec3::new(0.25, 0.2, 0.3));
    let phantom = Phantom::solid(grid);
    let at_mm = DVec3::new(1.3, -2.1, 3.7);
    for force_n in [PLENTY_N, 20.0] {
        let removal = phantom.drill(&mut phantom.cut(), &resting(ball(4.0), upright(at_mm), force_n), 0.05);
        let error = removal.centroid_m.expect("something went") * 1e3 - at_mm;
        assert!(error.length() < 0.01, "{error} mm");
    }
}
