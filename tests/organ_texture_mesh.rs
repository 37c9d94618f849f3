//! The texture mesh on real organs and on shapes with known answers.

use crate::support::{real_mesh, sphere_mesh};
use bevy_surgery::organ::chart::{self, ChartOptions};
use bevy_surgery::organ::mesh::{NO_FACE, SurfaceMesh};
use bevy_surgery::organ::sphere::SphereMesh;
use bevy_surgery::organ::texture_mesh::{
    SecondaryVertices, SkinMesh, TextureMesh, TextureMeshError, TextureMeshOptions, TextureMeshReport, build,
    build_planar,
};
use glam::{DVec2, DVec3, Mat3, Vec3};
use std::collections::BTreeMap;

const ORGANS: [&str; 4] = ["liver.obj", "liver2.obj", "liver-smooth.obj", "gallbladder.stl"];

/// A sphere's own directions are its chart.
fn sphere_chart(mesh: &SurfaceMesh) -> SphereMesh {
    SphereMesh::new(mesh.positions_m.iter().map(|p| p.as_dvec3().normalize()).collect(), mesh.triangles.clone())
}

fn real_organs() -> impl Iterator<Item = (&'static str, SurfaceMesh, SphereMesh)> {
    ORGANS.into_iter().filter_map(|name| {
        let mesh = real_mesh(name)?;
        let (chart, _) = chart::build(&mesh, &ChartOptions::default()).expect("a real organ has a chart");
        Some((name, mesh, chart))
    })
}

fn with_edges(edge_length_m: f32) -> TextureMeshOptions {
    TextureMeshOptions { edge_length_m: Some(edge_length_m), iterations: 10, tile_sweeps: 4, ..Default::default() }
}

fn sub_triangles(skin: &SkinMesh) -> impl Iterator<Item = [usize; 3]> {
    skin.indices.chunks_exact(3).map(|t| [t[0] as usize, t[1] as usize, t[2] as usize])
}

fn corners_m(skin: &SkinMesh, triangle: [usize; 3], positions_m: &[Vec3]) -> [DVec3; 3] {
    triangle.map(|c| skin.position_m(skin.corners[c].vertex, positions_m))
}

/// The overlay shows exactly the geometric surface: every sub-triangle lies in its face the right way round, together
/// they cover every face once, and no edge is left open except at the surface's own border.
fn assert_shows_the_surface(mesh: &SurfaceMesh, skin: &SkinMesh) {
    let mut covered_m2 = vec![0.0; mesh.triangles.len()];
    let mut uses: BTreeMap<(u32, u32), [u32; 2]> = BTreeMap::new();
    for (index, triangle) in sub_triangles(skin).enumerate() {
        let face = skin.faces[index];
        for corner in triangle {
            let vertex = &skin.secondary[skin.corners[corner].vertex as usize];
            let sum: f32 = vertex.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-6, "weights sum to {sum}");
            for (primary, weight) in vertex.primary.iter().zip(vertex.weights) {
                assert!((0.0..=1.0).contains(&weight));
                assert!(weight == 0.0 || mesh.triangles[face as usize].contains(primary), "a corner is off its face");
            }
        }
        let [a, b, c] = corners_m(skin, triangle, &mesh.positions_m);
        let [p, q, r] = mesh.corners(face);
        let normal = (q - p).cross(r - p).normalize_or_zero();
        let area_m2 = 0.5 * (b - a).cross(c - a).dot(normal);
        // Single-precision weights may turn a sliver of no width over by their rounding, nothing more.
        assert!(area_m2 > -1e-7 * mesh.face_area_m2(face), "sub-triangle {index} is flipped by {area_m2} m2");
        covered_m2[face as usize] += area_m2;
        let ids = triangle.map(|c| skin.corners[c].vertex);
        for (a, b) in [(ids[0], ids[1]), (ids[1], ids[2]), (ids[2], ids[0])] {
            assert_ne!(a, b);
            uses.entry((a.min(b), a.max(b))).or_default()[usize::from(a > b)] += 1;
        }
    }
    for (face, covered) in covered_m2.iter().enumerate() {
        let whole = mesh.face_area_m2(face as u32);
        // Single-precision weights shift vertices by some 1e-7 of their distance from the origin.
        let corners = mesh.corners(face as u32);
        let perimeter_m: f64 = (0..3).map(|k| corners[k].distance(corners[(k + 1) % 3])).sum();
        let shift_m = 2e-7 * corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
        let allowed = 1e-6 * whole + shift_m * perimeter_m;
        assert!((covered - whole).abs() < allowed, "face {face} is covered {} times", covered / whole);
    }
    let (covered, whole) = (covered_m2.iter().sum::<f64>(), mesh.area_m2());
    assert!((covered / whole - 1.0).abs() < 1e-6, "{covered} m2 of {whole} m2");

    let borders = mesh.neighbours().iter().flatten().filter(|&&n| n == NO_FACE).count();
    let open: Vec<_> = uses.iter().filter(|(_, sides)| **sides != [1, 1]).collect();
    assert!(open.iter().all(|(_, sides)| sides[0] + sides[1] == 1), "an edge is used twice the same way");
    if borders == 0 {
        assert!(open.is_empty(), "{} open edges", open.len());
    } else {
        let border_edges: Vec<[u32; 2]> = mesh
            .triangles
            .iter()
            .zip(mesh.neighbours())
            .flat_map(|(t, n)| (0..3).filter(move |&k| n[k] == NO_FACE).map(move |k| [t[k], t[(k + 1) % 3]]))
            .collect();
        for ((a, b), _) in open {
            let on = |v: u32, edge: &[u32; 2]| {
                let vertex = &skin.secondary[v as usize];
                vertex.primary.iter().zip(vertex.weights).all(|(p, w)| w == 0.0 || edge.contains(p))
            };
            assert!(border_edges.iter().any(|e| on(*a, e) && on(*b, e)), "an edge inside the surface is open");
        }
    }
}

