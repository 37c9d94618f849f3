//! Heads of drops against closed forms and what else is known of how they move.

use super::*;

/// Way of a body that starts at rest under a constant pull and linear friction.
fn way_m(pull: f64, friction: f64, t: f64) -> f64 {
    if friction == 0.0 { 0.5 * pull * t * t } else { pull / friction * (t + (-friction * t).exp_m1() / friction) }
}

#[test]
fn a_drop_on_an_inclined_plane_follows_the_closed_form() {
    for cells in [1, 100] {
        for degrees in [5.0, 30.0, 60.0, 89.0] {
            // Tilted about X so that downhill is the plane's -Y, then turned about the vertical.
            let tilt = DQuat::from_rotation_x(f64::to_radians(degrees) - PI / 2.0);
            let stage = plane(cells, DQuat::from_rotation_y(0.7) * tilt);
            let pull = GRAVITY * f64::to_radians(degrees).sin();
            for friction in [0.0, 0.5, 8.0, 100.0, 3000.0, 50_000.0] {
                let settings = slippery(friction);
                for steps_per_s in [60.0, 25.0] {
                    let mut head = round(&settings, on_plane(&stage, 0.05, 1.7));
                    let from = stage.position_m(head.point);
                    let mut gone_m = 0.0;
                    for step in 1..=(0.8 * steps_per_s) as u32 {
                        let fate = settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / steps_per_s);
                        let DropFate::Slides { distance_m } = fate else { panic!("{fate:?}") };
                        gone_m += distance_m;
                        let t = f64::from(step) / steps_per_s;
                        let wanted_m = way_m(pull, friction, t);
                        let apart_m = stage.position_m(head.point).distance(from);
                        let case = format!("{cells} cells, {degrees} degrees, {friction}/s, {t} s");
                        // Distances, and with them times, are exact but for single-precision corners.
                        assert!((gone_m / wanted_m - 1.0).abs() < 1e-5, "{case}: {gone_m} for {wanted_m}");
                        assert!((apart_m - gone_m).abs() < 1e-3 * gone_m + 1e-6, "{case}: {apart_m}");
                        assert!(stage.position_m(head.point).y < from.y, "{case}: not downhill");
                    }
                    let (t, speed) = (0.8, head.velocity_m_per_s.length());
                    let wanted = if friction == 0.0 { pull * t } else { -pull / friction * (-friction * t).exp_m1() };
                    assert!((speed / wanted - 1.0).abs() < 1e-3, "{speed} for {wanted}");
                }
            }
        }
    }
}

#[test]
fn a_thrown_drop_flies_its_parabola_along_the_plane() {
    let stage = plane(50, DQuat::IDENTITY);
    let settings = slippery(0.0);
    let gravity = DVec3::new(0.0, -2.0, -5.0);
    let mut head =
        DropHead { velocity_m_per_s: DVec3::new(1.0, 1.5, 9.0), ..round(&settings, on_plane(&stage, -1.5, -1.0)) };
    let from = stage.position_m(head.point);
    for step in 1..=90 {
        settings.step(&stage.surface(), gravity, false, &mut head, 1.0 / 60.0);
        let t = f64::from(step) / 60.0;
        let wanted = from + DVec3::new(t, 1.5 * t - t * t, 0.0);
        assert!(stage.position_m(head.point).distance(wanted) < 1e-5, "{t} s");
    }
}

/// theta'' = (g / R) sin theta - k theta', by Runge and Kutta's method: (time, angle, rate) until the drop's
/// centrifugal acceleration outweighs what presses it on, which is the last.
fn angles(start: f64, friction: f64, dt_s: f64) -> Vec<(f64, f64, f64)> {
    let slope = |(angle, rate): (f64, f64)| (rate, GRAVITY / SPHERE_RADIUS_M * angle.sin() - friction * rate);
    let (mut t, mut state, mut all) = (0.0, (start, 0.0), Vec::new());
    loop {
        all.push((t, state.0, state.1));
        if state.1 * state.1 * SPHERE_RADIUS_M > GRAVITY * state.0.cos() {
            return all;
        }
        let ahead =
            |slope: (f64, f64), share: f64| (state.0 + slope.0 * share * dt_s, state.1 + slope.1 * share * dt_s);
        let k1 = slope(state);
        let k2 = slope(ahead(k1, 0.5));
        let k3 = slope(ahead(k2, 0.5));
        let k4 = slope(ahead(k3, 1.0));
        state.0 += dt_s / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
        state.1 += dt_s / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
        t += dt_s;
    }
}

