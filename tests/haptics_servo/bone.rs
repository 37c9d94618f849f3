//! Bone under a burr, and under everything else.

use super::scene::bone_below;
use bevy_surgery::haptics::device::DeviceLimits;
use bevy_surgery::haptics::force::{
    BoneBrick, BonePatch, Coupling, Obstacle, Proxy, SurfaceFeel, ToolCapsule, TurningBurr, overlap,
};
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrShape};
use glam::{DAffine3, DVec3, UVec3, Vec3};
use proptest::prelude::*;
use std::f64::consts::PI;

const BALL: Burr = Burr { kind: BurrKind::Cutting, shape: BurrShape::Sphere, diameter_m: 4e-3 };

fn turning() -> TurningBurr {
    TurningBurr { burr: BALL, speed_rpm: 40_000.0, flutes: 8, friction: 0.3, vibration: 0.0, stiffness_n_per_m: 800.0 }
}

fn coupling() -> Coupling {
    Coupling::new(&DeviceLimits::OMEGA, 1e-3, 1.0, 1.0)
}

#[test]
fn the_overlap_is_the_volume_of_the_cap() {
    for normal in [Vec3::Y, Vec3::NEG_X, Vec3::new(1.0, 2.0, -0.5).normalize()] {
        let brick = bone_below(normal, 40, 0.25e-3);
        let up = normal.as_dvec3();
        for depth_mm in [0.2, 0.5, 1.0, 1.7, 2.5] {
            let (radius_m, depth_m) = (2e-3, depth_mm * 1e-3);
            let found = overlap(&brick, &BALL, up * (radius_m - depth_m), DVec3::Z);
            let cap_m3 = PI * depth_m * depth_m * (3.0 * radius_m - depth_m) / 3.0;
            let cut_m2 = PI * depth_m * (2.0 * radius_m - depth_m);
            // Half a voxel's ramp on both surfaces rounds off what is thin.
            let near = |a: f64, b: f64, share: f64| (a / b - 1.0).abs() < share;
            let share = if depth_mm < 0.4 { 0.3 } else { 0.05 };
            assert!(near(found.volume_m3, cap_m3, share), "{depth_mm} mm along {normal}: {found:?} {cap_m3}");
            assert!(near(found.area_m2, cut_m2, share), "{depth_mm} mm along {normal}: {found:?} {cut_m2}");
            assert!(near(found.depth_m, depth_m, share), "{depth_mm} mm along {normal}: {found:?}");
            assert!(found.normal.dot(up) > 0.998, "{depth_mm} mm along {normal}: {found:?}");
            assert_eq!((found.label, found.hardness), (1, 1.0));
        }
        assert_eq!(overlap(&brick, &BALL, up * 2.3e-3, DVec3::Z).volume_m3, 0.0);
    }
}

#[test]
fn volumes_of_whole_burrs_are_theirs() {
    let side = 80;
    let count = (side * side * side) as usize;
    let scale = DAffine3::from_scale(DVec3::new(0.2e-3, 0.25e-3, 0.22e-3));
    let brick =
        BoneBrick::new(UVec3::splat(side), vec![255; count], vec![3; count], [2.0; 256], scale).expect("a brick");
    let middle_m = scale.transform_point3(DVec3::splat(39.7));
    for shape in [BurrShape::Sphere, BurrShape::Cylinder { length_m: 6e-3 }, BurrShape::Matchstick { length_m: 8e-3 }] {
        let burr = Burr { shape, ..BALL };
        for axis in [DVec3::Y, DVec3::new(1.0, -2.0, 3.0)] {
            let found = overlap(&brick, &burr, middle_m, axis);
            assert!((found.volume_m3 * 1e9 / burr.volume_mm3() - 1.0).abs() < 0.01, "{found:?}");
            assert!(found.centroid_m.distance(middle_m) < 2e-5, "{found:?}");
            assert_eq!((found.label, found.hardness), (3, 2.0));
        }
    }
}

#[test]
fn the_force_of_a_ball_is_the_slope_of_an_energy() {
    // Round a closed way through the rim of an uneven bone, the work of the spring cancels.
    let brick = bone_below(Vec3::new(0.3, 1.0, 0.2).normalize(), 40, 0.25e-3);
    let (mut work_j, mut turned_j) = (0.0, 0.0);
    let at = |turn: f64| DVec3::new(0.8e-3 * turn.cos(), 1.4e-3 + 0.4e-3 * turn.sin(), 0.3e-3 * turn.sin());
    for step in 0..2000 {
        let [from_m, to_m] = [step, step + 1].map(|step| at(f64::from(step) / 2000.0 * 2.0 * PI));
        let found = overlap(&brick, &BALL, (from_m + to_m) * 0.5, DVec3::Y);
        let work = (found.normal * found.depth_m * 800.0).dot(to_m - from_m);
        (work_j, turned_j) = (work_j + work, turned_j + work.abs());
    }
    assert!(work_j.abs() < 0.02 * turned_j, "{work_j} of {turned_j}");
}

