//! Texture coordinates of an organ and their inverse: every texel one face, every place found, exact Jacobians.

use super::organ_chart::{
    faces_that_contain, hook, position_m, random_direction, random_point, read, real_charts, torus,
};
use bevy_surgery::organ::atlas::{Atlas, FaceTable};
use bevy_surgery::organ::chart::{self, ChartError, ChartOptions};
use bevy_surgery::organ::clean::{Topology, Weld};
use bevy_surgery::organ::load::{LoadOptions, MeshUnit};
use bevy_surgery::organ::mesh::{NO_FACE, SurfaceMesh};
use bevy_surgery::organ::planar::{PlanarChart, PlanarError};
use bevy_surgery::organ::sphere::SurfacePoint;
use glam::{DVec2, DVec3, Vec2, Vec3};
use rand::SeedableRng;
use rand_pcg::Pcg32;

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
                let ends = [1.0, -1.0]
                    .map(|sign| position_on_face_m(&atlas, &mesh, point.face, frame.uv + sign * step * axis));
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
        let offsets =
            if face % 2 == 0 { [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]] } else { [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]] };
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

#[test]
fn real_texture_coordinates_are_judged() {
    let options = |node: Option<&str>| LoadOptions {
        unit: MeshUnit::LargestExtent(0.2),
        node: node.map(str::to_string),
        weld: Weld::ByPositionAndUv,
        topology: Topology::Any,
    };
    // An open piece of a spleen: no sphere, but unwrapped without overlap.
    if let Some(mesh) = read("spleen-parts.glb", &options(Some("VH_M_colic_surface_of_spleen"))) {
        assert!(matches!(chart::build(&mesh, &ChartOptions::default()), Err(ChartError::Open { .. })));
        let atlas = Atlas::Planar(PlanarChart::new(&mesh).unwrap());
        let table = atlas.table(256, 256);
        for y in 0..256 {
            for x in 0..256 {
                let faces = faces_that_contain(atlas.chart(), atlas.direction_from_uv(table.centre_uv(x, y)));
                assert_eq!(table.face(x, y), faces.first().copied().unwrap_or(NO_FACE), "texel {x}, {y}");
                assert!(faces.len() <= 1, "texel {x}, {y}: {faces:?}");
            }
        }
        let shown = table.faces.iter().filter(|&&face| face != NO_FACE).count();
        let area = |face| 0.5 * atlas.chart().determinant(face);
        let covered: f64 = (0..mesh.triangles.len() as u32).map(area).sum();
        assert!((shown as f64 / 65536.0 - covered).abs() < 0.01, "{shown} texels for an area of {covered}");
    }
    // Its coordinates lay parts of the liver over each other.
    if let Some(mesh) = read("liver-smoothUV.obj", &options(None)) {
        assert!(matches!(PlanarChart::new(&mesh), Err(PlanarError::Overlap { .. })));
    }
}
