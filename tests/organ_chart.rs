//! The spherical chart of an organ: bijective, even enough, the same every time.

use bevy_surgery::organ::chart::{self, ChartError, ChartMethod, ChartOptions, ChartReport, Poles};
use bevy_surgery::organ::load::{self, LoadOptions, MeshUnit};
use bevy_surgery::organ::mesh::SurfaceMesh;
use bevy_surgery::organ::sphere::{SphereMesh, SurfacePoint};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f64::consts::PI;

const ORGANS: [(&str, usize); 4] =
    [("liver.obj", 139), ("liver2.obj", 1170), ("liver-smooth.obj", 2194), ("gallbladder.stl", 7352)];

/// A real organ scaled to 20 cm; `None`, with a line that says so, where the file is absent.
fn real_mesh(name: &str) -> Option<SurfaceMesh> {
    read(name, &LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..Default::default() })
}

pub(crate) fn read(name: &str, options: &LoadOptions) -> Option<SurfaceMesh> {
    let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/mesh/{}"), name);
    let Ok(bytes) = std::fs::read(&path) else {
        println!("skipped: {name} is not here");
        return None;
    };
    Some(load::parse(&bytes, name, options).unwrap_or_else(|error| panic!("{name}: {error}")))
}

pub(crate) fn real_charts() -> impl Iterator<Item = (&'static str, SurfaceMesh, SphereMesh, ChartReport)> {
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
pub(crate) fn hook() -> SurfaceMesh {
    octasphere(12, |d| {
        let along = 1.6 * d.x;
        let radius = 0.35 * (1.1 - 0.8 * d.x);
        let centre = DVec3::new((2.0 * along).sin(), (2.0 * along).cos(), 0.0);
        centre * (1.0 + radius * d.y) + DVec3::Z * radius * d.z
    })
}

pub(crate) fn torus() -> SurfaceMesh {
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

pub(crate) fn random_direction(rng: &mut Pcg32) -> DVec3 {
    let y: f64 = rng.random_range(-1.0..1.0);
    let (sin, cos) = rng.random_range(0.0..2.0 * PI).sin_cos();
    let radius = (1.0 - y * y).sqrt();
    DVec3::new(radius * sin, y, radius * cos)
}

pub(crate) fn random_point(rng: &mut Pcg32, faces: usize) -> SurfacePoint {
    let (a, b): (f64, f64) = (rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
    let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
    SurfacePoint { face: rng.random_range(0..faces as u32), barycentric: DVec3::new(1.0 - a - b, a, b) }
}

pub(crate) fn faces_that_contain(chart: &SphereMesh, direction: DVec3) -> Vec<u32> {
    (0..chart.triangles.len() as u32).filter(|&face| chart.contains(face, direction)).collect()
}

pub(crate) fn position_m(mesh: &SurfaceMesh, point: SurfacePoint) -> DVec3 {
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
