//! Welding, orienting, and what a surface may not be.

use super::euler;
use bevy_surgery::organ::clean::{CleanReport, RawMesh, Topology, Weld, clean};
use bevy_surgery::organ::error::MeshFault;
use bevy_surgery::organ::mesh::SurfaceMesh;
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// A unit cube from the origin, 12 faces looking outward.
fn cube() -> RawMesh {
    let corner = |k: u32| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32);
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    RawMesh {
        positions: (0..8).map(corner).collect(),
        uvs: None,
        triangles: quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    }
}

fn shifted(mesh: &RawMesh, by: Vec3, scale: f32) -> RawMesh {
    RawMesh { positions: mesh.positions.iter().map(|p| *p * scale + by).collect(), ..mesh.clone() }
}

fn joined(a: &RawMesh, b: &RawMesh) -> RawMesh {
    let offset = a.positions.len() as u32;
    let moved = b.triangles.iter().map(|face| face.map(|v| v + offset));
    RawMesh {
        positions: a.positions.iter().chain(&b.positions).copied().collect(),
        uvs: None,
        triangles: a.triangles.iter().copied().chain(moved).collect(),
    }
}

/// Every face with three vertices of its own, as STL has it.
fn exploded(mesh: &RawMesh) -> RawMesh {
    RawMesh {
        positions: mesh.triangles.iter().flatten().map(|&v| mesh.positions[v as usize]).collect(),
        uvs: None,
        triangles: (0..mesh.triangles.len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect(),
    }
}

/// A grid of quads whose sides are glued: a torus, or with one row only and a half turn, a Moebius band.
fn glued_grid(around: u32, along: u32, place: impl Fn(f32, f32) -> Vec3, half_turn: bool) -> RawMesh {
    let rows = if half_turn { along + 1 } else { along };
    let index = |i: u32, j: u32| match (half_turn, i == around) {
        (true, true) => along - j,
        (true, false) => i * rows + j,
        (false, _) => i % around * rows + j % along,
    };
    let mut mesh = RawMesh::default();
    for i in 0..around {
        mesh.positions.extend((0..rows).map(|j| place(i as f32 / around as f32, j as f32 / along as f32)));
        for j in 0..along {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn torus() -> RawMesh {
    let place = |u: f32, v: f32| {
        let radius = 0.1 + 0.03 * (TAU * v).cos();
        Vec3::new(radius * (TAU * u).cos(), radius * (TAU * u).sin(), 0.03 * (TAU * v).sin())
    };
    glued_grid(24, 12, place, false)
}

fn moebius_band() -> RawMesh {
    let place = |u: f32, v: f32| {
        let (angle, across) = (TAU * u, 0.06 * (v - 0.5));
        let radius = 0.1 + across * (PI * u).cos();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), across * (PI * u).sin())
    };
    glued_grid(24, 2, place, true)
}

fn closed(raw: RawMesh) -> Result<(SurfaceMesh, CleanReport), MeshFault> {
    clean(raw, Weld::ByPosition, Topology::Closed)
}

fn open(raw: RawMesh) -> Result<(SurfaceMesh, CleanReport), MeshFault> {
    clean(raw, Weld::ByPosition, Topology::Any)
}

#[test]
fn a_clean_cube_comes_back_as_it_is() {
    let (mesh, report) = closed(cube()).unwrap();
    assert_eq!((mesh.positions_m, mesh.triangles), (cube().positions, cube().triangles));
    assert_eq!(report, CleanReport { components: 1, ..Default::default() });
}

#[test]
fn vertices_are_welded_within_the_tolerance_and_no_further() {
    let mut raw = exploded(&cube());
    for (number, position) in raw.positions.iter_mut().enumerate() {
        *position += Vec3::splat((number % 3) as f32 * 2e-7);
    }
    let (mesh, report) = closed(raw).unwrap();
    assert_eq!((mesh.positions_m.len(), report.vertices_welded), (8, 28));
    assert!((mesh.volume_m3() - 1.0).abs() < 1e-5);

    // Forty tips in a row, half the tolerance (1e-6 of a diagonal of 1.034) apart: each that stays takes the two
    // behind it along, and the row does not become one.
    let tips = (0..40).map(|k| Vec3::new(k as f32 * 0.5e-6, 0.0, 0.0));
    let blades = (0..40).flat_map(|k| [0.5, 0.505].map(|x| Vec3::new(x + 0.01 * k as f32, 0.5, 0.0)));
    let positions = tips.chain(blades).collect();
    let triangles = (0..40).map(|k| [k, 40 + 2 * k, 41 + 2 * k]).collect();
    let (_, report) = open(RawMesh { positions, uvs: None, triangles }).unwrap();
    assert_eq!((report.vertices_welded, report.components), (26, 40));
}

#[test]
fn faces_are_turned_outward_whatever_way_they_came() {
    let mut raw = cube();
    raw.triangles.iter_mut().step_by(3).for_each(|face| face.swap(0, 1));
    let (mesh, report) = closed(raw).unwrap();
    assert!((mesh.volume_m3() - 1.0).abs() < 1e-12);
    assert_eq!(report.faces_turned, 4);

    let mut inside_out = shifted(&cube(), Vec3::new(-900.0, 500.0, 1300.0), 1.0);
    inside_out.triangles.iter_mut().for_each(|face| face.swap(1, 2));
    let (mesh, report) = closed(inside_out).unwrap();
    assert_eq!(report.faces_turned, 12);
    assert!((mesh.volume_m3() - 1.0).abs() < 1e-6, "{}", mesh.volume_m3());
}

#[test]
fn an_open_surface_keeps_the_side_that_most_of_it_had() {
    let mut raw = cube();
    raw.triangles.truncate(10);
    let as_it_was = raw.triangles.clone();
    raw.triangles[4].swap(0, 1);
    let (mesh, report) = open(raw).unwrap();
    assert_eq!(report.faces_turned, 1);
    // The turned face starts at another corner, but runs the same way round.
    let rotations = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]];
    assert!(mesh.triangles.iter().zip(as_it_was).all(|(face, before)| rotations(before).contains(face)));
}

