//! The proxy: it never passes, rests and slides as Coulomb has it, and is smooth.

use super::scene::{ball, floor};
use bevy_surgery::haptics::device::DeviceLimits;
use bevy_surgery::haptics::force::{
    ContactPatch, ContactShape, Coupling, HalfSpace, Obstacle, Proxy, SurfaceFeel, SurfacePatch, ToolCapsule,
    nearest_in_all,
};
use glam::{DVec3, Vec3};
use proptest::prelude::*;

const TIP: [ToolCapsule; 1] = [ToolCapsule { ends_m: [DVec3::ZERO; 2], radius_m: 1e-3 }];
const SMOOTH: SurfaceFeel =
    SurfaceFeel { stiffness_n_per_m: 500.0, damping_n_s_per_m: 0.0, static_friction: 0.0, dynamic_friction: 0.0 };
const ROUGH: SurfaceFeel = SurfaceFeel { static_friction: 0.5, dynamic_friction: 0.3, ..SMOOTH };

fn coupling() -> Coupling {
    Coupling::new(&DeviceLimits::OMEGA, 1e-3, 1.0, 1.0)
}

/// A step among things that stand still.
fn step(proxy: &mut Proxy, goal_m: DVec3, obstacles: &[Obstacle]) -> (DVec3, usize) {
    let done = proxy.step(goal_m, DVec3::ZERO, &TIP, obstacles, [1.0; 2], &coupling());
    (done.force_n, done.count)
}

/// Steps along a straight way.
fn go(proxy: &mut Proxy, way: [DVec3; 2], steps: u32, obstacles: &[Obstacle]) -> (DVec3, usize) {
    (1..=steps)
        .fold((DVec3::ZERO, 0), |_, at| step(proxy, way[0].lerp(way[1], f64::from(at) / f64::from(steps)), obstacles))
}

/// Quadrilaterals as one patch.
fn walls(walls: &[[Vec3; 4]]) -> SurfacePatch {
    let triangles = (0..walls.len() as u32).flat_map(|wall| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|c| c + 4 * wall)));
    SurfacePatch::new(walls.as_flattened().to_vec(), triangles.collect(), SMOOTH)
}

#[test]
fn on_a_plane_the_force_is_that_of_the_spring() {
    let patch = floor(0.0, SMOOTH);
    let floor = [Obstacle::Surface(&patch)];
    let mut proxy = Proxy::default();
    let (force_n, count) = step(&mut proxy, DVec3::new(0.01, 0.02, 0.005), &floor);
    assert_eq!((force_n, count), (DVec3::ZERO, 0));
    let (force_n, count) = go(&mut proxy, [DVec3::new(0.01, 0.02, 0.005), DVec3::new(0.01, -0.003, 0.005)], 10, &floor);
    assert_eq!(count, 1);
    assert!((force_n - DVec3::Y * 500.0 * 0.004).length() < 1e-6, "{force_n}: 3 mm and the tip's 1 mm");
    assert!((proxy.place_m() - DVec3::new(0.01, 0.001, 0.005)).length() < 1e-7, "{}", proxy.place_m());
    // All at once is the same: however fast it comes, it does not pass.
    let mut fast = Proxy::default();
    step(&mut fast, DVec3::new(0.01, 0.02, 0.005), &floor);
    let (hit_n, _) = step(&mut fast, DVec3::new(0.01, -0.003, 0.005), &floor);
    assert!((hit_n - force_n).length() < 1e-3, "{hit_n}");
    assert!(fast.place_m().distance(proxy.place_m()) < 2e-6);
}