/// The ends of a texture edge with the bits of a vertex's weights on them.
type OnSide = [(u32, u32); 3];

/// Tiles: weights are weights, texture vertices are corners, both sides of a texture edge agree to the last bit, and
/// no sub-triangle that is large enough to have an orientation is flipped.
fn assert_tiles_fit(mesh: &SurfaceMesh, texture: &TextureMesh, skin: &SkinMesh) {
    let mut seen: BTreeMap<(u32, u32), Vec<OnSide>> = BTreeMap::new();
    let mut shared = 0;
    for corner in &skin.corners {
        let weights = corner.tile_barycentric;
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-6 && weights.iter().all(|w| (0.0..=1.0).contains(w)));
        let ids = texture.triangulation.triangles[corner.texture_triangle as usize];
        let mut on: Vec<(u32, u32)> =
            ids.into_iter().zip(weights).filter(|(_, w)| *w != 0.0).map(|(v, w)| (v, w.to_bits())).collect();
        on.sort_unstable();
        if on.len() < 3 {
            let key = (corner.vertex, on.first().map_or(0, |f| f.0));
            let mut padded = [(u32::MAX, 0); 3];
            padded[..on.len()].copy_from_slice(&on);
            seen.entry(key).or_default().push(padded);
        }
    }
    for ((vertex, _), sides) in &seen {
        assert!(
            sides.windows(2).all(|pair| pair[0] == pair[1]),
            "vertex {vertex} differs between its tiles: {sides:?}"
        );
        shared += usize::from(sides.len() > 1);
    }
    assert!(shared > 0, "no vertex is shared between tiles");
    let smallest_m2 = 1e-9 * f64::from(texture.edge_length_m).powi(2);
    for triangle in sub_triangles(skin) {
        let [p, q, r] = triangle.map(|c| {
            let [_, b, c] = skin.corners[c].tile_barycentric.map(f64::from);
            DVec2::new(b + 0.5 * c, 0.75f64.sqrt() * c)
        });
        let [a, b, c] = corners_m(skin, triangle, &mesh.positions_m);
        let area_m2 = 0.5 * (b - a).cross(c - a).length();
        assert!(area_m2 < smallest_m2 || (q - p).perp_dot(r - p) > -1e-7, "a sub-triangle is flipped in its tile");
    }
}

