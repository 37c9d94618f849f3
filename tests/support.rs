//! What several tests use.

use bevy::prelude::*;
use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse};
use bevy_surgery::organ::texture_mesh::TextureMeshOptions;
use bevy_surgery::organ::{OrganModel, OrganOptions, SurfaceMesh};
use bevy_surgery::prelude::*;
use bevy_surgery::skin::TileSource;
use bevy_surgery::skin::tiles::{ColourRamp, TileDetail, TileOptions};
use std::path::PathBuf;

/// A file of the real data beside the project; prints a line and returns `None` where it is not there.
pub fn real_file(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {name} is not here");
    None
}

/// A real organ scaled to 20 cm.
pub fn real_mesh(name: &str) -> Option<SurfaceMesh> {
    let bytes = std::fs::read(real_file(&format!("mesh/{name}"))?).expect("a listed file can be read");
    let options = LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..default() };
    Some(parse(&bytes, name, &options).expect("a real organ loads"))
}

/// A sphere about the origin, as an organ: an icosahedron subdivided `levels` times.
pub fn sphere_mesh(radius_m: f32, levels: u32) -> SurfaceMesh {
    let golden = (1.0 + 5_f32.sqrt()) / 2.0;
    let mut positions: Vec<Vec3> = [(0, 1, 2), (2, 0, 1), (1, 2, 0)]
        .iter()
        .flat_map(|&(x, y, z)| {
            [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)].map(|(a, b)| {
                let values = [0.0, a, b];
                Vec3::new(values[x], values[y], values[z]).normalize()
            })
        })
        .collect();
    // The hull of twelve points: every triple that has all others on one side.
    let mut triangles = Vec::new();
    for a in 0..12u32 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                let [p, q, r] = [a, b, c].map(|i| positions[i as usize]);
                let normal = (q - p).cross(r - p);
                if normal.dot(p).abs() > 0.1 && positions.iter().all(|x| normal.dot(*x - p) * normal.dot(p) <= 1e-5) {
                    triangles.push(if normal.dot(p) > 0.0 { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::with_capacity(triangles.len() * 4);
        for &[a, b, c] in &triangles {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    positions.push((positions[i as usize] + positions[j as usize]).normalize());
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    SurfaceMesh { positions_m: positions.iter().map(|p| *p * radius_m).collect(), triangles, uvs: None }
}

/// A spherical organ of 642 vertices.
pub fn sphere_organ(radius_m: f32) -> OrganModel {
    let texture_mesh = TextureMeshOptions { iterations: 5, tile_sweeps: 2, ..default() };
    let options = OrganOptions { texture_mesh, table_width_px: 64, ..default() };
    OrganModel::from_mesh(sphere_mesh(radius_m, 3), "sphere", &options).expect("a sphere is an organ")
}

/// A skin of one colour that only Lambert's law shades.
pub fn plain_skin(srgb: [u8; 3]) -> Skin {
    let tiles = TileOptions {
        resolution_px: 64,
        cells_per_edge: 4.0,
        ramp: ColourRamp::from_srgb8(&[(0.0, srgb), (1.0, srgb)]),
        cell_jitter: 0.0,
        detail: TileDetail { relief: 0.0, net: 0.0, ..default() },
        ..default()
    };
    let tiles = TileSource::Generated(tiles);
    Skin { tiles, mottle: 0.0, scatter: 0.0, sheen: 0.0, relief_m: 0.0, tint: Color::WHITE, ..Skin::liver() }
}