#[test]
fn in_a_wedge_it_rests_on_the_line_and_in_a_corner_on_the_point() {
    let q = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * 0.1;
    let down = [q(0.0, 0.0, 0.0), q(0.0, 0.0, 1.0), q(1.0, 0.0, 1.0), q(1.0, 0.0, 0.0)];
    let left = [q(0.0, 0.0, 0.0), q(0.0, 1.0, 0.0), q(0.0, 1.0, 1.0), q(0.0, 0.0, 1.0)];
    let back = [q(0.0, 0.0, 0.0), q(1.0, 0.0, 0.0), q(1.0, 1.0, 0.0), q(0.0, 1.0, 0.0)];
    let start = DVec3::splat(0.03);
    let wedge = walls(&[down, left]);
    let mut proxy = Proxy::default();
    let (force_n, count) = go(&mut proxy, [start, DVec3::new(-0.002, -0.004, 0.05)], 30, &[Obstacle::Surface(&wedge)]);
    assert_eq!(count, 2);
    assert!(proxy.place_m().distance(DVec3::new(0.001, 0.001, 0.05)) < 1e-6, "{}", proxy.place_m());
    assert!((force_n - DVec3::new(1.5, 2.5, 0.0)).length() < 1e-3, "{force_n}");
    let corner = walls(&[down, left, back]);
    let mut proxy = Proxy::default();
    let (force_n, count) =
        go(&mut proxy, [start, DVec3::new(-0.002, -0.004, -0.001)], 30, &[Obstacle::Surface(&corner)]);
    assert_eq!(count, 3);
    assert!(proxy.place_m().distance(DVec3::splat(0.001)) < 1e-6, "{}", proxy.place_m());
    assert!((force_n - DVec3::new(1.5, 2.5, 1.0)).length() < 1e-3, "{force_n}");
}

#[test]
fn it_slides_off_an_edge_and_round_it() {
    // A step down: from the upper floor over its edge. The handle stays above the edge itself, so that the nearest place is never two.
    let q = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * 0.1;
    let top = [q(-1.0, 0.0, -1.0), q(-1.0, 0.0, 1.0), q(0.0, 0.0, 1.0), q(0.0, 0.0, -1.0)];
    let side = [q(0.0, 0.0, -1.0), q(0.0, 0.0, 1.0), q(0.0, -1.0, 1.0), q(0.0, -1.0, -1.0)];
    let patch = walls(&[top, side]);
    let edge = [Obstacle::Surface(&patch)];
    let mut proxy = Proxy::default();
    go(&mut proxy, [DVec3::new(-0.01, 0.01, 0.0), DVec3::new(-0.01, 0.0005, 0.0)], 20, &edge);
    let mut last_n = DVec3::Y * 0.25;
    for at in 0..=400 {
        let goal_m = DVec3::new(-0.01 + 0.0125 * f64::from(at) / 400.0, 0.0005, 0.0);
        let (force_n, _) = step(&mut proxy, goal_m, &edge);
        assert!(at == 0 || (force_n - last_n).length() < 0.05, "a jump from {last_n} to {force_n} at {goal_m}");
        last_n = force_n;
        let [x, y, _] = proxy.place_m().to_array();
        assert!(y > 0.001 - 2e-6 || x.hypot(y) > 0.001 - 2e-6 && x > 0.0, "{x} {y}");
    }
    assert!(last_n.length() < 1e-9, "it is past the edge and free: {last_n}");
}