#[test]
fn real_organs_have_regular_texture_meshes_and_undistorted_tiles() {
    for (name, mesh, chart) in real_organs() {
        let (texture, skin, report) = build(&mesh, &chart, &TextureMeshOptions::default()).expect("it has a skin");
        println!("{name}: {report:#?}");
        assert!(report.min_angle_mean_deg > 45.0, "{name}: {}", report.min_angle_mean_deg);
        assert!(report.anisotropy_mean < 1.35, "{name}: {}", report.anisotropy_mean);
        assert!(report.anisotropy_p99 < 2.0, "{name}: {}", report.anisotropy_p99);
        assert_eq!(report.triangles as usize, texture.triangulation.triangles.len());
        assert_eq!(report.overlay_triangles as usize * 3, skin.indices.len());
        // A closed surface of genus 0: twice as many triangles as vertices, less four.
        assert_eq!(texture.triangulation.triangles.len() + 4, 2 * texture.vertices.len());
        assert_shows_the_surface(&mesh, &skin);
        assert_tiles_fit(&mesh, &texture, &skin);
    }
}

/// The reported anisotropy, recomputed here by other means: the singular values from the metric of the tile's axes.
#[test]
fn the_reported_anisotropy_is_that_of_the_drawn_triangles() {
    let mesh = sphere_mesh(0.1, 3);
    let (_, skin, report) = build(&mesh, &sphere_chart(&mesh), &TextureMeshOptions::default()).expect("a skin");
    let (mut sum, mut total) = (0.0, 0.0);
    for triangle in sub_triangles(&skin) {
        let [a, b, c] = corners_m(&skin, triangle, &mesh.positions_m);
        let [p, q, r] = triangle.map(|c| {
            let [_, b, c] = skin.corners[c].tile_barycentric.map(f64::from);
            DVec2::new(b + 0.5 * c, 0.75f64.sqrt() * c)
        });
        let (u, v) = (q - p, r - p);
        let determinant = u.perp_dot(v);
        if determinant <= 0.0 {
            continue;
        }
        // Where the tile's x and y axes go on the surface.
        let x = ((b - a) * v.y - (c - a) * u.y) / determinant;
        let y = ((c - a) * u.x - (b - a) * v.x) / determinant;
        let (e, f, g) = (x.dot(x), x.dot(y), y.dot(y));
        let root = ((e - g).powi(2) + 4.0 * f * f).sqrt();
        let area = 0.5 * (b - a).cross(c - a).length();
        sum += area * ((e + g + root) / (e + g - root).max(1e-30)).sqrt().min(1e3);
        total += area;
    }
    let mean = sum / total;
    assert!((mean - f64::from(report.anisotropy_mean)).abs() < 1e-3, "{mean} and {}", report.anisotropy_mean);
    // A sphere is the easiest organ there is.
    assert!(report.anisotropy_mean < 1.15 && report.min_angle_mean_deg > 50.0, "{report:#?}");
    assert!((report.edge_length_mean_m / texture_edge(&mesh) - 1.0).abs() < 0.1, "{report:#?}");
}

/// Edge length of 400 equilateral triangles that cover the organ.
fn texture_edge(mesh: &SurfaceMesh) -> f32 {
    (mesh.area_m2() / 400.0 * 2.0 / 0.75f64.sqrt()).sqrt() as f32
}

#[test]
fn edges_much_longer_and_much_shorter_than_faces_work() {
    let coarse = sphere_mesh(0.1, 0);
    let fine = sphere_mesh(0.1, 4);
    for (mesh, edge_length_m) in [(&coarse, 0.008), (&coarse, 0.05), (&fine, 0.06), (&fine, 0.004)] {
        let (texture, skin, report) =
            build(mesh, &sphere_chart(mesh), &with_edges(edge_length_m)).expect("both extremes work");
        assert_shows_the_surface(mesh, &skin);
        assert_tiles_fit(mesh, &texture, &skin);
        assert!((report.edge_length_mean_m / edge_length_m - 1.0).abs() < 0.2, "{edge_length_m}: {report:#?}");
        assert!(report.min_angle_mean_deg > 40.0, "{edge_length_m}: {report:#?}");
    }
}

