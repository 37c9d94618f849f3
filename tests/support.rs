//! What several tests use.

use bevy::prelude::*;
use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse};
use bevy_surgery::organ::texture_mesh::TextureMeshOptions;
use bevy_surgery::organ::{OrganModel, OrganOptions, SurfaceMesh, procedural_ellipsoid};
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

/// A sphere about the origin: an icosahedron whose edges are halved `levels` times.
pub fn sphere_mesh(radius_m: f32, levels: u32) -> SurfaceMesh {
    procedural_ellipsoid(Vec3::splat(radius_m), 1 << levels)
}

/// A spherical organ of 1,442 vertices.
pub fn sphere_organ(radius_m: f32) -> OrganModel {
    let texture_mesh = TextureMeshOptions { iterations: 5, tile_sweeps: 2, ..default() };
    let options = OrganOptions { texture_mesh, table_width_px: 64, ..default() };
    OrganModel::from_mesh(procedural_ellipsoid(Vec3::splat(radius_m), 12), "sphere", &options)
        .expect("a sphere is an organ")
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
