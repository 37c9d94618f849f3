//! Picking without rendering: the same answers as asking every face, at rest and deformed, and no way through.

use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse};
use bevy_surgery::organ::pick::{NearestHit, OrganPicker, PickHit};
use bevy_surgery::organ::{SurfaceMesh, SurfacePoint, procedural_ellipsoid};
use glam::{DVec3, Vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f64::consts::PI;

/// A real liver of 20 cm and an ellipsoid; the liver only where its file is.
fn meshes() -> Vec<(&'static str, SurfaceMesh)> {
    let mut meshes = vec![("ellipsoid", procedural_ellipsoid(Vec3::new(0.1, 0.06, 0.08), 12))];
    match std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/mesh/liver-smooth.obj")) {
        Ok(bytes) => {
            let options = LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..Default::default() };
            meshes.push(("liver", parse(&bytes, "liver-smooth.obj", &options).expect("a real organ loads")));
        }
        Err(_) => println!("skipped: liver-smooth.obj is not here"),
    }
    meshes
}

fn random_direction(random: &mut Pcg32) -> DVec3 {
    let z: f64 = random.random_range(-1.0..1.0);
    let (sine, cosine) = random.random_range(0.0..2.0 * PI).sin_cos();
    DVec3::new((1.0 - z * z).sqrt() * cosine, (1.0 - z * z).sqrt() * sine, z)
}

/// A position in a box half as large again as the mesh's.
fn random_position_m(mesh: &SurfaceMesh, random: &mut Pcg32) -> DVec3 {
    let (low, high) = mesh.bounds_m();
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    let mut fraction = || random.random_range(-0.25..1.25);
    low + (high - low) * DVec3::new(fraction(), fraction(), fraction())
}

/// Presses and twists a mesh, as a probe and gravity would together and more.
fn deformed(mesh: &SurfaceMesh) -> SurfaceMesh {
    let bend = |p: Vec3| {
        let twist = glam::Quat::from_rotation_x(6.0 * p.x);
        twist * p + Vec3::new(0.02 * (40.0 * p.z).sin(), -1.5 * p.x * p.x, 0.3 * p.y)
    };
    SurfaceMesh { positions_m: mesh.positions_m.iter().copied().map(bend).collect(), ..mesh.clone() }
}