fn colatitude(stage: &Stage, point: SurfacePoint) -> f64 {
    stage.position_m(point).angle_between(DVec3::Y)
}

#[test]
fn a_drop_on_a_sphere_follows_its_equation_until_it_falls() {
    let stage = &*SPHERE;
    let fine = 1.0 / 60_000.0;
    for friction in [0.0, 2.0, 30.0, 300.0] {
        let settings = slippery(friction);
        for azimuth in [0.0, 1.0, 2.5, 4.4] {
            let (sin, cos) = f64::sin_cos(azimuth);
            let start = stage.towards(DVec3::new(0.1 * sin, 1.0, 0.1 * cos));
            let wanted = angles(colatitude(stage, start), friction, fine);
            let mut head = round(&settings, start);
            let mut steps = 0;
            loop {
                let fate = settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / 60.0);
                steps += 1;
                let angle = colatitude(stage, head.point);
                let case = format!("{friction}/s, azimuth {azimuth}, step {steps}");
                if fate == DropFate::Falls {
                    let &(time_s, last, _) = wanted.last().unwrap();
                    assert!((angle / last - 1.0).abs() < 0.02, "{case}: fell at {angle} instead of {last}");
                    let steps_to_fall = time_s * 60.0;
                    let is_then =
                        0.98 * steps_to_fall < f64::from(steps) && f64::from(steps - 1) < 1.02 * steps_to_fall;
                    assert!(is_then, "{case}: fell in step {steps} instead of {steps_to_fall}");
                    break;
                }
                assert!(matches!(fate, DropFate::Slides { .. }), "{case}: {fate:?}");
                let t = f64::from(steps) / 60.0;
                let Some(&(_, ideal, rate)) = wanted.get((t / fine).round() as usize) else { continue };
                assert!((angle / ideal - 1.0).abs() < 0.005, "{case}: {angle} instead of {ideal}");
                assert!((angle - ideal).abs() < 0.005 * rate * t, "{case}: too early or late by over 0.5%");
                let around = stage.position_m(head.point);
                let turned = DVec3::new(around.x, 0.0, around.z).angle_between(DVec3::new(sin, 0.0, cos));
                assert!(turned < 0.01, "{case}: left its meridian by {turned}");
            }
        }
    }
}

#[test]
fn without_friction_energy_stays() {
    let stage = &*SPHERE;
    // It hangs on whatever happens.
    let settings = DropSettings { adhesion_n_per_m: 10.0, ..slippery(0.0) };
    for (start, velocity) in [(DVec3::new(0.3, 1.0, 0.1), DVec3::ZERO), (DVec3::X, DVec3::new(0.0, 0.4, 1.0))] {
        let mut head = DropHead { velocity_m_per_s: velocity, ..round(&settings, stage.towards(start)) };
        let energy =
            |head: &DropHead| 0.5 * head.velocity_m_per_s.length_squared() + GRAVITY * stage.position_m(head.point).y;
        // Against that of the lowest place.
        let first = energy(&head) + GRAVITY * SPHERE_RADIUS_M;
        let mut fastest = 0.0f64;
        for step in 0..600 {
            let fate = settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / 60.0);
            assert!(matches!(fate, DropFate::Slides { .. }), "{fate:?}");
            let now = energy(&head) + GRAVITY * SPHERE_RADIUS_M;
            assert!((now / first - 1.0).abs() < 1e-3, "step {step}: {now} for {first}");
            assert!(head.velocity_m_per_s.dot(stage.surface().normal(head.point)).abs() < 1e-9);
            fastest = fastest.max(head.velocity_m_per_s.length());
        }
        assert!(fastest > 1.0, "it hardly moved: {fastest} m/s");
    }
}

