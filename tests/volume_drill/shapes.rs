//! What shape a burr leaves.

use super::phantom::{PLENTY_N, Phantom, all_of, ball, cylinder, matchstick, resting, upright};
use bevy_surgery::volume::VolumeGrid;
use bevy_surgery::volume::cut::{Burr, BurrPose, BurrStroke, CutVolume};
use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot, UVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f64::consts::PI;

fn cubes(side: u32, spacing_mm: f64) -> VolumeGrid {
    VolumeGrid::upright(UVec3::splat(side), DVec3::splat(spacing_mm))
}

/// A grid whose axes are columns, in a turned patient.
fn turned(size: UVec3, axes_mm: DMat3) -> VolumeGrid {
    let turn = DMat3::from_quat(DQuat::from_euler(EulerRot::XYZ, 0.7, -0.4, 2.1));
    VolumeGrid {
        size,
        lps_mm_from_voxel: DAffine3::from_mat3_translation(turn * axes_mm, DVec3::new(3.0, -40.0, 11.0)),
    }
}

/// Points in the volume's space, millimetres, where the remaining opacity crosses one half on an edge of the grid.
fn surface_mm(cut: &CutVolume, grid: &VolumeGrid) -> Vec<DVec3> {
    let size = grid.size;
    let volume_from_voxel = grid.volume_from_voxel();
    let mut points = Vec::new();
    for index in 0..grid.count() as u32 {
        let voxel = UVec3::new(index % size.x, index / size.x % size.y, index / (size.x * size.y));
        let a = cut.remaining(voxel) - 0.5;
        for axis in [UVec3::X, UVec3::Y, UVec3::Z] {
            if (voxel + axis).cmpge(size).any() {
                continue;
            }
            let b = cut.remaining(voxel + axis) - 0.5;
            if (a < 0.0) != (b < 0.0) {
                let at = voxel.as_vec3() + axis.as_vec3() * (a / (a - b));
                points.push(volume_from_voxel.transform_point3(at).as_dvec3() * 1e3);
            }
        }
    }
    points
}

/// Centre and radius of the ball that fits points best: least squares of |p|² - 2 p·c - (r² - |c|²).
fn fit_ball(points: &[DVec3]) -> (DVec3, f64) {
    let mut normal = [[0.0; 5]; 4];
    for point in points {
        let row = [2.0 * point.x, 2.0 * point.y, 2.0 * point.z, 1.0, point.length_squared()];
        for i in 0..4 {
            for j in 0..5 {
                normal[i][j] += row[i] * row[j];
            }
        }
    }
    for i in 0..4 {
        let pivot = (i..4).max_by(|&a, &b| normal[a][i].abs().total_cmp(&normal[b][i].abs())).expect("rows");
        normal.swap(i, pivot);
        for k in 0..4 {
            if k != i {
                let (factor, row) = (normal[k][i] / normal[i][i], normal[i]);
                for (entry, from) in normal[k].iter_mut().zip(row) {
                    *entry -= factor * from;
                }
            }
        }
    }
    let [x, y, z, rest] = [0, 1, 2, 3].map(|i| normal[i][4] / normal[i][i]);
    let centre = DVec3::new(x, y, z);
    (centre, (rest + centre.length_squared()).sqrt())
}

/// Fits a ball to a cavity: deviation of its surface, and difference of the mean radii by axis, both in millimetres.
fn roundness(points: &[DVec3], centre_mm: DVec3) -> (f64, f64, f64) {
    let (centre, radius) = fit_ball(points);
    assert!(centre.distance(centre_mm) < 0.05, "the cavity lies {} mm off", centre.distance(centre_mm));
    let deviation = points.iter().map(|point| (point.distance(centre) - radius).abs()).fold(0.0, f64::max);
    let mean_along = |axis: usize| {
        let near = points.iter().filter(|&&point| (point - centre).normalize()[axis].abs() > 0.8);
        let (sum, count) = near.fold((0.0, 0.0), |(sum, count), point| (sum + point.distance(centre), count + 1.0));
        sum / count
    };
    let radii = [0, 1, 2].map(mean_along);
    let differ = radii.iter().fold(0.0, |most: f64, &r| most.max((r - radius).abs()));
    (radius, deviation, differ)
}