#[test]
fn it_crosses_the_triangles_of_a_plane_without_a_trace() {
    let side = 20_u32;
    let place = |i: u32| Vec3::new((i % side) as f32 * 2e-3 - 0.02, 0.0, (i / side) as f32 * 2e-3 - 0.02);
    let square = |x: u32, z: u32| z * side + x;
    let mut triangles = Vec::new();
    for (x, z) in (0..side - 1).flat_map(|z| (0..side - 1).map(move |x| (x, z))) {
        let [a, b, c, d] = [square(x, z), square(x, z + 1), square(x + 1, z + 1), square(x + 1, z)];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    let patch = SurfacePatch::new((0..side * side).map(place).collect(), triangles, SMOOTH);
    let floor = [Obstacle::Surface(&patch)];
    let mut proxy = Proxy::default();
    go(&mut proxy, [DVec3::new(-0.01, 0.01, -0.013), DVec3::new(-0.01, -0.01, -0.013)], 20, &floor);
    for at in 0..=500 {
        let goal_m = DVec3::new(-0.01 + 0.02 * f64::from(at) / 500.0, -0.01, -0.013 + 0.0173 * f64::from(at) / 500.0);
        let (force_n, _) = step(&mut proxy, goal_m, &floor);
        assert!((force_n - DVec3::Y * 500.0 * 0.011).length() < 2e-3, "{force_n} at {goal_m}");
    }
}

#[test]
fn it_rests_below_the_coefficient_and_slides_above() {
    let patch = floor(0.0, ROUGH);
    let floor = [Obstacle::Surface(&patch)];
    let mut proxy = Proxy::default();
    go(&mut proxy, [DVec3::Y * 0.01, DVec3::Y * -0.003], 20, &floor);
    let depth_m = 0.004;
    // 2 mm aside of 4 mm deep is the limit of 0.5.
    for at in 0..=99 {
        let aside_m = 0.02e-3 * f64::from(at);
        let done = proxy.step(DVec3::new(aside_m, -0.003, 0.0), DVec3::ZERO, &TIP, &floor, [1.0; 2], &coupling());
        assert!(done.sticks, "at {aside_m}");
        assert!((done.force_n - DVec3::new(-aside_m, depth_m, 0.0) * 500.0).length() < 1e-6, "{}", done.force_n);
    }
    for at in 1..=200 {
        let aside_m = 2.05e-3 + 0.05e-3 * f64::from(at);
        let done = proxy.step(DVec3::new(aside_m, -0.003, 0.0), DVec3::ZERO, &TIP, &floor, [1.0; 2], &coupling());
        assert!(!done.sticks);
        let slides = -done.force_n.x / done.force_n.y;
        assert!((slides - 0.3).abs() < 1e-4, "{slides} at {aside_m}");
    }
    // Back to where the pull is nothing it rests again.
    let goal_m = DVec3::new(12.05e-3 - 0.3 * depth_m, -0.003, 0.0);
    let done = proxy.step(goal_m, DVec3::ZERO, &TIP, &floor, [1.0; 2], &coupling());
    assert!(done.sticks && done.force_n.x.abs() < 1e-3, "{}", done.force_n);
}

#[test]
fn it_rides_on_a_surface_that_moves() {
    let corner = |x: f32, z: f32| Vec3::new(0.1 * x, 0.0, 0.1 * z);
    let from = vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    let to: Vec<Vec3> = from.iter().map(|place| *place + Vec3::new(0.001, 0.004, 0.0)).collect();
    let patch = SurfacePatch::moving(from, to, vec![[0, 1, 2], [0, 2, 3]], ROUGH);
    let floor = [Obstacle::Surface(&patch)];
    let goal_m = DVec3::Y * -0.003;
    let mut proxy = Proxy::default();
    for goal_m in [DVec3::Y * 0.01, goal_m, goal_m] {
        proxy.step(goal_m, DVec3::ZERO, &TIP, &floor, [0.0; 2], &coupling());
    }
    let (mut lent_j, mut done_n) = (0.0, DVec3::ZERO);
    for at in 0..16 {
        let shares = [f64::from(at), f64::from(at + 1)].map(|at| at / 16.0);
        let done = proxy.step(goal_m, DVec3::ZERO, &TIP, &floor, shares, &coupling());
        assert!(done.force_n.y > done_n.y, "it pushes ever harder: {}", done.force_n);
        (lent_j, done_n) = (lent_j + done.lent_j, done.force_n);
    }
    assert!(proxy.place_m().distance(DVec3::new(0.001, 0.005, 0.0)) < 1e-6, "{}", proxy.place_m());
    // Work of the surface on the spring: from 4 to 8 mm of 500 N/m, and 1 mm aside.
    let exact_j = 0.5 * 500.0 * (0.008_f64.powi(2) - 0.004_f64.powi(2) + 0.001_f64.powi(2));
    assert!((lent_j / exact_j - 1.0).abs() < 0.05, "{lent_j} {exact_j}");
}

#[test]
fn planes_and_balls_of_elastic_bodies_hold_it() {
    let plane = ContactPatch {
        shape: ContactShape::Plane { point_m: DVec3::ZERO, normal: DVec3::Y * 3.0, radius_m: 0.01 },
        moved_m: DVec3::ZERO,
        feel: SMOOTH,
    };
    let mut proxy = Proxy::default();
    step(&mut proxy, DVec3::Y * 0.01, &[Obstacle::Contact(&plane)]);
    let (force_n, _) = step(&mut proxy, DVec3::Y * -0.001, &[Obstacle::Contact(&plane)]);
    assert!((force_n - DVec3::Y).length() < 1e-9, "{force_n}");
    let ball = ContactPatch { shape: ContactShape::Ball { centre_m: DVec3::ZERO, radius_m: 0.02 }, ..plane };
    let mut proxy = Proxy::default();
    step(&mut proxy, DVec3::new(0.0, 0.03, 0.0), &[Obstacle::Contact(&ball)]);
    let goal_m = DVec3::new(0.006, 0.008, 0.0);
    go(&mut proxy, [DVec3::new(0.0, 0.03, 0.0), goal_m], 200, &[Obstacle::Contact(&ball)]);
    // Deep in a ball the proxy follows within a few ticks.
    let (force_n, _) = go(&mut proxy, [goal_m; 2], 20, &[Obstacle::Contact(&ball)]);
    assert!((force_n - DVec3::new(0.6, 0.8, 0.0) * 500.0 * 0.011).length() < 2e-3, "{force_n}");
}

#[test]
fn a_shaft_leans_on_an_edge() {
    // A wall with its upper edge at the height of 5 mm; the shaft lies across it, the tip hangs beyond.
    let q = |y: f32, z: f32| Vec3::new(0.0, y, z);
    let patch = walls(&[[q(-0.05, -0.05), q(-0.05, 0.05), q(0.005, 0.05), q(0.005, -0.05)]]);
    let tool = [
        ToolCapsule { ends_m: [DVec3::ZERO; 2], radius_m: 1e-3 },
        ToolCapsule { ends_m: [DVec3::ZERO, DVec3::new(0.1, 0.0, 0.0)], radius_m: 2e-3 },
    ];
    let mut proxy = Proxy::default();
    let mut done = Default::default();
    for at in 0..=20 {
        let goal_m = DVec3::new(-0.02, 0.01 - 0.5e-3 * f64::from(at), 0.0);
        done = proxy.step(goal_m, DVec3::ZERO, &tool, &[Obstacle::Surface(&patch)], [1.0; 2], &coupling());
    }
    assert!(proxy.place_m().distance(DVec3::new(-0.02, 0.007, 0.0)) < 1e-6, "{}", proxy.place_m());
    assert!((done.force_n - DVec3::Y * 3.5).length() < 1e-3, "{}", done.force_n);
}

/// A tip and a shaft from it.
fn probe(shaft_m: DVec3) -> [ToolCapsule; 2] {
    [
        ToolCapsule { ends_m: [DVec3::ZERO; 2], radius_m: 1.5e-3 },
        ToolCapsule { ends_m: [DVec3::ZERO, shaft_m], radius_m: 2e-3 },
    ]
}

#[test]
fn what_is_remembered_of_a_patch_changes_nothing() {
    let (places, triangles) = ball(0.02, 4);
    let patch = || SurfacePatch::new(places.clone(), triangles.clone(), ROUGH);
    let (old, mut proxies) = (patch(), [Proxy::default(), Proxy::default()]);
    let mut most = 0;
    for at in 0..600 {
        let turn = f64::from(at) * 0.01;
        // Round the ball and deep in it, with a shaft that swings; now and then a jump.
        let above_m = if at % 97 == 0 { 0.06 } else { (0.05 - 1e-3 * f64::from(at)).max(0.012) };
        let goal_m = DVec3::new(turn.cos(), 0.6 * (turn * 0.7).sin(), turn.sin()) * above_m;
        let shaft_m = DVec3::new((turn * 3.0).cos(), 1.0, (turn * 5.0).sin()) * 0.05;
        // A patch that is made anew has nothing that could be remembered.
        let new = patch();
        let [kept, fresh] = [(0, &old), (1, &new)].map(|(of, patch)| {
            let obstacles = [Obstacle::Surface(patch)];
            let done = proxies[of].step(goal_m, DVec3::ZERO, &probe(shaft_m), &obstacles, [1.0; 2], &coupling());
            (done, proxies[of].place_m())
        });
        assert_eq!(kept, fresh, "tick {at}");
        most = most.max(kept.0.count);
    }
    assert!(most > 1, "it touches");
}

#[test]
fn another_patch_is_looked_at_anew() {
    let floors = |from: i32| {
        let square =
            |x: i32| [[0, -1], [0, 1], [1, 1], [1, -1]].map(|[dx, z]| Vec3::new((x + dx) as f32, 0.0, z as f32) * 0.01);
        walls(&(from..8).map(square).collect::<Vec<_>>())
    };
    let mut proxy = Proxy::default();
    for patch in [floors(-8), floors(-80), floors(-8)] {
        let floor = [Obstacle::Surface(&patch)];
        go(&mut proxy, [DVec3::Y * 1.5e-3, DVec3::Y * -3e-3], 20, &floor);
        go(&mut proxy, [DVec3::Y * -3e-3; 2], 2, &floor);
        assert!(proxy.place_m().distance(DVec3::Y * 1e-3) < 1e-6, "{}", proxy.place_m());
    }
}

#[test]
fn a_shaft_rests_on_a_spike() {
    // Its box has the point in a corner, as far from the middle as can be.
    let (tip, aside) = (Vec3::ZERO, Vec3::new(1e-4, -1e-4, 0.0));
    let foot = Vec3::splat(-0.01);
    let patch = SurfacePatch::new(vec![tip, foot + aside, foot - aside], vec![[0, 1, 2]], SMOOTH);
    let (up, along) = (DVec3::ONE.normalize(), DVec3::new(1.0, 1.0, -2.0).normalize());
    let tool = probe(along * 0.1);
    let mut proxy = Proxy::default();
    for at in 0..=40 {
        let goal_m = up * (0.01 - 0.3e-3 * f64::from(at)) - along * 0.04;
        proxy.step(goal_m, DVec3::ZERO, &tool, &[Obstacle::Surface(&patch)], [1.0; 2], &coupling());
    }
    assert!((proxy.place_m().dot(up) - 2e-3).abs() < 2e-6, "{}", proxy.place_m().dot(up));
}

#[test]
fn one_that_begins_inside_is_let_out() {
    let (places, triangles) = ball(0.02, 3);
    let mut patch = SurfacePatch::new(places, triangles, SMOOTH);
    patch.is_closed = true;
    let solid = [Obstacle::Surface(&patch)];
    let mut proxy = Proxy::default();
    proxy.reset(DVec3::ZERO);
    for at in 0..=300 {
        let (force_n, _) = step(&mut proxy, DVec3::X * 1e-4 * f64::from(at), &solid);
        assert_eq!(force_n, DVec3::ZERO);
    }
    assert!(proxy.is_free());
    let (force_n, _) = go(&mut proxy, [DVec3::X * 0.03, DVec3::ZERO], 100, &solid);
    assert!(force_n.x > 5.0, "from outside it is held: {force_n}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn it_never_enters_a_closed_surface(
        seed in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64, 0.02..1.0_f64), 60),
        splits in 0..4_u32,
    ) {
        let (places, triangles) = ball(0.02, splits);
        let patch = SurfacePatch::new(places.clone(), triangles.clone(), ROUGH);
        let solid = [Obstacle::Surface(&patch)];
        let mut proxy = Proxy::default();
        let mut goal_m = DVec3::Y * 0.03;
        step(&mut proxy, goal_m, &solid);
        for (x, y, z, share) in seed {
            let aim_m = DVec3::new(x, y, z) * 0.03;
            // Some steps are as long as the ball is wide.
            for _ in 0..3 {
                goal_m = goal_m.lerp(aim_m, share);
                let (force_n, _) = step(&mut proxy, goal_m, &solid);
                prop_assert!(force_n.is_finite());
                // Faces of this ball see the origin from behind: a place is outside if it is above one of them.
                let above = triangles.iter().map(|corners| {
                    let [a, b, c] = corners.map(|corner| places[corner as usize].as_dvec3());
                    (b - a).cross(c - a).normalize().dot(proxy.place_m() - a)
                });
                let highest = above.fold(f64::NEG_INFINITY, f64::max);
                prop_assert!(highest > 0.0, "{highest} at {}", proxy.place_m());
                if splits == 3 {
                    prop_assert!(proxy.place_m().length() > 0.0206, "{}", proxy.place_m().length());
                }
            }
        }
    }

    #[test]
    fn a_shaft_aslant_never_enters_either(
        along in (-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64),
        aside in (-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64),
        slides_m in -0.02..0.02_f64,
        length_m in 0.06..0.12_f64,
        splits in 1..5_u32,
    ) {
        let (Some(along), aside) = (DVec3::from(along).try_normalize(), DVec3::from(aside)) else { return Ok(()) };
        let Some(aside) = aside.reject_from_normalized(along).try_normalize() else { return Ok(()) };
        let (places, triangles) = ball(0.02, splits);
        let patch = SurfacePatch::new(places.clone(), triangles, SMOOTH);
        let tool = probe(along * length_m);
        let mut proxy = Proxy::default();
        let mut done = Default::default();
        for at in 0..=60 {
            // The middle of the shaft comes from the side and goes on to near the middle of the ball.
            let share = f64::from(at) / 60.0;
            let middle_m = aside * (0.05 - 0.045 * share) + along * (slides_m * share);
            let goal_m = middle_m - along * (0.5 * length_m);
            done = proxy.step(goal_m, DVec3::ZERO, &tool, &[Obstacle::Surface(&patch)], [1.0; 2], &coupling());
            let nearest_m = places.iter().map(|place| {
                let from_m = place.as_dvec3() - proxy.place_m();
                (from_m - along * from_m.dot(along).clamp(0.0, length_m)).length()
            });
            let nearest_m = nearest_m.fold(f64::INFINITY, f64::min);
            prop_assert!(nearest_m > 2e-3 - 2e-6, "{nearest_m} at {at}");
        }
        prop_assert!(done.count > 0 && done.force_n.dot(aside) > 0.0, "{:?}", done);
    }

    #[test]
    fn the_nearest_free_place_is_the_nearest(
        normals in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64, 0.0..1.0_f64), 1..12),
        goal in (-3.0..3.0_f64, -3.0..3.0_f64, -3.0..3.0_f64),
    ) {
        // The origin is free.
        let spaces: Vec<HalfSpace> = normals
            .iter()
            .filter_map(|&(x, y, z, below)| {
                let normal = DVec3::new(x, y, z).try_normalize()?;
                let (feel, point_m) = (SMOOTH, DVec3::ZERO);
                Some(HalfSpace { normal, offset_m: -below, feel, point_m, obstacle: 0, element: 0 })
            })
            .collect();
        let goal_m = DVec3::from(goal);
        let found = nearest_in_all(goal_m, &spaces).expect("the origin is free");
        prop_assert!(spaces.iter().all(|space| space.height_m(found.place_m) > -1e-8));
        // Nearest: all other free places lie behind the plane through it, at right angles to the way there.
        let way = goal_m - found.place_m;
        let held: DVec3 = (0..found.count).map(|at| spaces[found.held_by[at]].normal * found.push_m[at]).sum();
        prop_assert!((way + held).length() < 1e-6 && found.push_m.iter().all(|&push| push > -1e-9));
        for at in 0..found.count {
            prop_assert!(spaces[found.held_by[at]].height_m(found.place_m).abs() < 1e-6);
        }
    }
}