#[test]
fn retention_holds_exactly_what_pulls_less() {
    let stage = plane(1, DQuat::IDENTITY);
    let settings = DropSettings { retention_at_1_mm_m_per_s2: 4.0, friction_at_1_mm_per_s: 50.0, ..Default::default() };
    for radius_mm in [0.3, 1.0, 2.0] {
        for is_wet in [false, true] {
            let hold = 4.0 / radius_mm / radius_mm * if is_wet { settings.wet_retention_share } else { 1.0 };
            let volume_m3 = settings.volume_m3(1e-3 * radius_mm);
            let run = |settings: &DropSettings, pull: f64| {
                let mut head = DropHead { volume_m3, ..round(settings, on_plane(&stage, 0.0, 0.0)) };
                settings.step(&stage.surface(), DVec3::new(pull, 0.0, -5.0), is_wet, &mut head, 1.0 / 60.0)
            };
            assert_eq!(run(&settings, hold * (1.0 - 1e-9)), DropFate::Sticks);
            assert!(matches!(run(&settings, hold * (1.0 + 1e-6)), DropFate::Slides { .. }));
            let free = DropSettings { retention_at_1_mm_m_per_s2: 0.0, ..settings.clone() };
            assert!(matches!(run(&free, 1e-3), DropFate::Slides { .. }));
        }
    }
}

#[test]
fn a_pushed_drop_stops_after_its_braking_distance_and_stays() {
    let stage = plane(30, DQuat::IDENTITY);
    let settings = DropSettings { retention_at_1_mm_m_per_s2: 6.0, ..slippery(0.0) };
    // Downhill it is braked by what retention has over the pull; uphill by both.
    for (pull, braking) in [(2.0, 4.0), (-2.0, 8.0), (0.0, 6.0)] {
        let mut head = DropHead { velocity_m_per_s: DVec3::X, ..round(&settings, on_plane(&stage, -1.0, 0.3)) };
        let mut gone_m = 0.0;
        let mut stopped = false;
        for _ in 0..60 {
            match settings.step(&stage.surface(), DVec3::new(pull, 0.0, -5.0), false, &mut head, 1.0 / 60.0) {
                DropFate::Slides { distance_m } if !stopped => gone_m += distance_m,
                DropFate::Sticks => stopped = true,
                fate => panic!("{fate:?}"),
            }
        }
        assert!(stopped && head.velocity_m_per_s == DVec3::ZERO);
        assert!((gone_m - 0.5 / braking).abs() < 1e-9, "{gone_m} m at {braking} m/s2");
    }
}

/// Speed of a drop on a vertical wall after two seconds, metres per second.
fn speed_on_a_wall(radius_m: f64, is_wet: bool) -> f64 {
    let stage = plane(40, DQuat::IDENTITY);
    let settings = DropSettings::default();
    let mut head = DropHead { volume_m3: settings.volume_m3(radius_m), ..round(&settings, on_plane(&stage, 0.0, 1.0)) };
    for _ in 0..120 {
        settings.step(&stage.surface(), DOWN, is_wet, &mut head, 1.0 / 60.0);
    }
    head.velocity_m_per_s.length()
}

#[test]
fn drops_of_blood_run_as_fast_as_blood_does() {
    let (dry, wet) = (speed_on_a_wall(2e-3, false), speed_on_a_wall(2e-3, true));
    assert!((0.02..0.05).contains(&dry), "{dry} m/s");
    assert!((2.7..3.3).contains(&(wet / dry)), "{wet} m/s wet, {dry} m/s dry");
    let small = speed_on_a_wall(1e-3, false);
    assert!(small < 2e-3, "{small} m/s");
    assert_eq!(speed_on_a_wall(0.7e-3, false), 0.0);
    assert!(speed_on_a_wall(1e-3, true) > 3.0 * small);
}

#[test]
fn a_drop_uses_itself_up_for_its_trail() {
    let stage = plane(40, DQuat::IDENTITY);
    let settings = DropSettings { retention_at_1_mm_m_per_s2: 0.0, ..Default::default() };
    let mut head = DropHead { volume_m3: settings.volume_m3(2e-3), ..round(&settings, on_plane(&stage, 0.0, 1.9)) };
    let (first_m3, mut film_m3, mut last_speed) = (head.volume_m3, 0.0, f64::INFINITY);
    for second in 0..20 {
        for _ in 0..60 {
            match settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / 60.0) {
                DropFate::Slides { distance_m } => film_m3 += head.shed(&settings, distance_m),
                fate => panic!("{fate:?}"),
            }
        }
        let speed = head.velocity_m_per_s.length();
        assert!(speed < last_speed, "second {second}: {speed} after {last_speed}");
        last_speed = speed;
    }
    assert!(((film_m3 + head.volume_m3) / first_m3 - 1.0).abs() < 1e-12);
    assert!(film_m3 > 0.3 * first_m3, "{film_m3} of {first_m3}");
    let rest_m3 = head.volume_m3;
    assert_eq!(head.shed(&settings, 1e9), rest_m3);
    assert_eq!((head.volume_m3, head.shed(&settings, 1.0)), (0.0, 0.0));
}