#[test]
fn a_ball_leaves_a_ball() {
    let at_mm = DVec3::new(0.37, -0.21, 0.13);
    let grids = [
        ("cubes of 0.4 mm", cubes(40, 0.4), 0.4),
        ("cubes of 0.2 mm", cubes(70, 0.2), 0.2),
        ("cubes of 0.1 mm", cubes(120, 0.1), 0.1),
        ("slabs", VolumeGrid::upright(UVec3::new(60, 60, 30), DVec3::new(0.2, 0.2, 0.5)), 0.2),
        ("turned slabs", turned(UVec3::new(60, 60, 30), DMat3::from_diagonal(DVec3::new(0.2, 0.25, 0.5))), 0.2),
        (
            "skewed and mirrored",
            turned(
                UVec3::new(90, 80, 60),
                DMat3::from_cols(DVec3::new(0.2, 0.0, 0.0), DVec3::new(0.06, -0.2, 0.0), DVec3::new(0.0, 0.1, 0.25)),
            ),
            0.2,
        ),
    ];
    for (name, grid, voxel_mm) in grids {
        let phantom = Phantom::solid(grid);
        for diameter_mm in [2.0, 4.0, 6.0] {
            // With plenty of force at once, and shrunk to a part of it by what little there is.
            for (force_n, seconds) in [(PLENTY_N, 0.1), (4.0, 0.2)] {
                let mut cut = phantom.cut();
                let stroke = resting(ball(diameter_mm), upright(at_mm), force_n);
                let removal = phantom.drill(&mut cut, &stroke, seconds);
                let (radius, deviation, differ) = roundness(&surface_mm(&cut, &grid), at_mm);
                let expected = (removal.total_mm3 / PI * 0.75).cbrt();
                println!(
                    "{name}, {diameter_mm} mm: radius {radius:.3} of {expected:.3}, deviation {:.3} voxel, axes differ {:.3} voxel",
                    deviation / voxel_mm,
                    differ / voxel_mm
                );
                assert!(deviation < 0.5 * voxel_mm, "{name}, {diameter_mm} mm, {force_n} N: {deviation} mm");
                assert!(differ < 0.1 * voxel_mm, "{name}, {diameter_mm} mm, {force_n} N: {differ} mm");
                assert!((radius - expected).abs() < 0.25 * voxel_mm, "{name}: {radius} mm, not {expected}");
            }
        }
    }
}

#[test]
fn a_cavity_drilled_by_and_by_is_as_round() {
    let grid = cubes(70, 0.2);
    let phantom = Phantom::solid(grid);
    let (mut cut, at_mm) = (phantom.cut(), DVec3::new(0.07, -0.11, 0.03));
    let stroke = resting(ball(6.0), upright(at_mm), 2.0);
    let mut last = 0.0;
    for _ in 0..5 {
        for _ in 0..400 {
            phantom.drill(&mut cut, &stroke, 1e-3);
        }
        let (radius, deviation, differ) = roundness(&surface_mm(&cut, &grid), at_mm);
        assert!(deviation < 0.1 && differ < 0.02, "deviation {deviation} mm, axes differ by {differ} mm");
        assert!(radius > last + 0.05, "it grows: {last} {radius}");
        last = radius;
    }
}

#[test]
fn small_burrs_remove_their_own_volume() {
    // Mean over places and directions; a single one depends on how it lies among the voxels.
    let mut rng = Pcg32::seed_from_u64(3);
    let grids = [
        ("cubes", cubes(48, 0.4)),
        ("slabs", turned(UVec3::new(60, 60, 40), DMat3::from_diagonal(DVec3::new(0.3, 0.3, 0.6)))),
        (
            "skewed",
            turned(
                UVec3::new(60, 60, 60),
                DMat3::from_cols(DVec3::new(0.4, 0.0, 0.0), DVec3::new(0.1, 0.4, 0.0), DVec3::new(-0.1, 0.15, 0.4)),
            ),
        ),
    ];
    for (name, grid) in grids {
        let phantom = Phantom::solid(grid);
        for burr in [ball(1.0), ball(1.6), ball(2.4), cylinder(1.6, 2.4), cylinder(2.4, 4.0), matchstick(1.6, 4.0)] {
            let mut mean = 0.0;
            let places = 60;
            for _ in 0..places {
                let axis = Vec3::from_array([0; 3].map(|_| rng.random_range(-1.0..1.0f32)));
                let centre_m = Vec3::from_array([0; 3].map(|_| rng.random_range(-1e-3..1e-3f32)));
                let stroke = resting(burr, BurrPose { centre_m, axis }, PLENTY_N);
                mean += phantom.drill(&mut phantom.cut(), &stroke, 1.0).total_mm3 / f64::from(places);
            }
            let ratio = mean / burr.volume_mm3();
            println!("{name}, {:?} {} mm: {ratio:.4} of its volume", burr.shape, burr.diameter_m * 1e3);
            assert!((ratio - 1.0).abs() < 0.02, "{name}, {burr:?}: {ratio} of its volume");
        }
    }
}