#[test]
fn pressing_harder_goes_deeper_and_not_through() {
    let brick = bone_below(Vec3::Y, 48, 0.25e-3);
    let mut last = (0.0, 0.0);
    for pressed_m in [0.2e-3, 0.5e-3, 1.0e-3, 2e-3, 5e-3, 20e-3] {
        let mut place_m = DVec3::Y * 4e-3;
        let mut push = Default::default();
        let goal_m = DVec3::Y * (2e-3 - pressed_m);
        for tick in 1..=200 {
            let towards_m = (DVec3::Y * 4e-3).lerp(goal_m, (f64::from(tick) / 100.0).min(1.0));
            push = turning().push(&brick, place_m, towards_m, towards_m, DVec3::X, &coupling(), 0.0);
            place_m = push.place_m;
        }
        let (depth_m, force_n) = (push.contact.depth_m, push.spring_n.y);
        assert!(force_n > last.0 && depth_m >= last.1 - 1e-6, "{pressed_m}: {push:?}");
        assert!(depth_m < 1.2e-3 && place_m.y > 0.9e-3, "{pressed_m}: {push:?}");
        last = (force_n, depth_m);
    }
    // A jump of the handle to the far side passes no wall.
    let far_m = DVec3::Y * -30e-3;
    let push = turning().push(&brick, DVec3::Y * 2.5e-3, far_m, far_m, DVec3::X, &coupling(), 0.0);
    assert!(push.place_m.y > 0.5e-3 && push.spring_n.y > 0.0, "{push:?}");
}

#[test]
fn the_turning_drags_aside_and_shakes() {
    let brick = bone_below(Vec3::Y, 40, 0.25e-3);
    let place_m = DVec3::Y * 1.5e-3;
    let push = |burr: TurningBurr, phase| burr.push(&brick, place_m, place_m, place_m, DVec3::X, &coupling(), phase);
    let still = push(turning(), 0.0);
    // Axis X, bone below: the lower side moves along x cross -y = -z; bone drags the burr towards +z.
    assert!((still.turning_n - DVec3::Z * 0.3 * still.spring_n.y).length() < 0.02 * still.spring_n.y, "{still:?}");
    let back = push(TurningBurr { speed_rpm: -40_000.0, ..turning() }, 0.0);
    assert!((back.turning_n + still.turning_n).length() < 1e-9);
    let shaking = TurningBurr { vibration: 0.1, ..turning() };
    let swing = push(shaking, 0.25).turning_n - push(shaking, 0.75).turning_n;
    assert!((swing.length() / (0.2 * still.spring_n.length()) - 1.0).abs() < 1e-6, "{swing}");
    assert_eq!(shaking.strikes_hz(), 40_000.0 / 60.0 * 8.0);
    assert!(shaking.shown_hz(1e-3) <= 300.0 && shaking.shown_hz(1e-3) > 150.0);
    let slow = TurningBurr { speed_rpm: 900.0, flutes: 2, ..turning() };
    assert_eq!(slow.shown_hz(1e-3), 30.0);
}

#[test]
fn harder_bone_is_stiffer() {
    let brick = |hardness: f32| {
        let plain = bone_below(Vec3::Y, 40, 0.25e-3);
        let solid = (0..40_u32.pow(3)).map(|i| plain.solid(UVec3::new(i % 40, i / 40 % 40, i / 1600)));
        let (solid, label) = (solid.collect(), vec![1; 40 * 40 * 40]);
        BoneBrick::new(UVec3::splat(40), solid, label, [hardness; 256], plain.world_from_voxel()).expect("a brick")
    };
    let press = |hardness| {
        let place_m = DVec3::Y * 1.5e-3;
        turning().push(&brick(hardness), place_m, place_m, place_m, DVec3::X, &coupling(), 0.0).spring_n.y
    };
    assert!((press(0.25) / press(1.0) - 0.25).abs() < 1e-6);
    assert!(
        press(100.0) <= DeviceLimits::OMEGA.max_stiffness_n_per_m * 0.55e-3,
        "no stiffer than the device bears: {}",
        press(100.0)
    );
}

#[test]
fn a_probe_stays_on_the_surface_of_the_voxels() {
    let bone = BonePatch::new(bone_below(Vec3::new(0.2, 1.0, 0.1).normalize(), 48, 0.25e-3), SurfaceFeel::BONE);
    assert!(bone.surface.triangle_count() > 3000);
    let up = DVec3::new(0.2, 1.0, 0.1).normalize();
    let surface = [Obstacle::Surface(&bone.surface)];
    let tip = [ToolCapsule { ends_m: [DVec3::ZERO; 2], radius_m: 0.5e-3 }];
    let mut proxy = Proxy::default();
    proxy.step(up * 5e-3, DVec3::ZERO, &tip, &surface, [1.0; 2], &coupling());
    for goal_m in [up * -3e-3, up * -20e-3 + DVec3::X * 1e-3, DVec3::new(2e-3, -4e-3, 1e-3)] {
        let done = proxy.step(goal_m, DVec3::ZERO, &tip, &surface, [1.0; 2], &coupling());
        // A quarter of a voxel of unevenness.
        let height_m = proxy.place_m().dot(up);
        assert!((height_m - 0.5e-3).abs() < 6e-5, "{height_m} at {goal_m}");
        assert!(done.force_n.dot(up) > 0.9 * done.force_n.length(), "{}", done.force_n);
    }
}

