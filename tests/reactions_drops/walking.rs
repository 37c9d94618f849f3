//! Straight lines on surfaces where it is known where they go.

use super::*;

/// The corners of a cube that make a regular tetrahedron: exact in any precision.
fn tetrahedron() -> Stage {
    let positions_m =
        vec![Vec3::ONE, Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0)];
    let triangles = vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
    Stage::star_shaped(&SurfaceMesh { positions_m, triangles, uvs: None })
}

#[test]
fn straight_lines_on_a_tetrahedron_close() {
    // Half turns about the vertices unfold it over the plane, so two lattice steps lead back to the start.
    let stage = tetrahedron();
    let mut rng = Pcg32::seed_from_u64(8);
    for (p, q) in [(1, 0), (0, 1), (1, 1), (-1, 1), (1, 2), (3, -1), (5, 7), (-40, 17), (301, 200)] {
        let start = random_point(&mut rng, 4);
        let [a, b, c] = stage.surface().corners(start.face);
        let displacement = 2.0 * (f64::from(p) * (b - a) + f64::from(q) * (c - a));
        let end = walk(&stage.surface(), start, displacement).unwrap();
        let tolerance = 1e-12 * displacement.length();
        assert_eq!(end.stop, WalkStop::Arrived);
        assert_eq!(end.distance_m, displacement.length());
        let missed = stage.position_m(end.point).distance(stage.position_m(start));
        assert!(missed < tolerance, "{p}, {q}: {missed}");
        assert!(end.direction.distance(displacement.normalize()) < tolerance, "{p}, {q}: {}", end.direction);
    }
}

#[test]
fn straight_lines_on_a_sphere_are_great_circles() {
    let stage = &*SPHERE;
    let mut rng = Pcg32::seed_from_u64(9);
    for _ in 0..50 {
        let start = random_point(&mut rng, stage.faces() as usize);
        let displacement = DVec3::new(0.3, -0.8, 0.5).cross(stage.surface().face_normal(start.face));
        let displacement = displacement.normalize() * TAU * SPHERE_RADIUS_M;
        let end = walk(&stage.surface(), start, displacement).unwrap();
        let missed = stage.position_m(end.point).distance(stage.position_m(start)) / SPHERE_RADIUS_M;
        assert!(missed < 0.02, "{missed}");
        assert!(end.direction.dot(displacement.normalize()) > 0.9995, "{}", end.direction);
    }
}

#[test]
fn lines_on_a_plane_stay_straight_over_any_faces() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0);
    let mut rng = Pcg32::seed_from_u64(10);
    for stage in [plane(1, turn), plane(60, turn)] {
        for _ in 0..200 {
            let mut place = || rng.random_range(-1.9..1.9);
            let (from, to) = ((place(), place()), (place(), place()));
            let (start, goal) = (on_plane(&stage, from.0, from.1), on_plane(&stage, to.0, to.1));
            let displacement = stage.position_m(goal) - stage.position_m(start);
            let end = walk(&stage.surface(), start, displacement).unwrap();
            assert!(stage.position_m(end.point).distance(stage.position_m(goal)) < 2e-6);
            assert!(end.direction.dot(displacement.normalize()) > 1.0 - 1e-10);
            assert_is_place(&stage, end.point);
        }
    }
}

#[test]
fn what_is_square_to_the_face_does_not_count() {
    let stage = plane(4, DQuat::IDENTITY);
    let start = on_plane(&stage, 0.1, 0.2);
    let end = walk(&stage.surface(), start, DVec3::new(0.5, 0.0, 7.0)).unwrap();
    assert!(stage.position_m(end.point).distance(DVec3::new(0.6, 0.2, 0.0)) < 1e-6);
    assert!((end.distance_m - 0.5).abs() < 1e-12);
    let still = walk(&stage.surface(), start, DVec3::new(0.0, 0.0, 7.0)).unwrap();
    assert_eq!((still.distance_m, still.direction, still.stop), (0.0, DVec3::ZERO, WalkStop::Arrived));
}

#[test]
fn a_border_ends_the_way() {
    let stage = plane(7, DQuat::IDENTITY);
    let start = on_plane(&stage, 0.5, 0.1);
    let end = walk(&stage.surface(), start, DVec3::new(100.0, 0.0, 0.0)).unwrap();
    assert_eq!(end.stop, WalkStop::Border);
    assert!((end.distance_m - 1.5).abs() < 1e-6, "{}", end.distance_m);
    assert!(stage.position_m(end.point).distance(DVec3::new(2.0, 0.1, 0.0)) < 1e-6);
    let again = walk(&stage.surface(), end.point, DVec3::X).unwrap();
    assert_eq!((again.stop, again.distance_m), (WalkStop::Border, 0.0));
    let back = walk(&stage.surface(), end.point, -DVec3::X).unwrap();
    assert!((back.stop, back.distance_m) == (WalkStop::Arrived, 1.0));
}