#[test]
fn what_remains_follows_the_burrs_outline() {
    // Away from the surface by more than a voxel's diagonal all of a voxel is there or none.
    for (name, grid) in [
        ("cubes", cubes(64, 0.2)),
        ("slabs", turned(UVec3::new(60, 60, 30), DMat3::from_diagonal(DVec3::new(0.2, 0.25, 0.4)))),
    ] {
        let phantom = Phantom::solid(grid);
        for burr in [ball(4.0), cylinder(3.0, 5.0), matchstick(2.0, 6.0)] {
            let axis = Vec3::new(0.4, -0.7, 0.6).normalize();
            let centre_m = Vec3::new(0.3e-3, -0.2e-3, 0.1e-3);
            let mut cut = phantom.cut();
            phantom.drill(&mut cut, &resting(burr, BurrPose { centre_m, axis: axis * 5.0 }, PLENTY_N), 1.0);
            let to_burr = glam::Quat::from_rotation_arc(axis, Vec3::Y);
            let (spacing, mut worst) = (grid.spacing_mm(), 0.0f32);
            for (index, remaining) in all_of(&cut).into_iter().enumerate() {
                let index = index as u32;
                let size = grid.size;
                let voxel = UVec3::new(index % size.x, index / size.x % size.y, index / (size.x * size.y));
                let at = grid.volume_from_voxel().transform_point3(voxel.as_vec3());
                let mm = burr.signed_distance_m(to_burr * (at - centre_m)) * 1e3;
                if mm.abs() > spacing.max_element() as f32 {
                    assert_eq!(remaining, if mm < 0.0 { 0.0 } else { 1.0 }, "{name}, {burr:?}, {mm} mm");
                } else if name == "cubes" {
                    worst = worst.max((remaining - (0.5 + mm / 0.2).clamp(0.0, 1.0)).abs());
                }
            }
            assert!(worst < 0.12, "{burr:?}: {worst}");
        }
    }
}

/// Removed mm³ per millimetre along x.
fn along_x(cut: &CutVolume, grid: &VolumeGrid) -> Vec<f64> {
    let mut planes = vec![0.0; grid.size.x as usize];
    for (index, remaining) in all_of(cut).into_iter().enumerate() {
        planes[index % grid.size.x as usize] += 1.0 - f64::from(remaining);
    }
    let spacing = grid.spacing_mm();
    planes.into_iter().map(|sum| sum * spacing.y * spacing.z).collect()
}

#[test]
fn a_fast_stroke_leaves_no_beads() {
    let grid = VolumeGrid::upright(UVec3::new(160, 60, 60), DVec3::splat(0.2));
    let phantom = Phantom::solid(grid);
    // 24 mm in one step: 1.4 m/s.
    for (burr, axis, area_mm2, share) in [
        (ball(4.0), Vec3::Y, PI * 4.0, 0.002),
        (ball(2.0), Vec3::Y, PI, 0.002),
        (ball(1.0), Vec3::Y, PI * 0.25, 0.008),
        (cylinder(3.0, 5.0), Vec3::Y, 15.0, 0.01),
        (cylinder(3.0, 5.0), Vec3::X, PI * 2.25, 0.002),
        (matchstick(3.0, 6.0), Vec3::Y, PI * 2.25 + 9.0, 0.01),
    ] {
        for steps in [1, 7, 200] {
            let mut cut = phantom.cut();
            let pose =
                |share: f32| BurrPose { centre_m: Vec3::new((-12.0 + 24.0 * share) * 1e-3, 0.13e-3, -0.07e-3), axis };
            for step in 0..steps {
                let (from, to) = (pose(step as f32 / steps as f32), pose((step + 1) as f32 / steps as f32));
                let stroke = BurrStroke { from, to, ..resting(burr, from, PLENTY_N) };
                phantom.drill(&mut cut, &stroke, 0.02);
            }
            let areas = &along_x(&cut, &grid)[45..115];
            let (least, most) = areas.iter().fold((f64::MAX, 0.0_f64), |(a, b), &area| (a.min(area), b.max(area)));
            println!(
                "{:?} {} mm, {steps} steps: {least:.3} to {most:.3} of {area_mm2:.3} mm2",
                burr.shape,
                burr.diameter_m * 1e3
            );
            assert!(most - least < 0.01 * area_mm2, "{burr:?}, {steps} steps: beads, {least} to {most} mm2");
            assert!((least / area_mm2 - 1.0).abs() < share, "{burr:?}, {steps} steps: {least} of {area_mm2} mm2");
        }
    }
}