#[test]
fn the_surface_goes_on_where_rows_are_longer_than_a_word() {
    let normal = Vec3::new(0.1, 1.0, -0.2).normalize();
    let bone = BonePatch::new(bone_below(normal, 72, 0.25e-3), SurfaceFeel::BONE);
    let (up, surface) = (normal.as_dvec3(), [Obstacle::Surface(&bone.surface)]);
    let tip = [ToolCapsule { ends_m: [DVec3::ZERO; 2], radius_m: 0.5e-3 }];
    let mut proxy = Proxy::default();
    // Cell 63 lies from 6.875 to 7.125 mm.
    for x_m in [-7e-3, 6.8e-3, 6.95e-3, 7e-3, 7.1e-3, 7.3e-3] {
        let aside_m = DVec3::X * x_m - up * (up.x * x_m);
        proxy.reset(aside_m + up * 3e-3);
        proxy.step(aside_m + up * 3e-3, DVec3::ZERO, &tip, &surface, [1.0; 2], &coupling());
        proxy.step(aside_m - up * 1e-3, DVec3::ZERO, &tip, &surface, [1.0; 2], &coupling());
        let height_m = proxy.place_m().dot(up);
        assert!((height_m - 0.5e-3).abs() < 6e-5, "{height_m} at {x_m}");
    }
}

/// Voxels in random, rows of up to more than two words.
fn any_voxels() -> impl Strategy<Value = (UVec3, Vec<u8>)> {
    let size = prop_oneof![(2..12_u32, 2..6_u32, 2..6_u32), (60..140_u32, 2..4_u32, 2..4_u32)];
    size.prop_flat_map(|(x, y, z)| {
        let value = prop_oneof![Just(0), Just(255), any::<u8>()];
        (Just(UVec3::new(x, y, z)), proptest::collection::vec(value, (x * y * z) as usize))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_surface_crosses_every_edge_between_solid_and_empty((size, solid) in any_voxels()) {
        let map = DAffine3::from_scale(DVec3::splat(1e-3));
        let is_solid = |at: UVec3| solid[((at.z * size.y + at.y) * size.x + at.x) as usize] > 127;
        let label = vec![1; solid.len()];
        let brick = BoneBrick::new(size, solid.clone(), label, [1.0; 256], map).expect("a brick");
        let surface = BonePatch::new(brick, SurfaceFeel::BONE).surface;
        let mut cut = 0;
        for i in 0..solid.len() as u32 {
            let at = UVec3::new(i % size.x, i / size.x % size.y, i / size.x / size.y);
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let is_within = |across: usize| at[across] > 0 && at[across] < size[across] - 1;
                let other = at + UVec3::AXES[axis];
                if other[axis] < size[axis] && is_within(u) && is_within(v) && is_solid(at) != is_solid(other) {
                    cut += 1;
                }
            }
        }
        prop_assert_eq!(surface.triangle_count(), 2 * cut);
    }
}

#[test]
fn odd_bricks_and_burrs_are_refused() {
    let new = |count: usize, map| BoneBrick::new(UVec3::splat(2), vec![0; count], vec![0; 8], [1.0; 256], map);
    assert!(new(8, DAffine3::IDENTITY).is_some());
    assert!(new(7, DAffine3::IDENTITY).is_none());
    assert!(new(8, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_none());
    assert!(new(8, DAffine3::from_translation(DVec3::NAN)).is_none());
    let brick = bone_below(Vec3::Y, 8, 0.25e-3);
    for burr in [Burr { diameter_m: f32::NAN, ..BALL }, Burr { diameter_m: 1.0, ..BALL }] {
        assert_eq!(overlap(&brick, &burr, DVec3::ZERO, DVec3::Y).volume_m3, 0.0);
    }
    assert_eq!(overlap(&brick, &BALL, DVec3::NAN, DVec3::Y).volume_m3, 0.0);
    assert_eq!(BonePatch::new(BoneBrick::default(), SurfaceFeel::BONE).surface.triangle_count(), 0);
    let bare = BonePatch::voxels_only(brick.clone(), SurfaceFeel::BONE);
    assert_eq!((bare.surface.triangle_count(), bare.surface.feel, &bare.brick), (0, SurfaceFeel::BONE, &brick));
}