#[test]
fn hanging_drops_fall_exactly_beyond_the_limit() {
    let settings = DropSettings::default();
    let factor = settings.volume_m3(1.0);
    for degrees in [0.0, 20.0, 50.0] {
        // A ceiling: its normal points down, tilted.
        let stage = plane(10, DQuat::from_rotation_x(PI / 2.0 + f64::to_radians(degrees)));
        let away = GRAVITY * f64::to_radians(degrees).cos();
        let limit_m = (2.0 * settings.adhesion_n_per_m / (settings.density_kg_per_m3 * factor * away)).sqrt();
        if degrees == 0.0 {
            assert!((limit_m - 2.2e-3).abs() < 0.05e-3, "{limit_m} m");
        }
        let fate = |volume_m3: f64| {
            let mut head = DropHead { volume_m3, ..round(&settings, on_plane(&stage, 0.1, 0.1)) };
            settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / 60.0)
        };
        let limit_m3 = settings.volume_m3(limit_m);
        assert_ne!(fate(limit_m3 * (1.0 - 1e-4)), DropFate::Falls);
        assert_eq!(fate(limit_m3 * (1.0 + 1e-4)), DropFate::Falls);
        assert_ne!(fate(limit_m3 * 1e-6), DropFate::Falls);
    }
    // On the upper side no drop is too heavy.
    let floor = plane(10, DQuat::from_rotation_x(-PI / 2.0));
    let mut head = DropHead { volume_m3: 1e-3, ..round(&settings, on_plane(&floor, 0.1, 0.1)) };
    assert_eq!(settings.step(&floor.surface(), DOWN, false, &mut head, 1.0 / 60.0), DropFate::Sticks);
}

#[test]
fn a_fast_drop_is_thrown_off_a_sphere() {
    let stage = &*SPHERE;
    let settings = DropSettings { adhesion_n_per_m: 0.02, ..slippery(0.0) };
    let point = stage.towards(DVec3::new(0.2, 0.1, 1.0));
    let clings = settings.adhesion_m_per_s2(1e-3);
    let limit = (clings * SPHERE_RADIUS_M).sqrt();
    for (share, falls) in [(0.98, false), (1.02, true)] {
        let velocity_m_per_s =
            DVec3::X.reject_from_normalized(stage.surface().normal(point)).normalize() * limit * share;
        let mut head = DropHead { velocity_m_per_s, ..round(&settings, point) };
        let fate = settings.step(&stage.surface(), DVec3::ZERO, false, &mut head, 1.0 / 60.0);
        assert_eq!(fate == DropFate::Falls, falls, "{share} of {limit} m/s: {fate:?}");
    }
}