#[test]
fn a_turning_cylinder_leaves_no_ridges() {
    let grid = cubes(80, 0.2);
    let phantom = Phantom::solid(grid);
    let burr = cylinder(2.0, 10.0);
    let swing = |steps: u32| {
        let mut cut = phantom.cut();
        let pose = |step: u32| {
            let (sin, cos) = (step as f32 / steps as f32 * 1.2).sin_cos();
            BurrPose { centre_m: Vec3::ZERO, axis: Vec3::new(sin, cos, 0.0) }
        };
        for step in 0..steps {
            let (from, to) = (pose(step), pose(step + 1));
            phantom.drill(&mut cut, &BurrStroke { from, to, ..resting(burr, from, PLENTY_N) }, 0.02);
        }
        all_of(&cut).into_iter().map(|remaining| 1.0 - f64::from(remaining)).sum::<f64>()
    };
    let (one, many) = (swing(2), swing(300));
    assert!((one / many - 1.0).abs() < 0.01, "{one} {many} voxels");
}

#[test]
fn holding_still_removes_nothing_more() {
    let phantom = Phantom::block(64);
    for burr in [ball(4.0), cylinder(3.0, 5.0), matchstick(2.0, 6.0)] {
        let mut cut = phantom.cut();
        let (from, to) = (upright(DVec3::new(-3.1, 9.0, 0.3)), upright(DVec3::new(4.7, 8.1, 1.9)));
        let stroke = BurrStroke { from, to, ..resting(burr, from, PLENTY_N) };
        assert!(phantom.drill(&mut cut, &stroke, 0.016).total_mm3 > 10.0);
        let before = cut.clone();
        for dt_s in [0.016, 0.001, 5.0] {
            let again = phantom.drill(&mut cut, &resting(burr, to, PLENTY_N), dt_s);
            assert_eq!(again, Default::default(), "{burr:?}");
        }
        assert_eq!(phantom.drill(&mut cut, &stroke, 0.016).changed, None, "the same way again");
        assert_eq!(cut.revision(), before.revision());
        assert!(cut == before);
    }
}

#[test]
fn a_way_cut_in_many_steps_is_the_same_way() {
    let phantom = Phantom::solid(cubes(72, 0.2));
    let along = |steps: u32| {
        let mut cut = phantom.cut();
        let path = |t: f64| DVec3::new(-3.0 + 6.0 * t, -2.0 + 3.0 * t, 1.0 - 1.5 * t);
        phantom.follow(&mut cut, ball(3.0), PLENTY_N, steps, 1.0, path);
        all_of(&cut)
    };
    let one = along(1);
    for steps in [3, 60, 1000] {
        let most = along(steps).iter().zip(&one).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(most < 1e-3, "{steps} steps differ by {most}");
    }
}

#[test]
fn empty_voxels_beside_bone_are_lowered_for_nothing() {
    // Bone below, air above: else interpolation would mix untouched air into the cut surface.
    let grid = cubes(40, 0.25);
    let phantom = Phantom::new(grid, |voxel| (if voxel.y < 20 { 255 } else { 0 }, 2));
    let mut cut = phantom.cut();
    let burr: Burr = ball(4.0);
    let removal = phantom.drill(&mut cut, &resting(burr, upright(DVec3::ZERO), PLENTY_N), 1.0);
    assert!((removal.total_mm3 / (0.5 * burr.volume_mm3()) - 1.0).abs() < 0.01, "{removal:?}");
    assert_eq!(cut.remaining(UVec3::splat(20)), 0.0);
    assert_eq!(cut.remaining(UVec3::new(20, 25, 20)), 0.0);
    // Far from all bone nothing is noted.
    let mut cut = phantom.cut();
    let removal = phantom.drill(&mut cut, &resting(ball(2.0), upright(DVec3::new(0.0, 3.5, 0.0)), PLENTY_N), 1.0);
    assert_eq!(removal, Default::default());
    assert_eq!(cut, phantom.cut());
}