/// The same sphere again, but with texture edges through every kind of coincidence: the first vertices are thrown along
/// the axes, which are the vertices and edges of this mesh.
#[test]
fn no_iterations_at_all_still_give_a_valid_overlay() {
    let mesh = sphere_mesh(0.1, 2);
    let options = TextureMeshOptions { iterations: 0, tile_sweeps: 0, ..Default::default() };
    let (texture, skin, _) = build(&mesh, &sphere_chart(&mesh), &options).expect("an unrelaxed skin");
    assert_shows_the_surface(&mesh, &skin);
    assert_tiles_fit(&mesh, &texture, &skin);
}

#[test]
fn the_same_input_gives_the_same_bits_and_another_seed_does_not() {
    let mesh = sphere_mesh(0.1, 3);
    let chart = sphere_chart(&mesh);
    let options = with_edges(0.03);
    let first = build(&mesh, &chart, &options).expect("a skin");
    assert_eq!(first, build(&mesh, &chart, &options).expect("a skin"));
    let other = build(&mesh, &chart, &TextureMeshOptions { seed: 2, ..options }).expect("a skin");
    assert_ne!(first.0, other.0);
}

#[test]
fn secondary_vertices_follow_a_moved_organ_on_its_faces() {
    let mesh = sphere_mesh(0.1, 2);
    let (_, skin, _) = build(&mesh, &sphere_chart(&mesh), &with_edges(0.04)).expect("a skin");
    let secondary = SecondaryVertices::new(&skin.secondary);
    let shear = Mat3::from_cols(Vec3::new(1.3, 0.2, 0.0), Vec3::new(-0.4, 0.9, 0.1), Vec3::new(0.0, 0.3, 1.1));
    let moved: Vec<Vec3> = mesh.positions_m.iter().map(|&p| shear * p + p * p.x * 3.0 + Vec3::Y).collect();
    let moved_mesh = SurfaceMesh { positions_m: moved.clone(), ..mesh.clone() };
    let normals = moved_mesh.vertex_normals();
    let (mut positions_out, mut normals_out) = (vec![Vec3::ZERO; secondary.len()], vec![Vec3::ZERO; secondary.len()]);
    secondary.update(&moved, &normals, &mut positions_out, &mut normals_out).expect("the buffers fit");
    // The old overlay on the moved organ is still an overlay of it.
    assert_shows_the_surface(&moved_mesh, &skin);
    for (index, vertex) in skin.secondary.iter().enumerate() {
        let expected = skin.position_m(index as u32, &moved);
        assert!(positions_out[index].as_dvec3().distance(expected) < 1e-6);
        let normal: Vec3 = (0..3).map(|k| normals[vertex.primary[k] as usize] * vertex.weights[k]).sum();
        assert!(normals_out[index].distance(normal) < 1e-6, "normals are combined, not normalised");
    }
    for vertex in 0..mesh.positions_m.len() {
        assert_eq!(positions_out[vertex], moved[vertex], "geometric vertices come first and are themselves");
    }
    let all = secondary.len();
    assert!(secondary.update(&moved[1..], &normals, &mut positions_out, &mut normals_out).is_err());
    let error = secondary.update(&moved, &normals, &mut positions_out[..all - 1], &mut normals_out).unwrap_err();
    assert_eq!((error.results_needed, error.results), (all, all - 1));
}

#[test]
fn senseless_requests_are_errors() {
    let mesh = sphere_mesh(0.1, 1);
    let chart = sphere_chart(&mesh);
    let error = |edge_length_m| build(&mesh, &chart, &with_edges(edge_length_m)).unwrap_err();
    for senseless in [f32::NAN, f32::INFINITY, 0.0, -0.01] {
        assert!(matches!(error(senseless), TextureMeshError::InvalidEdgeLength { .. }), "{senseless}");
    }
    assert!(matches!(error(1e-5), TextureMeshError::TooFine { .. }));
    assert!(matches!(error(10.0), TextureMeshError::TooCoarse { .. }));

    let options = TextureMeshOptions::default();
    let nothing = SurfaceMesh::default();
    let no_chart = SphereMesh::new(Vec::new(), Vec::new());
    assert_eq!(build(&nothing, &no_chart, &options).unwrap_err(), TextureMeshError::NoArea);
    let mut unmeasurable = mesh.clone();
    unmeasurable.positions_m[3].x = f32::NAN;
    assert_eq!(build(&unmeasurable, &chart, &options).unwrap_err(), TextureMeshError::NoArea);
    let mut folded = chart.clone();
    folded.directions[0] = -folded.directions[0];
    assert_eq!(build(&mesh, &folded, &options).unwrap_err(), TextureMeshError::InvalidChart);
    let other = sphere_chart(&sphere_mesh(0.1, 0));
    assert_eq!(build(&mesh, &other, &options).unwrap_err(), TextureMeshError::InvalidChart);
}