#[test]
fn date_line_and_poles_are_nothing_special() {
    let plain = &*SPHERE;
    let mesh = SurfaceMesh {
        positions_m: plain.positions_m.clone(),
        triangles: plain.atlas.chart().triangles.clone(),
        uvs: None,
    };
    // The same sphere with a chart whose poles and date line lie elsewhere.
    let aside = DQuat::from_euler(glam::EulerRot::XYZ, 1.2, 0.3, 0.9);
    let directions = plain.atlas.chart().directions.iter().map(|&direction| aside * direction).collect();
    let turned = Stage::new(&mesh, Atlas::Spherical(SphereMesh::new(directions, mesh.triangles.clone())));
    let settings = DropSettings { adhesion_n_per_m: 10.0, ..slippery(0.0) };
    let speed = 0.3;
    // Over both poles exactly, past them closely, along the date line, and slantwise over it.
    for (start, velocity) in [
        (DVec3::new(1.0, 0.0, 0.0), DVec3::Y),
        (DVec3::new(1.0, 0.0, 0.001), DVec3::Y),
        (DVec3::new(0.0, 0.2, 1.0), DVec3::Y),
        (DVec3::new(-0.5, 0.1, 1.0), DVec3::new(1.0, 0.3, 0.0)),
    ] {
        let point = plain.towards(start);
        let normal = plain.surface().normal(point);
        let head = DropHead {
            velocity_m_per_s: velocity.reject_from_normalized(normal).normalize() * speed,
            ..round(&settings, point)
        };
        let (mut one, mut other) = (head, head);
        let (mut wrapped, mut by_pole) = (false, f64::INFINITY);
        // Once round and some more.
        for step in 0..160 {
            let before = one.point;
            let fate = settings.step(&plain.surface(), DVec3::ZERO, false, &mut one, 1.0 / 60.0);
            settings.step(&turned.surface(), DVec3::ZERO, false, &mut other, 1.0 / 60.0);
            assert_eq!(one, other, "step {step}");
            let DropFate::Slides { distance_m } = fate else { panic!("{fate:?}") };
            assert!((distance_m * 60.0 / speed - 1.0).abs() < 1e-9, "step {step}: {distance_m} m");
            // In the texture too, once longitudes are taken for the directions that they are.
            let uvs = [before, one.point].map(|point| plain.atlas.uv(point));
            let [from, to] = uvs.map(|uv| plain.atlas.direction_from_uv(uv));
            let turn = from.angle_between(to) * SPHERE_RADIUS_M / distance_m;
            assert!((turn - 1.0).abs() < 0.01, "step {step}: {turn}");
            wrapped |= (uvs[0].x - uvs[1].x).abs() > 0.5;
            by_pole = by_pole.min(uvs[1].y.min(1.0 - uvs[1].y));
        }
        assert!(wrapped || by_pole < 0.02, "it met neither: {start}");
    }
}

#[test]
fn the_same_scene_gives_the_same_bits() {
    let run = || -> Vec<DropHead> {
        livers()
            .into_iter()
            .flat_map(|stage| {
                let mut rng = Pcg32::seed_from_u64(21);
                (0..40).map(move |_| (stage, random_point(&mut rng, stage.faces() as usize))).map(|(stage, point)| {
                    let settings = DropSettings::default();
                    let mut head = DropHead { volume_m3: 8e-9, ..round(&settings, point) };
                    for _ in 0..60 {
                        settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / 60.0);
                    }
                    head
                })
            })
            .collect()
    };
    let first = run();
    assert_eq!(first, run());
    assert_eq!(first, std::thread::spawn(run).join().unwrap());
}

#[test]
fn paths_hardly_depend_on_the_step() {
    for (stage, settings) in livers().into_iter().flat_map(|stage| {
        [(stage, DropSettings::default()), (stage, DropSettings { adhesion_n_per_m: 10.0, ..slippery(20.0) })]
    }) {
        let mut rng = Pcg32::seed_from_u64(22);
        let (mut compared, mut worst) = (0, 0.0f64);
        for _ in 0..60 {
            let point = random_point(&mut rng, stage.faces() as usize);
            let run = |steps_per_s: u32| {
                let mut head = DropHead { volume_m3: 8e-9, ..round(&settings, point) };
                let mut gone_m = 0.0;
                for _ in 0..steps_per_s {
                    match settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / f64::from(steps_per_s)) {
                        DropFate::Slides { distance_m } => gone_m += distance_m,
                        _ => break,
                    }
                }
                (stage.position_m(head.point), gone_m)
            };
            let ((coarse, _), (fine, gone_m)) = (run(60), run(960));
            if gone_m > 1e-3 {
                compared += 1;
                worst = worst.max(coarse.distance(fine) / gone_m);
            }
        }
        assert!(compared > 20, "only {compared} drops moved");
        assert!(worst < 0.02, "{worst} of the way apart");
    }
}

#[test]
fn a_drop_runs_over_the_border() {
    let stage = plane(6, DQuat::IDENTITY);
    let settings = slippery(0.0);
    let mut head =
        DropHead { velocity_m_per_s: DVec3::new(1.0, 0.0, 0.0), ..round(&settings, on_plane(&stage, 1.99, 0.2)) };
    let fate = settings.step(&stage.surface(), DVec3::NEG_Z, false, &mut head, 1.0 / 60.0);
    assert_eq!(fate, DropFate::Leaves);
    assert!((stage.position_m(head.point).x - 2.0).abs() < 1e-6);
}