#[test]
fn of_several_pieces_the_one_with_the_largest_area_stays() {
    let small = shifted(&torus(), Vec3::splat(5.0), 1.0);
    let (mesh, report) = closed(joined(&small, &cube())).unwrap();
    assert_eq!((mesh.triangles.len(), euler(&mesh)), (12, 2));
    assert_eq!((report.components, report.faces_in_other_components, report.vertices_unused), (2, 576, 288));
    // Two cubes that touch in one corner are two pieces.
    let (mesh, _) = closed(joined(&cube(), &shifted(&cube(), Vec3::ONE, 2.0))).unwrap();
    assert!((mesh.volume_m3() - 8.0).abs() < 1e-9);
}

#[test]
fn a_few_degenerate_and_doubled_faces_are_cleaned_away_and_counted() {
    let mut raw = torus();
    let (whole, _) = open(raw.clone()).unwrap();
    raw.triangles.insert(100, [5, 5, 9]);
    raw.triangles.insert(200, raw.triangles[7]);
    let [a, b, c] = raw.triangles[9];
    raw.triangles.push([c, b, a]);
    let (mesh, report) = open(raw).unwrap();
    assert_eq!(mesh, whole);
    assert_eq!((report.faces_degenerate, report.faces_duplicate), (1, 2));
}

#[test]
fn a_corner_on_an_edge_is_flipped_in_instead_of_tearing_a_crack() {
    // The middle of an edge as a vertex on one side only, closed by a face without area.
    let mut raw = joined(&RawMesh::default(), &shifted(&torus(), Vec3::ZERO, 1.0));
    let [a, b, c] = raw.triangles[40];
    let middle = raw.positions.len() as u32;
    raw.positions.push((raw.positions[a as usize] + raw.positions[b as usize]) / 2.0);
    raw.triangles[40] = [a, middle, c];
    raw.triangles.push([middle, b, c]);
    raw.triangles.push([a, b, middle]);
    let faces = raw.triangles.len();
    let (mesh, report) = open(raw).unwrap();
    assert_eq!((report.edges_flipped, report.faces_degenerate), (1, 0));
    assert_eq!((mesh.triangles.len(), euler(&mesh)), (faces, 0));
    assert!(mesh.neighbours().iter().flatten().all(|&face| face != bevy_surgery::organ::mesh::NO_FACE));
}

