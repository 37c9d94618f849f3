//! The spherical chart of an organ, its texture coordinates and their inverse: bijective, even enough, exact.

use bevy_surgery::organ::atlas::{Atlas, FaceTable};
use bevy_surgery::organ::chart::{self, ChartError, ChartMethod, ChartOptions, ChartReport, Poles};
use bevy_surgery::organ::load::{self, LoadOptions, MeshUnit};
use bevy_surgery::organ::mesh::{NO_FACE, SurfaceMesh};
use bevy_surgery::organ::planar::{PlanarChart, PlanarError};
use bevy_surgery::organ::sphere::{SphereMesh, SurfacePoint};
use glam::{DVec2, DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f64::consts::PI;

const ORGANS: [(&str, usize); 4] =
    [("liver.obj", 139), ("liver2.obj", 1170), ("liver-smooth.obj", 2194), ("gallbladder.stl", 7352)];

/// A real organ scaled to 20 cm; `None`, with a line that says so, where the file is absent.
fn real_mesh(name: &str) -> Option<SurfaceMesh> {
    let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/mesh/{}"), name);
    let Ok(bytes) = std::fs::read(&path) else {
        println!("skipped: {name} is not here");
        return None;
    };
    let options = LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..Default::default() };
    Some(load::parse(&bytes, name, &options).unwrap_or_else(|error| panic!("{name}: {error}")))
}

fn real_charts() -> impl Iterator<Item = (&'static str, SurfaceMesh, SphereMesh, ChartReport)> {
    ORGANS.into_iter().filter_map(|(name, vertices)| {
        let mesh = real_mesh(name)?;
        assert_eq!(mesh.positions_m.len(), vertices, "{name}");
        let (sphere, report) = chart::build(&mesh, &ChartOptions::default()).unwrap();
        Some((name, mesh, sphere, report))
    })
}