#[test]
fn on_the_inner_wall_drops_run_on_the_other_side() {
    // The floor of a cavity is its surface's underside: turned normals point up there.
    let mut inner = Stage::star_shaped(&procedural_ellipsoid(Vec3::splat(SPHERE_RADIUS_M as f32), 8));
    let settings = DropSettings { adhesion_n_per_m: 0.0, retention_at_1_mm_m_per_s2: 0.0, ..Default::default() };
    let run = |stage: &Stage| {
        let mut head = round(&settings, stage.towards(DVec3::new(0.3, -1.0, 0.1)));
        let fates: Vec<DropFate> =
            (0..300).map(|_| settings.step(&stage.surface(), DOWN, false, &mut head, 1.0 / 60.0)).collect();
        (fates[0], stage.position_m(head.point))
    };
    assert_eq!(run(&inner).0, DropFate::Falls);
    for normal in &mut inner.normals {
        *normal = -*normal;
    }
    let (fate, end) = run(&inner);
    assert!(matches!(fate, DropFate::Slides { .. }), "{fate:?}");
    assert!(end.normalize().dot(DVec3::NEG_Y) > 0.965, "{end}");
}

#[test]
fn broken_drops_and_surfaces_are_reported() {
    let mut stage = plane(3, DQuat::IDENTITY);
    let settings = DropSettings::default();
    let sound = DropHead { volume_m3: 8e-9, ..round(&settings, on_plane(&stage, 0.0, 0.0)) };
    let fate = |stage: &Stage, head: DropHead, gravity: DVec3, dt_s: f64| {
        let mut moved = head;
        let fate = settings.step(&stage.surface(), gravity, false, &mut moved, dt_s);
        assert!(fate != DropFate::Lost || format!("{moved:?}") == format!("{head:?}"));
        fate
    };
    let down = DVec3::new(0.0, -9.0, -1.0);
    assert!(matches!(fate(&stage, sound, down, 0.1), DropFate::Slides { .. }));
    for dt_s in [0.0, -1.0] {
        assert_eq!(fate(&stage, sound, down, dt_s), DropFate::Sticks);
    }
    let nowhere = SurfacePoint { face: u32::MAX, ..sound.point };
    let no_place = SurfacePoint { barycentric: DVec3::NAN, ..sound.point };
    for broken in [
        DropHead { velocity_m_per_s: DVec3::NAN, ..sound },
        DropHead { volume_m3: f64::NAN, ..sound },
        DropHead { volume_m3: -1.0, ..sound },
        DropHead { point: nowhere, ..sound },
        DropHead { point: no_place, ..sound },
    ] {
        assert_eq!(fate(&stage, broken, down, 0.1), DropFate::Lost, "{broken:?}");
    }
    assert_eq!(fate(&stage, sound, DVec3::splat(f64::INFINITY), 0.1), DropFate::Lost);
    assert_eq!(fate(&stage, sound, down, f64::NAN), DropFate::Lost);
    assert_eq!(fate(&stage, DropHead { volume_m3: 0.0, ..sound }, down, 0.1), DropFate::Sticks);
    stage.positions_m.fill(Vec3::NAN);
    assert_eq!(fate(&stage, sound, down, 0.1), DropFate::Lost);
    stage.positions_m.pop();
    assert_eq!(fate(&stage, sound, down, 0.1), DropFate::Lost);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn any_drop_on_a_liver_stays_on_it(
        seed in any::<u64>(), speed in -4.0..3.0f64, volume in -24.0..-3.0f64, is_wet in any::<bool>(),
        dt in -6.0..1.0f64, gravity in prop::array::uniform3(-20.0..20.0f64), friction in 0.0..1e5f64
    ) {
        for stage in livers() {
            let mut rng = Pcg32::seed_from_u64(seed);
            let settings = DropSettings { friction_at_1_mm_per_s: friction, ..Default::default() };
            let mut head = DropHead {
                point: random_point(&mut rng, stage.faces() as usize),
                velocity_m_per_s: DVec3::new(0.3, -0.5, 0.8) * 10f64.powf(speed),
                volume_m3: 10f64.powf(volume),
            };
            for _ in 0..5 {
                let fate = settings.step(&stage.surface(), gravity.into(), is_wet, &mut head, 10f64.powf(dt));
                prop_assert!(!matches!(fate, DropFate::Lost | DropFate::Leaves), "{:?}", fate);
                assert_is_place(stage, head.point);
                let normal = stage.surface().normal(head.point);
                let speed = head.velocity_m_per_s.length();
                prop_assert!(head.velocity_m_per_s.dot(normal).abs() <= 1e-9 * speed.max(1.0));
            }
        }
    }
}