#[test]
fn seams_stay_open_in_the_index_but_are_no_borders() {
    let mut raw = exploded(&cube());
    // Each of the six sides has its own square of texture.
    let uv = |corner: usize| Vec2::new([0.0, 1.0, 1.0, 0.0, 1.0, 0.0][corner % 6], (corner / 6) as f32);
    raw.uvs = Some((0..36).map(uv).collect());
    let (mesh, _) = clean(raw.clone(), Weld::ByPositionAndUv, Topology::Closed).unwrap();
    assert!(mesh.positions_m.len() > 8 && mesh.uvs.as_ref().unwrap().len() == mesh.positions_m.len());
    assert!((mesh.volume_m3() - 1.0).abs() < 1e-12);
    let (mesh, _) = clean(raw, Weld::ByPosition, Topology::Closed).unwrap();
    assert_eq!((mesh.positions_m.len(), mesh.uvs), (8, None));
}

#[test]
fn what_is_no_sphere_is_told_apart() {
    let mut hole = cube();
    hole.triangles.pop();
    assert!(matches!(closed(hole.clone()), Err(MeshFault::NotClosed { border_edges: 3, .. })));
    assert!(open(hole).is_ok());

    assert!(matches!(closed(torus()), Err(MeshFault::Genus { genus: 1 })));
    assert_eq!(euler(&open(torus()).unwrap().0), 0);

    assert!(matches!(closed(moebius_band()), Err(MeshFault::NotClosed { .. })));
    assert!(matches!(open(moebius_band()), Err(MeshFault::NotOrientable { .. })));

    let mut wall = cube();
    // Two of its sides lie on edges of the cube, the third crosses it.
    wall.triangles.push([0, 1, 7]);
    let fault = open(wall).unwrap_err();
    assert!(matches!(fault, MeshFault::NotManifoldEdge { edges: 2, faces_there: 3, .. }), "{fault}");

    // A strip of triangles that bites its own tail in one point.
    let strip = RawMesh {
        positions: (0..7).map(|k| Vec3::new(k as f32, (k % 2) as f32, (k * k) as f32 * 0.1)).collect(),
        uvs: None,
        triangles: vec![[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4], [4, 5, 6], [5, 0, 6]],
    };
    let fault = open(strip).unwrap_err();
    assert_eq!(fault, MeshFault::NotManifoldVertex { vertices: 1, at: Vec3::ZERO });

    let pillow = RawMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
        uvs: None,
        triangles: vec![[0, 1, 2], [0, 2, 3], [1, 0, 3], [1, 3, 2]],
    };
    assert!(matches!(closed(pillow), Err(MeshFault::Flat { .. })));
    let point = RawMesh { positions: vec![Vec3::ONE; 3], uvs: None, triangles: vec![[0, 1, 2]] };
    assert!(matches!(open(point), Err(MeshFault::Flat { .. })));
}

#[test]
fn numbers_that_make_no_mesh_are_refused() {
    assert_eq!(closed(RawMesh::default()).unwrap_err(), MeshFault::Empty);
    let mut out_of_range = cube();
    out_of_range.triangles[3][1] = 8;
    assert!(matches!(closed(out_of_range), Err(MeshFault::IndexOutOfRange { index: 8, count: 8, .. })));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut raw = cube();
        raw.positions[5].y = bad;
        assert_eq!(closed(raw).unwrap_err(), MeshFault::NotFinite { place: "vertex 5".into() });
    }
    assert!(matches!(clean(cube(), Weld::ByPositionAndUv, Topology::Any), Err(MeshFault::NoUvs { .. })));
    let many = RawMesh { positions: vec![Vec3::ONE; 3], uvs: None, triangles: vec![[0, 1, 2]; 5_000_001] };
    assert!(matches!(closed(many), Err(MeshFault::TooMany { count: 5_000_001, .. })));
    let mut flat = cube();
    flat.triangles[0] = [0, 0, 6];
    assert!(matches!(closed(flat), Err(MeshFault::Degenerate { degenerate: 1, faces: 12, .. })));
}