#[test]
fn starts_on_edges_and_vertices_are_like_any_other() {
    let stage = plane(9, DQuat::IDENTITY);
    for face in 40..90 {
        for weights in [DVec3::X, DVec3::Y, DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.0, 0.2, 0.8)] {
            let start = SurfacePoint { face, barycentric: weights };
            let from = stage.position_m(start);
            for k in 0..16 {
                let (sin, cos) = (TAU * f64::from(k) / 16.0).sin_cos();
                let displacement = DVec3::new(cos, sin, 0.0) * 0.4;
                let goal = from + displacement;
                if goal.abs().max_element() > 1.99 {
                    continue;
                }
                let end = walk(&stage.surface(), start, displacement).unwrap();
                assert_eq!(end.stop, WalkStop::Arrived);
                let missed = stage.position_m(end.point).distance(goal);
                assert!(missed < 1e-6, "face {face}, {weights}, direction {k}: {missed}");
            }
        }
    }
}

#[test]
fn ways_along_edges_go_on() {
    for stage in livers() {
        for face in 0..stage.faces() {
            let corners = stage.surface().corners(face);
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                for share in [0.0, 0.3, 1.0] {
                    let mut barycentric = DVec3::ZERO;
                    barycentric[k] = 1.0 - share;
                    barycentric[(k + 1) % 3] = share;
                    let displacement = (b - a) * 2.0;
                    let end = walk(&stage.surface(), SurfacePoint { face, barycentric }, displacement).unwrap();
                    assert_eq!(end.stop, WalkStop::Arrived, "face {face}, edge {k}");
                    assert!((end.distance_m / displacement.length() - 1.0).abs() < 1e-12);
                    assert_is_place(stage, end.point);
                }
            }
        }
    }
}

#[test]
fn faces_without_area_are_crossed() {
    // Corners that are pulled onto others, or onto an edge, make points and lines of the faces between them.
    let mut stage = plane(16, DQuat::IDENTITY);
    let at = |i: usize, j: usize| 17 * j + i;
    for k in 0..17 * 17 {
        stage.positions_m[k] = Vec3::new((k % 17) as f32, (k / 17) as f32, 0.0) / 4.0 - Vec3::new(2.0, 2.0, 0.0);
    }
    for i in [3, 6, 7, 10] {
        stage.positions_m[at(i, 8)] = stage.positions_m[at(i + 1, 8)];
        stage.positions_m[at(i, 9)] = stage.positions_m[at(i + 1, 8)];
    }
    stage.positions_m[at(14, 8)] = (stage.positions_m[at(13, 8)] + stage.positions_m[at(14, 9)]) * 0.5;
    let flat = |face: u32| stage.surface().face_normal(face) == DVec3::ZERO;
    assert!((0..stage.faces()).filter(|&face| flat(face)).count() >= 6);
    for k in 0..400 {
        let start = on_plane(&stage, -1.7 + 0.0085 * f64::from(k), -1.5);
        let from = stage.position_m(start);
        let displacement = DVec3::new(0.1, 3.0, 0.0);
        let end = walk(&stage.surface(), start, displacement).unwrap();
        assert_eq!(end.stop, WalkStop::Arrived);
        assert!(stage.position_m(end.point).distance(from + displacement) < 1e-6, "{k}");
    }
    for face in (0..stage.faces()).filter(|&face| flat(face)) {
        for displacement in [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y].map(|d| d * 0.3) {
            let start = SurfacePoint { face, barycentric: DVec3::new(0.2, 0.3, 0.5) };
            let end = walk(&stage.surface(), start, displacement).unwrap();
            let goal = stage.position_m(start) + displacement;
            assert!(stage.position_m(end.point).distance(goal) < 1e-6, "{face}: {end:?}");
        }
    }
}

#[test]
fn a_sheet_folded_back_on_itself_is_walked_as_if_it_were_flat() {
    // The far half lies on the near one, upside down.
    let mut stage = plane(2, DQuat::IDENTITY);
    for k in [1, 4, 7] {
        stage.positions_m[k].x = 0.0;
    }
    for position in &mut stage.positions_m {
        position.x = -position.x.abs();
    }
    let start = SurfacePoint { face: 0, barycentric: DVec3::splat(1.0 / 3.0) };
    let (from, displacement) = (stage.position_m(start), DVec3::new(2.0, 0.2, 0.0));
    let end = walk(&stage.surface(), start, displacement).unwrap();
    let ahead = from + displacement;
    assert!(stage.position_m(end.point).distance(DVec3::new(-ahead.x, ahead.y, 0.0)) < 1e-12);
    assert!(end.direction.distance(DVec3::new(-2.0, 0.2, 0.0).normalize()) < 1e-12, "{}", end.direction);
    assert!((end.distance_m - displacement.length()).abs() < 1e-12);
}