/// The nearest hit by asking every face (Moeller and Trumbore 1997), with the lowest index.
fn cast_by_brute_force(mesh: &SurfaceMesh, origin_m: DVec3, direction: DVec3) -> Option<(u32, f64)> {
    (0..mesh.triangles.len() as u32)
        .filter_map(|face| {
            let [a, b, c] = mesh.corners(face);
            let (ab, ac, offset) = (b - a, c - a, origin_m - a);
            let across = direction.cross(ac);
            let determinant = ab.dot(across);
            let (u, turned) = (offset.dot(across) / determinant, offset.cross(ab));
            let (v, distance_m) = (direction.dot(turned) / determinant, ac.dot(turned) / determinant);
            (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance_m >= 0.0).then_some((face, distance_m))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Distance to a face: to its plane if that is below it, to its edges otherwise.
fn distance_to_face_m(mesh: &SurfaceMesh, face: u32, position_m: DVec3) -> f64 {
    let corners = mesh.corners(face);
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize();
    let edges = [(a, b), (b, c), (c, a)];
    if edges.iter().all(|(from, to)| normal.cross(to - from).dot(position_m - from) >= 0.0) {
        return normal.dot(position_m - a).abs();
    }
    let to_edge = |(from, to): (DVec3, DVec3)| {
        let fraction = ((position_m - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
        position_m.distance(from.lerp(to, fraction))
    };
    edges.into_iter().map(to_edge).fold(f64::INFINITY, f64::min)
}

fn position_m(mesh: &SurfaceMesh, point: SurfacePoint) -> DVec3 {
    let [a, b, c] = mesh.corners(point.face);
    a * point.barycentric.x + b * point.barycentric.y + c * point.barycentric.z
}

fn check_hit(mesh: &SurfaceMesh, hit: &PickHit, origin_m: DVec3, direction: DVec3) {
    let weights = hit.point.barycentric;
    assert!(weights.min_element() >= 0.0 && (weights.element_sum() - 1.0).abs() < 1e-12, "{weights}");
    assert!(hit.position_m.distance(position_m(mesh, hit.point)) < 1e-12);
    assert!(hit.position_m.distance(origin_m + direction.normalize() * hit.distance_m) < 1e-9);
    let [a, b, c] = mesh.corners(hit.point.face);
    assert!(hit.face_normal.distance((b - a).cross(c - a).normalize()) < 1e-12);
    assert_eq!(hit.is_front, direction.dot(hit.face_normal) < 0.0);
}

fn check_against_brute_force(name: &str, mesh: &SurfaceMesh, picker: &OrganPicker) {
    let mut random = Pcg32::seed_from_u64(11);
    let (mut hits, mut misses) = (0, 0);
    for index in 0..1500 {
        let origin_m = random_position_m(mesh, &mut random);
        let mut direction = random_direction(&mut random) * random.random_range(0.001..1000.0);
        if index % 2 == 0 {
            let vertex = random.random_range(0..mesh.positions_m.len());
            direction = mesh.positions_m[vertex].as_dvec3() - origin_m + 1e-3 * random_direction(&mut random);
        }
        let hit = picker.cast_ray(origin_m, direction, f64::INFINITY);
        let wanted = cast_by_brute_force(mesh, origin_m, direction.normalize());
        match (hit, wanted) {
            (Some(hit), Some((face, distance_m))) => {
                check_hit(mesh, &hit, origin_m, direction);
                assert!((hit.distance_m - distance_m).abs() < 1e-9, "{name}: {hit:?}, wanted {distance_m} on {face}");
                assert_eq!(hit.point.face, face, "{name}");
                // The limit counts: a little less finds nothing.
                assert_eq!(picker.cast_ray(origin_m, direction, hit.distance_m), Some(hit));
                assert_eq!(picker.cast_ray(origin_m, direction, hit.distance_m.next_down()), None);
                hits += 1;
            }
            (None, None) => misses += 1,
            (hit, wanted) => panic!("{name}: {hit:?}, wanted {wanted:?}"),
        }
    }
    assert!(hits > 300 && misses > 100, "{name}: {hits} hits and {misses} misses tell too little");

    for _ in 0..600 {
        let from_m = random_position_m(mesh, &mut random);
        let found = picker.nearest(from_m, f64::INFINITY).expect("something is always nearest");
        let faces = 0..mesh.triangles.len() as u32;
        let wanted = faces.map(|face| distance_to_face_m(mesh, face, from_m)).fold(f64::INFINITY, f64::min);
        assert!((found.distance_m - wanted).abs() < 1e-12, "{name}: {found:?}, wanted {wanted}");
        let weights = found.point.barycentric;
        assert!(weights.min_element() >= 0.0 && (weights.element_sum() - 1.0).abs() < 1e-12, "{weights}");
        assert!(found.position_m.distance(position_m(mesh, found.point)) < 1e-12);
        assert!((found.position_m.distance(from_m) - found.distance_m).abs() < 1e-12);
        assert_eq!(picker.nearest(from_m, found.distance_m), Some(found));
        assert_eq!(picker.nearest(from_m, found.distance_m.next_down()), None);
    }
}

#[test]
fn finds_what_asking_every_face_finds() {
    for (name, mesh) in meshes() {
        let mut picker = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
        check_against_brute_force(name, &mesh, &picker);
        let moved = deformed(&mesh);
        picker.refit(&moved.positions_m);
        check_against_brute_force(name, &moved, &picker);
    }
}

#[test]
fn a_refitted_picker_answers_like_a_new_one_to_the_bit() {
    for (name, mesh) in meshes() {
        let moved = deformed(&mesh);
        let mut refitted = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
        refitted.refit(&moved.positions_m);
        let new = OrganPicker::build(&moved.triangles, &moved.positions_m);
        let mut random = Pcg32::seed_from_u64(5);
        for _ in 0..3000 {
            let from_m = random_position_m(&moved, &mut random);
            let to_m = moved.positions_m[random.random_range(0..moved.positions_m.len())].as_dvec3();
            // Through a vertex: many faces at the same distance but for rounding.
            for direction in [random_direction(&mut random), to_m - from_m] {
                let limit_m = f64::INFINITY;
                assert_eq!(
                    refitted.cast_ray(from_m, direction, limit_m),
                    new.cast_ray(from_m, direction, limit_m),
                    "{name}"
                );
            }
            for from_m in [from_m, to_m] {
                assert_eq!(refitted.nearest(from_m, f64::INFINITY), new.nearest(from_m, f64::INFINITY), "{name}");
            }
        }
    }
}

/// Whether a position is inside a closed mesh: its faces then fill the whole view.
fn is_inside(mesh: &SurfaceMesh, position_m: DVec3) -> bool {
    let solid_angle = |face: u32| {
        let [a, b, c] = mesh.corners(face).map(|corner| (corner - position_m).normalize());
        2.0 * a.dot(b.cross(c)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    };
    (0..mesh.triangles.len() as u32).map(solid_angle).sum::<f64>() > 2.0 * PI
}

#[test]
fn no_ray_gets_out_through_a_vertex_or_an_edge() {
    for (name, mesh) in meshes() {
        let picker = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
        let mut random = Pcg32::seed_from_u64(2);
        let (mut insides, mut straight) = (0, 0);
        let mut faces_of = vec![Vec::new(); mesh.positions_m.len()];
        for (face, triangle) in mesh.triangles.iter().enumerate() {
            for &vertex in triangle {
                faces_of[vertex as usize].push(face);
            }
        }
        while insides < 3 {
            // Rounded to single precision and to a coarse grid: rays then lie in planes with vertices more often.
            let origin_m = (random_position_m(&mesh, &mut random) * 256.0).round() / 256.0;
            if !is_inside(&mesh, origin_m) {
                continue;
            }
            insides += 1;
            for (face, &triangle) in mesh.triangles.iter().enumerate() {
                for k in 0..3 {
                    let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
                    let [a, b] = [from, to].map(|vertex| mesh.positions_m[vertex as usize].as_dvec3());
                    let of_edge =
                        || faces_of[from as usize].iter().filter(|&&other| mesh.triangles[other].contains(&to));
                    for (target_m, around) in [
                        (a, faces_of[from as usize].clone()),
                        ((a + b) / 2.0, of_edge().copied().collect()),
                        (a.lerp(b, random.random_range(0.0..1.0)), of_edge().copied().collect()),
                    ] {
                        let direction = target_m - origin_m;
                        let hit = picker.cast_ray(origin_m, direction, f64::INFINITY);
                        let hit = hit.unwrap_or_else(|| panic!("{name}: out through face {face} at {target_m}"));
                        // A ray that grazes a fold may just miss it.
                        let sees_back = |face: &usize| mesh_normal(&mesh, *face).dot(direction) > 0.0;
                        let is_fold = !around.iter().all(sees_back) && around.iter().any(sees_back);
                        if !is_fold {
                            assert!(hit.distance_m <= direction.length() + 1e-9, "{name}: past {target_m}: {hit:?}");
                            // The real liver pierces itself by some hundredths of a millimetre in places.
                            assert!(!hit.is_front || name == "liver", "{name}: from inside, back sides are seen first");
                            straight += 1;
                        }
                    }
                }
            }
        }
        assert!(straight > 5 * mesh.triangles.len(), "{name}: only {straight} rays were no grazing ones");
    }
}

fn mesh_normal(mesh: &SurfaceMesh, face: usize) -> DVec3 {
    let [a, b, c] = mesh.corners(face as u32);
    (b - a).cross(c - a)
}

/// The cube from -1 to 1 with `n * n` squares of two faces per side.
fn cube(n: u32) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    for axis in 0..3 {
        for sign in [-1.0f32, 1.0] {
            let first = mesh.positions_m.len() as u32;
            for row in 0..=n {
                for column in 0..=n {
                    let mut place = [0.0; 3];
                    place[axis] = sign;
                    place[(axis + 1) % 3] = 2.0 * column as f32 / n as f32 - 1.0;
                    place[(axis + 2) % 3] = 2.0 * row as f32 / n as f32 - 1.0;
                    mesh.positions_m.push(place.into());
                }
            }
            for row in 0..n {
                for column in 0..n {
                    let corner = |row: u32, column: u32| first + row * (n + 1) + column;
                    let quad = [
                        corner(row, column),
                        corner(row, column + 1),
                        corner(row + 1, column + 1),
                        corner(row + 1, column),
                    ];
                    let halves = [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]];
                    mesh.triangles.extend(halves.map(|[a, b, c]| if sign > 0.0 { [a, b, c] } else { [a, c, b] }));
                }
            }
        }
    }
    mesh
}

#[test]
fn rays_along_edges_and_axes_of_a_cube_hit_it() {
    let mesh = cube(8);
    let picker = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
    // Through all vertices, middles of edges and of diagonals, straight on: every component but one is zero.
    for i in -16..=16 {
        for j in -16..=16 {
            for axis in 0..3 {
                let mut origin = [f64::from(i) / 16.0, f64::from(j) / 16.0, 0.0];
                origin.rotate_right(axis);
                let mut direction = [0.0, 0.0, 1.0];
                direction.rotate_right(axis);
                let (origin_m, direction) = (DVec3::from_array(origin), DVec3::from_array(direction));
                for direction in [direction, -direction] {
                    let outside = origin_m - 3.0 * direction;
                    let hit = picker.cast_ray(outside, direction, f64::INFINITY).expect("the cube is in the way");
                    // On the rim the ray runs along side walls; it enters them where the cube begins.
                    assert_eq!(hit.distance_m, 2.0, "{origin_m} {direction}: {hit:?}");
                    let back = picker.cast_ray(origin_m, direction, f64::INFINITY);
                    assert_eq!(back.map(|hit| hit.distance_m), Some(1.0), "{origin_m} {direction}");
                }
            }
        }
    }
    // Just beside it, in the plane of a side and within single precision of it.
    for beyond in [1.0 + 1e-9, 1.0 + 1e-15] {
        assert_eq!(picker.cast_ray(DVec3::new(beyond, 0.25, -3.0), DVec3::Z, f64::INFINITY), None);
        assert!(picker.cast_ray(DVec3::new(2.0 - beyond, 0.25, -3.0), DVec3::Z, f64::INFINITY).is_some());
    }
}

#[test]
fn ties_go_to_the_lowest_face() {
    let mesh = procedural_ellipsoid(Vec3::splat(0.1), 6);
    let count = mesh.triangles.len();
    // Every face again, and again turned over.
    let turned = mesh.triangles.iter().map(|&[a, b, c]| [b, a, c]);
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().copied().chain(mesh.triangles.clone()).chain(turned).collect();
    let twice = OrganPicker::build(&triangles[..2 * count], &mesh.positions_m);
    let reversed: Vec<[u32; 3]> = triangles.iter().rev().copied().collect();
    let picker = OrganPicker::build(&triangles, &mesh.positions_m);
    let backwards = OrganPicker::build(&reversed, &mesh.positions_m);
    let mut random = Pcg32::seed_from_u64(8);
    for _ in 0..500 {
        let origin_m = random_direction(&mut random) * 0.3;
        let direction = random_direction(&mut random) * 0.05 - origin_m;
        let hit = picker.cast_ray(origin_m, direction, 1.0).expect("aimed at it");
        assert!((hit.point.face as usize) < count && hit.is_front);
        let hit = backwards.cast_ray(origin_m, direction, 1.0).expect("aimed at it");
        assert!((hit.point.face as usize) < count && !hit.is_front, "the turned one comes first here");
        let found = twice.nearest(origin_m, 1.0).expect("near");
        assert!((found.point.face as usize) < count);
    }
    // At a vertex all faces around it are at distance zero.
    for vertex in 0..mesh.positions_m.len() as u32 {
        let lowest = mesh.triangles.iter().position(|face| face.contains(&vertex)).expect("every vertex is used");
        let found = picker.nearest(mesh.positions_m[vertex as usize].as_dvec3(), 0.0).expect("it is there");
        assert_eq!((found.point.face as usize, found.distance_m), (lowest, 0.0));
    }
}

#[test]
fn bad_rays_and_positions_find_nothing() {
    let mesh = procedural_ellipsoid(Vec3::splat(0.1), 4);
    let picker = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for value in bad {
        for axis in 0..3 {
            let mut vector = DVec3::Z;
            vector[axis] = value;
            assert_eq!(picker.cast_ray(vector, DVec3::Z, 1.0), None);
            assert_eq!(picker.cast_ray(DVec3::ZERO, vector, 1.0), None);
            assert_eq!(picker.nearest(vector, f64::INFINITY), None);
        }
    }
    assert_eq!(picker.cast_ray(DVec3::ZERO, DVec3::ZERO, 1.0), None);
    for limit_m in [f64::NAN, -1.0, f64::NEG_INFINITY] {
        assert_eq!(picker.cast_ray(DVec3::ZERO, DVec3::Z, limit_m), None);
        assert_eq!(picker.nearest(DVec3::ZERO, limit_m), None);
    }
    for length in [f64::MIN_POSITIVE, 1e-200, 1e200, f64::MAX] {
        let hit = picker.cast_ray(DVec3::ZERO, DVec3::new(length, 0.5 * length, 0.0), 1.0);
        assert_eq!(hit, picker.cast_ray(DVec3::ZERO, DVec3::new(1.0, 0.5, 0.0), 1.0), "of any length");
        assert!(hit.is_some());
    }
    // So far off that everything is rounding: no panic, and nothing that is not a number.
    for far_m in [1e9, 1e18, 1e150, 1e300, f64::MAX] {
        let origin_m = DVec3::new(far_m, 0.3 * far_m, -far_m);
        let hit = picker.cast_ray(origin_m, -origin_m, f64::INFINITY);
        assert!(hit.is_none_or(|hit| hit.distance_m.is_finite() && hit.position_m.is_finite()));
        let found = picker.nearest(origin_m, f64::INFINITY);
        assert!(found.is_none_or(|found| found.distance_m.is_finite() && found.position_m.is_finite()));
    }
}

#[test]
fn broken_meshes_answer_with_what_is_left() {
    let nothing = |picker: &OrganPicker| {
        assert_eq!(picker.cast_ray(DVec3::ZERO, DVec3::Z, f64::INFINITY), None);
        assert_eq!(picker.nearest(DVec3::ZERO, f64::INFINITY), None);
    };
    nothing(&OrganPicker::default());
    nothing(&OrganPicker::build(&[], &[]));
    nothing(&OrganPicker::build(&[[0, 1, 2]], &[]));
    nothing(&OrganPicker::build(&[[0, 1, 2]], &[Vec3::NAN; 3]));
    nothing(&OrganPicker::build(&[[0, 0, 0]; 5], &[Vec3::Z]));
    nothing(&OrganPicker::build(&[[0, 1, 2]; 3], &[Vec3::Z, 2.0 * Vec3::Z, 3.0 * Vec3::Z]));
    nothing(&OrganPicker::build(&[[0, 1, u32::MAX]; 20_000], &[Vec3::X, Vec3::Y, Vec3::Z]));

    let corners = [Vec3::new(-1.0, -1.0, 1.0), Vec3::new(1.0, -1.0, 1.0), Vec3::new(0.0, 1.0, 1.0)];
    // As often as one likes, beside faces of every broken kind, in any number.
    for copies in [1, 2, 3, 5000] {
        let mut triangles = vec![[3, 1, 2], [0, 1, 4], [9, 9, 9], [0, 0, 1]];
        triangles.extend(vec![[0, 1, 2]; copies]);
        let mut positions_m = corners.to_vec();
        positions_m.extend([Vec3::NAN, Vec3::new(0.0, 1e30, 0.0)]);
        let mut picker = OrganPicker::build(&triangles, &positions_m);
        let hit = picker.cast_ray(DVec3::ZERO, DVec3::Z, f64::INFINITY).expect("one face is sound");
        assert_eq!((hit.point.face, hit.distance_m), (4, 1.0));
        assert_eq!(picker.nearest(DVec3::ZERO, 2.0).map(|found| (found.point.face, found.distance_m)), Some((4, 1.0)));
        // All of it breaks, and heals.
        picker.refit(&[]);
        nothing(&picker);
        picker.refit(&[Vec3::NAN; 9]);
        nothing(&picker);
        picker.refit(&corners.map(|corner| 2.0 * corner));
        let hit = picker.cast_ray(DVec3::ZERO, DVec3::Z, f64::INFINITY).expect("whole again");
        assert_eq!((hit.point.face, hit.distance_m), (4, 2.0));
        assert_eq!(picker.face_count(), 4 + copies);
    }
}

#[test]
fn one_broken_vertex_costs_only_its_faces() {
    let mesh = procedural_ellipsoid(Vec3::splat(0.1), 6);
    let mut positions_m = mesh.positions_m.clone();
    positions_m[7] = Vec3::new(f32::NAN, 0.0, f32::INFINITY);
    let mut picker = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
    picker.refit(&positions_m);
    for (face, triangle) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(face as u32);
        let hit = picker.cast_ray(DVec3::ZERO, a + b + c, 1.0);
        assert_eq!(hit.map(|hit| hit.point.face), (!triangle.contains(&7)).then_some(face as u32));
    }
}

/// A few triangles on a coarse grid: many are flat, coincide, or share edges.
fn grid_mesh() -> impl Strategy<Value = SurfaceMesh> {
    let place = (-3i8..=3, -3i8..=3, -3i8..=3).prop_map(|(x, y, z)| Vec3::new(x.into(), y.into(), z.into()) / 4.0);
    (proptest::collection::vec(place, 3..12), proptest::collection::vec([0u32..12, 0..12, 0..12], 0..30))
        .prop_map(|(positions_m, triangles)| SurfaceMesh { positions_m, triangles, uvs: None })
}

fn grid_vector() -> impl Strategy<Value = DVec3> {
    (-6i8..=6, -6i8..=6, -6i8..=6).prop_map(|(x, y, z)| DVec3::new(x.into(), y.into(), z.into()) / 4.0)
}

/// The mesh without the faces that cannot be found, and their indices in it.
fn sound_part(mesh: &SurfaceMesh) -> (SurfaceMesh, Vec<u32>) {
    let is_sound = |face: u32| {
        let triangle = mesh.triangles[face as usize];
        triangle.iter().all(|&vertex| (vertex as usize) < mesh.positions_m.len()) && mesh.face_area_m2(face) > 0.0
    };
    let kept: Vec<u32> = (0..mesh.triangles.len() as u32).filter(|&face| is_sound(face)).collect();
    let triangles = kept.iter().map(|&face| mesh.triangles[face as usize]).collect();
    (SurfaceMesh { triangles, ..mesh.clone() }, kept)
}

proptest! {
    #[test]
    fn any_soup_of_faces_answers_like_brute_force(
        mesh in grid_mesh(), origin_m in grid_vector(), direction in grid_vector()
    ) {
        let picker = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
        let (sound, _) = sound_part(&mesh);
        let found = picker.nearest(origin_m, f64::INFINITY);
        let distances = (0..sound.triangles.len() as u32).map(|face| distance_to_face_m(&sound, face, origin_m));
        let wanted = distances.min_by(f64::total_cmp);
        prop_assert_eq!(found.is_some(), wanted.is_some());
        if let (Some(found), Some(wanted)) = (found, wanted) {
            prop_assert!((found.distance_m - wanted).abs() < 1e-12);
        }
        if let Some(hit) = picker.cast_ray(origin_m, direction, f64::INFINITY) {
            check_hit(&mesh, &hit, origin_m, direction);
        }
        // A little aside of the grid, so that no edge is met and the plain test can be trusted.
        let direction = direction + DVec3::new(0.012_345, -0.023_456_7, 0.034_567_89);
        let origin_m = origin_m + DVec3::new(0.001_234_5, 0.002_345_67, -0.003_456_78);
        let hit = picker.cast_ray(origin_m, direction, f64::INFINITY);
        let wanted = cast_by_brute_force(&sound, origin_m, direction.normalize());
        prop_assert_eq!(hit.is_some(), wanted.is_some());
        if let (Some(hit), Some((_, distance_m))) = (hit, wanted) {
            prop_assert!((hit.distance_m - distance_m).abs() < 1e-9);
        }
    }

    #[test]
    fn the_order_of_faces_changes_only_their_names(
        mesh in grid_mesh(), origin_m in grid_vector(), direction in grid_vector()
    ) {
        let answers = |mesh: &SurfaceMesh| -> (Option<PickHit>, Option<NearestHit>) {
            let picker = OrganPicker::build(&mesh.triangles, &mesh.positions_m);
            (picker.cast_ray(origin_m, direction, 5.0), picker.nearest(origin_m, 5.0))
        };
        let reversed = SurfaceMesh { triangles: mesh.triangles.iter().rev().copied().collect(), ..mesh.clone() };
        let (hit, found) = answers(&mesh);
        let (other_hit, other_found) = answers(&reversed);
        prop_assert_eq!(hit.map(|hit| hit.distance_m), other_hit.map(|hit| hit.distance_m));
        prop_assert_eq!(found.map(|found| found.distance_m), other_found.map(|found| found.distance_m));
    }
}