/// An octahedron whose faces are cut into `n * n`, its vertices moved by `shape` from the unit sphere.
fn octasphere(n: u32, shape: impl Fn(DVec3) -> DVec3) -> SurfaceMesh {
    let mut points: Vec<[i64; 3]> = Vec::new();
    let mut triangles = Vec::new();
    for octant in 0..8u32 {
        let sign = |bit: u32| if octant >> bit & 1 == 0 { 1i64 } else { -1 };
        let is_mirrored = sign(0) * sign(1) * sign(2) < 0;
        let mut vertex = |i: u32, j: u32| {
            let point = [sign(0) * i64::from(i), sign(1) * i64::from(j), sign(2) * i64::from(n - i - j)];
            points.iter().position(|&other| other == point).unwrap_or_else(|| {
                points.push(point);
                points.len() - 1
            }) as u32
        };
        let mut push = |[a, b, c]: [u32; 3]| triangles.push(if is_mirrored { [a, c, b] } else { [a, b, c] });
        for i in 0..n {
            for j in 0..n - i {
                push([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
                if i + j + 2 <= n {
                    push([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
                }
            }
        }
    }
    let positions_m = points
        .iter()
        .map(|point| shape(DVec3::from_array(point.map(|component| component as f64)).normalize()).as_vec3())
        .collect();
    SurfaceMesh { positions_m, triangles, uvs: None }
}

/// A bent sausage with a thin end: closed, of genus 0, and visible from no single point inside.
fn hook() -> SurfaceMesh {
    octasphere(12, |d| {
        let along = 1.6 * d.x;
        let radius = 0.35 * (1.1 - 0.8 * d.x);
        let centre = DVec3::new((2.0 * along).sin(), (2.0 * along).cos(), 0.0);
        centre * (1.0 + radius * d.y) + DVec3::Z * radius * d.z
    })
}

fn torus() -> SurfaceMesh {
    let (major, minor) = (12u32, 8u32);
    let positions_m = (0..major * minor)
        .map(|k| {
            let (i, j) = ((k / minor) as f32, (k % minor) as f32);
            let (a, b) = (i / major as f32 * std::f32::consts::TAU, j / minor as f32 * std::f32::consts::TAU);
            Vec3::new((2.0 + b.cos()) * a.cos(), (2.0 + b.cos()) * a.sin(), b.sin())
        })
        .collect();
    let at = |i: u32, j: u32| i % major * minor + j % minor;
    let triangles = (0..major)
        .flat_map(|i| (0..minor).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    SurfaceMesh { positions_m, triangles, uvs: None }
}

fn random_direction(rng: &mut Pcg32) -> DVec3 {
    let y: f64 = rng.random_range(-1.0..1.0);
    let (sin, cos) = rng.random_range(0.0..2.0 * PI).sin_cos();
    let radius = (1.0 - y * y).sqrt();
    DVec3::new(radius * sin, y, radius * cos)
}

fn random_point(rng: &mut Pcg32, faces: usize) -> SurfacePoint {
    let (a, b): (f64, f64) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
    let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
    SurfacePoint { face: rng.random_range(0..faces as u32), barycentric: DVec3::new(1.0 - a - b, a, b) }
}

fn faces_that_contain(chart: &SphereMesh, direction: DVec3) -> Vec<u32> {
    (0..chart.triangles.len() as u32).filter(|&face| chart.contains(face, direction)).collect()
}

fn position_m(mesh: &SurfaceMesh, point: SurfacePoint) -> DVec3 {
    let [a, b, c] = mesh.corners(point.face);
    a * point.barycentric.x + b * point.barycentric.y + c * point.barycentric.z
}

/// Directions that rounding could give to two faces or none: vertices, edges, the poles, the date line.
fn awkward_directions(chart: &SphereMesh) -> Vec<DVec3> {
    let mut directions = vec![DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z, DVec3::X, DVec3::NEG_X];
    directions.extend((1..60).map(|k| {
        let (sin, cos) = (PI * f64::from(k) / 60.0).sin_cos();
        DVec3::new(0.0, cos, sin)
    }));
    let step = (chart.triangles.len() / 200).max(1);
    for face in (0..chart.triangles.len()).step_by(step) {
        let [a, b, c] = chart.corners(face as u32);
        directions.extend([a, a + b, 0.5 * (b + c), (a + 3.0 * c).normalize()].map(|d| 0.5 * d));
    }
    directions
}

#[test]
fn charts_of_real_organs_are_positive_and_even() {
    for (name, mesh, sphere, report) in real_charts() {
        assert_eq!(sphere.triangles, mesh.triangles, "{name}");
        assert!(sphere.directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-12), "{name}");
        let total_m2 = mesh.area_m2();
        let mut covered = 0.0;
        let mut ratios = Vec::new();
        for (face, triangle) in sphere.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|vertex| sphere.directions[vertex as usize]);
            // The flat face through the directions must be a fair share of what it stands for, and look outward.
            let flat = 0.5 * (b - a).cross(c - a).dot((a + b + c).normalize());
            let share = mesh.face_area_m2(face as u32) / total_m2;
            assert!(flat > 1e-3 * share, "{name}: face {face} is flipped or degenerate: {flat:e} of {share:e}");
            let solid_angle = sphere.solid_angle(face as u32);
            covered += solid_angle;
            ratios.push(solid_angle / (4.0 * PI) / share);
        }
        assert!((covered - 4.0 * PI).abs() < 1e-9, "{name}: covers {covered} steradians");
        assert!(sphere.is_positive(), "{name}");
        ratios.sort_unstable_by(f64::total_cmp);
        let count = ratios.len();
        let (low, high) = (ratios[count / 100], ratios[count - 1 - count / 100]);
        assert!(low >= 0.2 && high <= 5.0, "{name}: area ratios {low} to {high}");
        let reported = &report.distortion;
        assert!(reported.area_min == ratios[0] && reported.area_max == ratios[count - 1], "{name}");
        assert!((reported.area_p1 - low).abs() < 0.1 && (reported.area_p99 - high).abs() < 0.1, "{name}");
        println!("{name}: {report:?}");
    }
}

#[test]
fn every_direction_lies_in_exactly_one_face() {
    let mut rng = Pcg32::seed_from_u64(7);
    let hook = hook();
    let (sphere, _) = chart::build(&hook, &ChartOptions::default()).unwrap();
    for (name, sphere) in real_charts().map(|(name, _, sphere, _)| (name, sphere)).chain([("hook", sphere)]) {
        let count = if sphere.triangles.len() > 8000 { 1000 } else { 4000 };
        let random: Vec<DVec3> = (0..count).map(|_| random_direction(&mut rng)).collect();
        for direction in awkward_directions(&sphere).into_iter().chain(random) {
            let faces = faces_that_contain(&sphere, direction);
            assert_eq!(faces.len(), 1, "{name}: {direction} lies in {faces:?}");
            let start = rng.random_range(0..sphere.triangles.len() as u32);
            let point = sphere.locate(start, direction);
            assert_eq!(point.face, faces[0], "{name}: {direction}");
            assert!((sphere.direction(point) - direction.normalize()).length() < 1e-9, "{name}: {direction}");
        }
    }
}

#[test]
fn charts_repeat_to_the_last_bit() {
    let bits = |mesh: &SurfaceMesh| {
        let (sphere, report) = chart::build(mesh, &ChartOptions::default()).unwrap();
        let directions: Vec<[u64; 3]> = sphere.directions.iter().map(|d| d.to_array().map(f64::to_bits)).collect();
        (directions, report)
    };
    let organs = ORGANS.iter().filter_map(|(name, _)| real_mesh(name)).chain([hook()]);
    for mesh in organs {
        assert_eq!(bits(&mesh), bits(&mesh));
    }
}

#[test]
fn a_broken_chart_is_not_positive() {
    let (mut sphere, _) = chart::build(&hook(), &ChartOptions::default()).unwrap();
    assert!(sphere.is_positive());
    let mirrored = SphereMesh { directions: sphere.directions.iter().map(|&d| -d).collect(), ..sphere.clone() };
    assert!(!mirrored.is_positive());
    let [a, b, c] = sphere.triangles[0];
    let [a, b, c] = [a, b, c].map(|vertex| vertex as usize);
    let kept = sphere.directions[a];
    // Onto the edge across from it: its face is degenerate. Beyond it: its face is flipped.
    sphere.directions[a] = (sphere.directions[b] + sphere.directions[c]).normalize();
    sphere.directions[a] = (1.1 * sphere.directions[a] - 0.1 * kept).normalize();
    assert!(!sphere.is_positive());
    sphere.directions[a] = sphere.directions[b];
    assert!(!sphere.is_positive());
    sphere.directions[a] = kept;
    assert!(sphere.is_positive());
    sphere.triangles.pop();
    assert!(!SphereMesh::new(sphere.directions, sphere.triangles).is_positive(), "a face is missing");
}

#[test]
fn star_shaped_organs_are_projected_from_inside() {
    let shift = DVec3::new(3.0, -1.0, 2.0);
    let ball = octasphere(8, |d| d + shift);
    let (sphere, report) = chart::build(&ball, &ChartOptions::default()).unwrap();
    assert_eq!((report.method, report.is_star_shaped), (ChartMethod::CentralProjection, true));
    // The centre of a ball is the point farthest from all its face planes: angles are those of the ball itself.
    let direction = |vertex: usize| (ball.positions_m[vertex].as_dvec3() - shift).normalize();
    for vertex in 1..ball.positions_m.len() {
        let expected = direction(0).dot(direction(vertex));
        assert!((sphere.directions[0].dot(sphere.directions[vertex]) - expected).abs() < 1e-3);
    }
    // Star-shaped, but with tips that a projection would starve of texels.
    let cigar = octasphere(8, |d| d * DVec3::new(6.0, 1.0, 1.0));
    let (_, report) = chart::build(&cigar, &ChartOptions::default()).unwrap();
    assert_eq!((report.method, report.is_star_shaped), (ChartMethod::Relaxed, true));
    assert!(report.distortion.is_within(0.2, 5.0), "{report:?}");
    let (_, report) = chart::build(&hook(), &ChartOptions::default()).unwrap();
    assert_eq!((report.method, report.is_star_shaped), (ChartMethod::Relaxed, false));
    for (name, _, _, report) in real_charts() {
        assert_eq!(report.is_star_shaped, name == "liver2.obj", "{name}");
    }
}

#[test]
fn relaxed_chart_of_a_ball_is_nearly_the_ball() {
    let ball = octasphere(10, |d| d);
    let options = ChartOptions { allow_central: false, ..Default::default() };
    let (_, report) = chart::build(&ball, &options).unwrap();
    assert_eq!(report.method, ChartMethod::Relaxed);
    let distortion = &report.distortion;
    assert!(distortion.area_min > 0.97 && distortion.area_max < 1.03 && distortion.angle_p99 < 1.03, "{distortion:?}");
}

#[test]
fn even_texels_and_true_angles_are_traded() {
    let at = |area_exponent| {
        let options = ChartOptions { area_exponent, ..Default::default() };
        chart::build(&hook(), &options).unwrap().1.distortion
    };
    let (shape, area) = (at(1.0), at(4.0));
    assert!(area.area_p1 > shape.area_p1 && area.angle_mean > shape.angle_mean, "{shape:?} {area:?}");
}

#[test]
fn thin_and_tiny_faces_can_be_charted() {
    // One vertex almost on an edge, and edges from 1e-6 to 1 long.
    let spike = octasphere(6, |d| if d.x > 0.99 { d * 40.0 } else { d });
    let pinch = octasphere(6, |d| d * (1e-6 + d.x * d.x));
    for mesh in [spike, pinch] {
        let (sphere, _) = chart::build(&mesh, &ChartOptions::default()).unwrap();
        assert!(sphere.is_positive());
    }
    let tetrahedron = SurfaceMesh {
        positions_m: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        uvs: None,
    };
    assert!(chart::build(&tetrahedron, &ChartOptions::default()).unwrap().0.is_positive());
}

#[test]
fn poles_go_where_they_are_asked_for() {
    let egg = octasphere(10, |d| d * DVec3::new(3.0, 1.0, 1.5));
    let build = |poles| chart::build(&egg, &ChartOptions { poles, ..Default::default() }).unwrap();
    let (_, report) = build(Poles::Axis(DVec3::NEG_X));
    assert!(report.north.position_m.x < -2.8 && report.south.position_m.x > 2.8, "{report:?}");
    let point_m = DVec3::new(0.0, 0.0, 1.5);
    let (sphere, report) = build(Poles::AwayFrom(point_m));
    let nearest = |axis: DVec3| {
        [axis, -axis]
            .map(|direction| position_m(&egg, sphere.locate(0, direction)).distance(point_m))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    };
    let mut rng = Pcg32::seed_from_u64(3);
    let reported = report.north.position_m.distance(point_m).min(report.south.position_m.distance(point_m));
    assert!((reported - nearest(DVec3::Y)).abs() < 1e-6);
    for _ in 0..200 {
        assert!(nearest(random_direction(&mut rng)) < reported + 0.1);
    }
    for approach in [DVec3::Y, DVec3::new(0.0, -2.0, 0.0), DVec3::Z] {
        let (_, report) = build(Poles::Auto { approach });
        for pole in [report.north, report.south] {
            assert!(pole.normal.dot(approach.normalize()) < 0.05, "{approach}: {pole:?}");
        }
    }
}

#[test]
fn the_report_says_where_the_poles_are() {
    for (name, mesh, sphere, report) in real_charts() {
        for (pole, direction) in [(report.north, DVec3::Y), (report.south, DVec3::NEG_Y)] {
            assert!((sphere.direction(pole.point) - direction).length() < 1e-9, "{name}");
            assert!(position_m(&mesh, pole.point).distance(pole.position_m) < 1e-9, "{name}");
            // By default neither faces the side that instruments come from.
            assert!(pole.normal.y < 0.0, "{name}: {pole:?}");
        }
    }
}

#[test]
fn surfaces_that_are_no_sphere_are_refused() {
    let error = |mesh: &SurfaceMesh| chart::build(mesh, &ChartOptions::default()).unwrap_err();
    let ball = octasphere(3, |d| d);
    let count = ball.positions_m.len() as u32;
    let mut open = ball.clone();
    open.triangles.pop();
    assert!(matches!(error(&open), ChartError::Open { .. }));
    assert!(error(&open).to_string().contains("open"));
    assert_eq!(error(&torus()), ChartError::Genus { genus: 1 });
    let mut two = ball.clone();
    two.positions_m.extend(ball.positions_m.iter().map(|&p| p + 5.0 * Vec3::X));
    two.triangles.extend(ball.triangles.iter().map(|t| t.map(|vertex| vertex + count)));
    assert_eq!(error(&two), ChartError::Parts { count: 2 });
    let mut pinched = two.clone();
    for triangle in &mut pinched.triangles {
        *triangle = triangle.map(|vertex| if vertex == 2 * count - 1 { 0 } else { vertex });
    }
    pinched.positions_m.pop();
    assert_eq!(error(&pinched), ChartError::PinchedVertex { vertex: 0 });
    let mut turned = ball.clone();
    turned.triangles[4].swap(0, 1);
    assert!(matches!(error(&turned), ChartError::NotManifold { .. }));
    let mut unused = ball.clone();
    unused.positions_m.push(Vec3::ZERO);
    assert_eq!(error(&unused), ChartError::UnusedVertex { vertex: count });
    let mut missing = ball.clone();
    missing.triangles[0][1] = 9999;
    assert_eq!(error(&missing), ChartError::NoSuchVertex { face: 0, vertex: 9999 });
    let mut infinite = ball.clone();
    infinite.positions_m[3].y = f32::NAN;
    assert_eq!(error(&infinite), ChartError::NotFinite { vertex: 3 });
    assert_eq!(error(&SurfaceMesh::default()), ChartError::Empty);
    let flat = octasphere(2, |_| DVec3::ONE);
    assert_eq!(error(&flat), ChartError::NoArea);
    let options = ChartOptions { area_exponent: f64::NAN, ..Default::default() };
    assert!(matches!(chart::build(&ball, &options), Err(ChartError::Options { .. })));
}

#[test]
fn texture_coordinates_and_directions_are_inverse() {
    let (sphere, _) = chart::build(&hook(), &ChartOptions::default()).unwrap();
    let atlas = Atlas::Spherical(sphere);
    assert_eq!(atlas.uv_from_direction(DVec3::Y), DVec2::ZERO);
    assert_eq!(atlas.uv_from_direction(DVec3::NEG_Y), DVec2::new(0.0, 1.0));
    assert_eq!(atlas.uv_from_direction(DVec3::Z), DVec2::new(0.0, 0.5));
    assert_eq!(atlas.uv_from_direction(DVec3::X), DVec2::new(0.25, 0.5));
    assert_eq!(atlas.direction_from_uv(DVec2::new(0.3, 0.0)), DVec3::Y);
    assert_eq!(atlas.direction_from_uv(DVec2::new(0.3, 1.0)), DVec3::NEG_Y);
    // Just west of the date line, by less than a turn can resolve.
    for west in [-0.0, -1e-300, -1e-17, -1e-9] {
        let uv = atlas.uv_from_direction(DVec3::new(west, 0.0, 1.0));
        assert!((0.0..1.0).contains(&uv.x), "{west:e}: {uv}");
    }
    // Beyond the pole the texture goes on half a turn further.
    let beyond = atlas.direction_from_uv(DVec2::new(0.1, -0.2));
    assert!((beyond - atlas.direction_from_uv(DVec2::new(0.6, 0.2))).length() < 1e-12);
    let beyond = atlas.direction_from_uv(DVec2::new(1.1, 1.2));
    assert!((beyond - atlas.direction_from_uv(DVec2::new(0.6, 0.8))).length() < 1e-12);
    let mut rng = Pcg32::seed_from_u64(5);
    for _ in 0..2000 {
        let direction = random_direction(&mut rng);
        let uv = atlas.uv_from_direction(direction);
        assert!((0.0..1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y));
        assert!((atlas.direction_from_uv(uv) - direction).length() < 1e-12);
    }
}

#[test]
fn every_texel_shows_the_face_that_holds_its_centre() {
    for (name, _, sphere, _) in real_charts() {
        let atlas = Atlas::Spherical(sphere);
        let sphere = atlas.chart();
        let table = atlas.table(256, 128);
        assert_eq!(table.faces.len(), 256 * 128);
        for y in 0..128 {
            for x in 0..256 {
                let direction = atlas.direction_from_uv(table.centre_uv(x, y));
                assert!(sphere.contains(table.face(x, y), direction), "{name}: texel {x}, {y}");
            }
        }
        // Odd sizes put centres on the meridian across from the date line and on the equator.
        let odd = atlas.table(61, 31);
        for (x, y) in [(30, 15), (0, 0), (60, 30), (30, 0)] {
            assert_eq!(faces_that_contain(sphere, atlas.direction_from_uv(odd.centre_uv(x, y))), [odd.face(x, y)]);
        }
    }
}

#[test]
fn the_table_is_the_same_for_any_number_of_threads() {
    let (sphere, _) = chart::build(&hook(), &ChartOptions::default()).unwrap();
    let atlas = Atlas::Spherical(sphere);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| atlas.table(200, 100))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn places_are_found_from_texture_coordinates() {
    let mut rng = Pcg32::seed_from_u64(11);
    for (name, mesh, sphere, _) in real_charts() {
        let atlas = Atlas::Spherical(sphere);
        let table = atlas.table(128, 64);
        for _ in 0..2000 {
            let point = random_point(&mut rng, mesh.triangles.len());
            let uv = atlas.uv(point);
            for uv in [uv, uv + DVec2::X, uv - 3.0 * DVec2::X] {
                let found = atlas.locate_uv(uv, &table).unwrap();
                let error_m = position_m(&mesh, found).distance(position_m(&mesh, point));
                assert!(error_m < 1e-7, "{name}: {uv} is {error_m} m off");
                assert!(found.barycentric.min_element() > -1e-9, "{name}: {found:?}");
            }
        }
        for uv in [DVec2::ZERO, DVec2::ONE, DVec2::new(0.5, 0.0), DVec2::new(0.0, 0.5), DVec2::new(-0.5, 2.0)] {
            let found = atlas.locate_uv(uv, &table).unwrap();
            assert_eq!(faces_that_contain(atlas.chart(), atlas.direction_from_uv(uv)), [found.face], "{name}: {uv}");
        }
        assert_eq!(atlas.locate_uv(DVec2::new(f64::NAN, 0.5), &table), None);
        assert!(atlas.locate_uv(DVec2::splat(0.3), &FaceTable::default()).is_some());
    }
}

/// Place on a face's plane that a direction shows, also a little beyond its edges.
fn position_on_face_m(atlas: &Atlas, mesh: &SurfaceMesh, face: u32, uv: DVec2) -> DVec3 {
    let barycentric = atlas.chart().barycentric(face, atlas.direction_from_uv(uv));
    position_m(mesh, SurfacePoint { face, barycentric })
}

#[test]
fn jacobian_matches_finite_differences() {
    let mut rng = Pcg32::seed_from_u64(13);
    let hook = hook();
    let (sphere, _) = chart::build(&hook, &ChartOptions::default()).unwrap();
    for (mesh, sphere) in real_charts().map(|(_, mesh, sphere, _)| (mesh, sphere)).chain([(hook, sphere)]) {
        let normals = mesh.vertex_normals();
        let atlas = Atlas::Spherical(sphere);
        for _ in 0..500 {
            let point = random_point(&mut rng, mesh.triangles.len());
            let frame = atlas.frame(point, &mesh.positions_m, &normals);
            assert!(frame.position_m.distance(position_m(&mesh, point)) < 1e-12);
            assert!((frame.uv - atlas.uv(point)).length() < 1e-12);
            let step = 1e-6;
            for (axis, derivative) in [(DVec2::X, frame.dposition_du_m), (DVec2::Y, frame.dposition_dv_m)] {
                let ends = [1.0, -1.0].map(|sign| {
                    position_on_face_m(&atlas, &mesh, point.face, frame.uv + sign * step * axis)
                });
                let measured = (ends[0] - ends[1]) / (2.0 * step);
                let scale = derivative.length().max(1e-3);
                assert!((measured - derivative).length() < 1e-4 * scale, "{measured} against {derivative}");
                assert!(derivative.dot(frame.face_normal).abs() < 1e-9 * scale);
            }
            let [u, v] = [frame.dposition_du_m, frame.dposition_dv_m].map(|d| frame.uv_velocity(d));
            assert!((u - DVec2::X).length() < 1e-6 && (v - DVec2::Y).length() < 1e-6, "{u} {v}");
            assert!(frame.uv_velocity(frame.face_normal).length() < 1e-6 * frame.du_dposition_per_m.length());
            assert!((frame.normal.length() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn direction_rates_are_finite_over_the_poles() {
    let mesh = hook();
    let normals = mesh.vertex_normals();
    let (sphere, report) = chart::build(&mesh, &ChartOptions::default()).unwrap();
    let atlas = Atlas::Spherical(sphere);
    for pole in [report.north, report.south] {
        let near = atlas.direction_from_uv(DVec2::new(0.37, 1e-5));
        for point in [pole.point, atlas.chart().locate(0, near)] {
            let frame = atlas.frame(point, &mesh.positions_m, &normals);
            let [a, b, _] = mesh.corners(point.face);
            let velocity = (b - a).normalize();
            let rate = frame.ddirection_dposition_per_m * velocity;
            // Move along the face by a micrometre and look where the chart says that this is.
            let [p, q, r] = mesh.corners(point.face);
            let moved = frame.position_m + 1e-6 * velocity;
            let area = (q - p).cross(r - p);
            let weight = |from: DVec3, to: DVec3| (from - moved).cross(to - moved).dot(area) / area.length_squared();
            let barycentric = DVec3::new(weight(q, r), weight(r, p), weight(p, q));
            let measured = (atlas.chart().direction(SurfacePoint { barycentric, ..point }) - frame.direction) / 1e-6;
            assert!((measured - rate).length() < 1e-3 * rate.length(), "{measured} against {rate}");
            assert!(frame.dposition_dv_m.length() > 0.0 && frame.du_dposition_per_m.is_finite());
        }
    }
    let north = atlas.chart().locate(0, DVec3::Y);
    let frame = atlas.frame(north, &mesh.positions_m, &normals);
    assert!(frame.dposition_du_m.length() < 1e-9, "all longitudes meet at the pole");
}

/// A square of two faces over half of the texture, two metres wide.
fn square() -> SurfaceMesh {
    let corners = [Vec2::new(0.0, 0.0), Vec2::new(1.0, 0.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 1.0)];
    SurfaceMesh {
        positions_m: corners.iter().map(|c| Vec3::new(2.0 * c.x, 2.0 * c.y, 0.0)).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uvs: Some(corners.iter().map(|c| Vec2::new(0.5 * c.x, c.y)).collect()),
    }
}

#[test]
fn own_texture_coordinates_are_used_where_they_are_bijective() {
    let mut mirrored = square();
    for uv in mirrored.uvs.as_mut().unwrap() {
        uv.y = 1.0 - uv.y;
    }
    for (mesh, is_mirrored) in [(square(), false), (mirrored, true)] {
        let planar = PlanarChart::new(&mesh).unwrap();
        assert_eq!(planar.is_mirrored(), is_mirrored);
        let atlas = Atlas::Planar(planar);
        let table = atlas.table(8, 4);
        for y in 0..4 {
            for x in 0..8 {
                assert_eq!(table.face(x, y) == NO_FACE, x >= 4, "texel {x}, {y}");
            }
        }
        let down = if is_mirrored { -1.0 } else { 1.0 };
        let expected = |uv: DVec2| DVec3::new(4.0 * uv.x, 2.0 * if is_mirrored { 1.0 - uv.y } else { uv.y }, 0.0);
        // Inside, on the shared edge, on the border and at corners.
        for uv in [(0.1, 0.3), (0.25, 0.5), (0.0, 0.7), (0.5, 0.5), (0.0, 0.0), (0.5, 1.0), (0.5, 0.0), (0.0, 1.0)] {
            let uv = DVec2::from(uv);
            let point = atlas.locate_uv(uv, &table).unwrap();
            let frame = atlas.frame(point, &mesh.positions_m, &mesh.vertex_normals());
            assert!(frame.position_m.distance(expected(uv)) < 1e-12 && (frame.uv - uv).length() < 1e-12, "{uv}");
            assert!((frame.dposition_du_m - DVec3::new(4.0, 0.0, 0.0)).length() < 1e-12);
            assert!((frame.dposition_dv_m - DVec3::new(0.0, 2.0 * down, 0.0)).length() < 1e-12);
            assert!((frame.uv_velocity(DVec3::ONE) - DVec2::new(0.25, 0.5 * down)).length() < 1e-12);
            assert!((frame.texel_area_m2(8, 4) - 0.25).abs() < 1e-12);
        }
        assert_eq!(atlas.locate_uv(DVec2::new(0.6, 0.5), &table), None);
        assert_eq!(atlas.locate_uv(DVec2::new(-0.1, 0.5), &table), None);
    }
}

#[test]
fn a_surface_with_a_handle_can_use_its_own_texture_coordinates() {
    // Each quad of the torus on a tile of its own: bijective, with gaps between the tiles.
    let torus = torus();
    let mut mesh = SurfaceMesh { uvs: Some(Vec::new()), ..Default::default() };
    for (face, triangle) in torus.triangles.iter().enumerate() {
        let quad = face / 2;
        let corner = Vec2::new((quad % 10) as f32, (quad / 10) as f32) / 10.0;
        let offsets = if face % 2 == 0 { [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]] } else { [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]] };
        let start = mesh.positions_m.len() as u32;
        mesh.triangles.push([start, start + 1, start + 2]);
        mesh.positions_m.extend(triangle.map(|vertex| torus.positions_m[vertex as usize]));
        mesh.uvs.as_mut().unwrap().extend(offsets.map(|o| corner + 0.08 * Vec2::from(o)));
    }
    let atlas = Atlas::Planar(PlanarChart::new(&mesh).unwrap());
    let table = atlas.table(100, 100);
    let mut shown = 0;
    for y in 0..100 {
        for x in 0..100 {
            let direction = atlas.direction_from_uv(table.centre_uv(x, y));
            let faces = faces_that_contain(atlas.chart(), direction);
            assert!(faces.len() <= 1, "texel {x}, {y}: {faces:?}");
            assert_eq!(table.face(x, y), faces.first().copied().unwrap_or(NO_FACE), "texel {x}, {y}");
            shown += faces.len();
        }
    }
    assert_eq!(shown, 96 * 64, "96 tiles of 8 by 8 texels");
    let mut rng = Pcg32::seed_from_u64(17);
    for _ in 0..500 {
        let point = random_point(&mut rng, mesh.triangles.len());
        let found = atlas.locate_uv(atlas.uv(point), &table).unwrap();
        assert!(position_m(&mesh, found).distance(position_m(&mesh, point)) < 1e-6);
    }
}

#[test]
fn texture_coordinates_that_are_not_bijective_are_refused() {
    let error = |change: fn(&mut SurfaceMesh)| {
        let mut mesh = square();
        change(&mut mesh);
        PlanarChart::new(&mesh).unwrap_err()
    };
    let uvs = |mesh: &mut SurfaceMesh| std::mem::take(mesh.uvs.as_mut().unwrap());
    assert_eq!(error(|mesh| mesh.uvs = None), PlanarError::NoCoordinates);
    assert_eq!(error(|mesh| mesh.triangles.clear()), PlanarError::Empty);
    assert!(matches!(error(|mesh| mesh.uvs.as_mut().unwrap()[2].x = 1.5), PlanarError::Outside { vertex: 2, .. }));
    assert!(matches!(error(|mesh| mesh.uvs.as_mut().unwrap()[1].y = f32::NAN), PlanarError::Outside { vertex: 1, .. }));
    assert_eq!(error(|mesh| mesh.triangles[1][2] = 7), PlanarError::NoSuchVertex { face: 1, vertex: 7 });
    assert_eq!(error(|mesh| mesh.uvs.as_mut().unwrap()[3] = Vec2::new(0.25, 0.5)), PlanarError::Degenerate { face: 1 });
    assert_eq!(
        error(|mesh| mesh.uvs.as_mut().unwrap()[3] = Vec2::new(0.4, 0.2)),
        PlanarError::Flipped { first: 0, second: 1 }
    );
    let mut short = square();
    uvs(&mut short);
    assert_eq!(PlanarChart::new(&short).unwrap_err(), PlanarError::Count { coordinates: 0, vertices: 4 });
    // A third face, apart on the surface, over the corner where the first has its own by a millionth.
    let third = |corner: f32| {
        let mut mesh = square();
        mesh.positions_m.extend([Vec3::new(5.0, 0.0, 0.0), Vec3::new(6.0, 0.0, 0.0), Vec3::new(5.0, 1.0, 0.0)]);
        mesh.uvs.as_mut().unwrap().extend([Vec2::new(corner, 0.0), Vec2::new(0.9, 0.0), Vec2::new(0.9, 0.8)]);
        mesh.triangles.push([4, 5, 6]);
        mesh
    };
    assert!(PlanarChart::new(&third(0.5)).is_ok(), "faces that touch do not overlap");
    let error = PlanarChart::new(&third(0.499999)).unwrap_err();
    assert_eq!(error, PlanarError::Overlap { first: 0, second: 2 });
    assert!(error.to_string().contains("faces 0 and 2 overlap"), "{error}");
    // One face inside another, sharing nothing.
    let mut inside = square();
    inside.positions_m.extend([Vec3::X, Vec3::Y, Vec3::Z]);
    inside.uvs.as_mut().unwrap().extend([Vec2::new(0.3, 0.1), Vec2::new(0.32, 0.1), Vec2::new(0.32, 0.12)]);
    inside.triangles.push([4, 5, 6]);
    assert_eq!(PlanarChart::new(&inside).unwrap_err(), PlanarError::Overlap { first: 0, second: 2 });
}