/// A flat sheet of `n` by `n` squares, one decimetre wide, with its own texture coordinates stretched along u.
fn sheet(n: u32, stretch: f64) -> (SurfaceMesh, SphereMesh) {
    let at = |i: u32, j: u32| j * (n + 1) + i;
    let mut mesh = SurfaceMesh::default();
    let mut directions = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let (x, y) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            mesh.positions_m.push(Vec3::new(x as f32, y as f32, 0.0) * 0.1);
            directions.push(DVec3::new(stretch * x - 0.5, y - 0.5, 1.0));
        }
    }
    for j in 0..n {
        for i in 0..n {
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    let chart = SphereMesh::new(directions, mesh.triangles.clone());
    (mesh, chart)
}

#[test]
fn an_open_sheet_with_its_own_coordinates_gets_a_perfect_lattice() {
    let (mesh, chart) = sheet(7, 1.0);
    let (texture, skin, report) = build_planar(&mesh, &chart, &with_edges(0.013)).expect("a lattice");
    assert_shows_the_surface(&mesh, &skin);
    assert_tiles_fit(&mesh, &texture, &skin);
    assert!(report.anisotropy_mean < 1.001 && report.anisotropy_p99 < 1.01, "{report:#?}");
    assert!((report.area_scale_p1 - 1.0).abs() < 0.01 && (report.area_scale_p99 - 1.0).abs() < 0.01, "{report:#?}");
    assert!((report.edge_length_mean_m - 0.013).abs() < 1e-5 && report.min_angle_mean_deg > 59.9, "{report:#?}");
    assert_eq!(report.valence_counts[6], report.valence_counts.iter().sum::<u32>());
    let used: Vec<u32> = skin.corners.iter().map(|c| c.texture_triangle).collect();
    assert!((0..report.triangles).all(|t| used.contains(&t)), "a texture triangle without a piece is listed");

    // Coordinates that are twice as long along u as the sheet is: no tile can be square with the surface.
    let (mesh, chart) = sheet(7, 2.0);
    let unrelaxed = TextureMeshOptions { tile_sweeps: 0, ..with_edges(0.013) };
    let (_, skin, report) = build_planar(&mesh, &chart, &unrelaxed).expect("a lattice");
    assert_shows_the_surface(&mesh, &skin);
    assert!((report.anisotropy_mean - 2.0).abs() < 1e-3 && (report.anisotropy_p99 - 2.0).abs() < 1e-2, "{report:#?}");
}

#[test]
fn flipped_own_coordinates_are_refused() {
    let (mesh, mut chart) = sheet(4, 1.0);
    chart.directions[12].x += 0.4;
    assert_eq!(build_planar(&mesh, &chart, &with_edges(0.02)).unwrap_err(), TextureMeshError::InvalidChart);
    chart.directions[12].x = f64::NAN;
    assert_eq!(build_planar(&mesh, &chart, &with_edges(0.02)).unwrap_err(), TextureMeshError::InvalidChart);
}

#[test]
fn everything_survives_the_cache() {
    let mesh = sphere_mesh(0.1, 2);
    let built = build(&mesh, &sphere_chart(&mesh), &with_edges(0.05)).expect("a skin");
    let bytes = postcard::to_stdvec(&built).expect("plain data");
    let read: (TextureMesh, SkinMesh, TextureMeshReport) = postcard::from_bytes(&bytes).expect("the same data");
    assert_eq!(built, read);
}