#[test]
fn broken_questions_get_an_error() {
    let mut stage = plane(3, DQuat::IDENTITY);
    let start = on_plane(&stage, 0.0, 0.0);
    let surface = stage.surface();
    assert_eq!(walk(&surface, start, DVec3::NAN), Err(WalkError::NotFinite));
    assert_eq!(walk(&surface, start, DVec3::splat(1e300)), Err(WalkError::NotFinite));
    for barycentric in [DVec3::NAN, DVec3::ZERO, DVec3::NEG_ONE, DVec3::splat(f64::INFINITY)] {
        assert_eq!(walk(&surface, SurfacePoint { barycentric, ..start }, DVec3::X), Err(WalkError::NotFinite));
    }
    let nowhere = SurfacePoint { face: 18, ..start };
    assert_eq!(walk(&surface, nowhere, DVec3::X), Err(WalkError::NoSuchFace { face: 18 }));
    let short = Surface { positions_m: &stage.positions_m[..5], ..surface };
    assert_eq!(walk(&short, start, DVec3::X), Err(WalkError::TooFewPositions { positions: 5, vertices: 16 }));
    for broken in [Vec3::NAN, Vec3::INFINITY] {
        for vertex in [3, 7, 11, 15] {
            stage.positions_m[vertex] = broken;
        }
        let end = walk(&stage.surface(), start, DVec3::X * 3.0);
        assert!(matches!(end, Err(WalkError::BrokenFace { .. })), "{end:?}");
    }
    stage.positions_m.fill(Vec3::ONE);
    assert_eq!(walk(&stage.surface(), start, DVec3::X), Err(WalkError::NoArea { face: start.face }));
}

#[test]
fn a_way_without_end_is_cut_off() {
    let stage = tetrahedron();
    let start = SurfacePoint { face: 2, barycentric: DVec3::new(0.2, 0.3, 0.5) };
    let end = walk(&stage.surface(), start, DVec3::new(1e9, 2e9, -3e7)).unwrap();
    assert_eq!(end.stop, WalkStop::TooManyFaces);
    assert!(end.distance_m > 1e4 && end.distance_m < 1e6, "{}", end.distance_m);
    assert_is_place(&stage, end.point);
}

#[test]
fn walking_back_leads_back() {
    for stage in livers() {
        let mut rng = Pcg32::seed_from_u64(12);
        for _ in 0..300 {
            let start = random_point(&mut rng, stage.faces() as usize);
            let displacement = DVec3::new(1.0, -0.4, 0.3).normalize() * 0.05;
            let Walk { point, direction, distance_m, .. } = walk(&stage.surface(), start, displacement).unwrap();
            let back = walk(&stage.surface(), point, -direction * distance_m).unwrap();
            // Straight lines that pass a vertex closely part; rounding decides on which side they go back.
            let missed = stage.position_m(back.point).distance(stage.position_m(start));
            assert!(missed < 1e-9, "{missed}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn any_way_on_a_liver_is_as_long_as_asked(
        seed in any::<u64>(), exponent in -9.0..1.5f64, corner in 0usize..8, direction in prop::array::uniform3(-1.0..1.0f64)
    ) {
        for stage in livers() {
            let mut rng = Pcg32::seed_from_u64(seed);
            let mut start = random_point(&mut rng, stage.faces() as usize);
            // On a corner or an edge as well.
            start.barycentric = match corner {
                0 => DVec3::X,
                1 => DVec3::Z,
                2 => DVec3::new(0.5, 0.5, 0.0),
                3 => DVec3::new(0.0, 1e-17, 1.0),
                _ => start.barycentric,
            };
            let normal = stage.surface().face_normal(start.face);
            let along = DVec3::from(direction).cross(normal);
            prop_assume!(along.length() > 1e-3);
            let displacement = along.normalize() * 10f64.powf(exponent);
            let end = walk(&stage.surface(), start, displacement).unwrap();
            prop_assert_eq!(end.stop, WalkStop::Arrived);
            prop_assert!((end.distance_m / displacement.length() - 1.0).abs() < 1e-12);
            prop_assert!((end.direction.length() - 1.0).abs() < 1e-12);
            prop_assert!(end.direction.dot(stage.surface().face_normal(end.point.face)).abs() < 1e-9);
            assert_is_place(stage, end.point);
            let bee_line = stage.position_m(end.point).distance(stage.position_m(start));
            prop_assert!(bee_line <= displacement.length() * (1.0 + 1e-9) + 1e-15);
            prop_assert_eq!(walk(&stage.surface(), start, displacement).unwrap(), end);
        }
    }
}
