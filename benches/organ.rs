//! What it costs to make an organ, to find it again, and to move it.

use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse};
use bevy_surgery::organ::mesh::vertex_normals_into;
use bevy_surgery::organ::procedural::{ProceduralLiver, procedural_liver};
use bevy_surgery::organ::texture_mesh::{SecondaryVertices, TextureMeshOptions};
use bevy_surgery::organ::{OrganCache, OrganModel, OrganOptions};
use bevy_surgery::skin::tiles::{TileOptions, TileSet};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::Vec3;
use std::hint::black_box;

/// A real mesh's bytes; prints a line where the file is not there.
fn real_file(name: &str) -> Option<Vec<u8>> {
    let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/mesh/{}"), name);
    let bytes = std::fs::read(path).ok();
    if bytes.is_none() {
        println!("skipped: {name} is not here");
    }
    bytes
}

fn load(c: &mut Criterion) {
    let options = LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..LoadOptions::default() };
    let organ_options = OrganOptions::default();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let cache = OrganCache::in_folder(folder.path());
    let mut group = c.benchmark_group("load");
    group.sample_size(10);
    for name in ["liver-smooth.obj", "gallbladder.stl"] {
        let Some(bytes) = real_file(name) else { continue };
        let make = |cache: &OrganCache| {
            let mesh = parse(black_box(&bytes), name, &options).expect("a real organ");
            OrganModel::from_mesh_cached(mesh, name, &organ_options, cache).expect("a real organ")
        };
        group.bench_function(format!("{name}, first"), |b| b.iter(|| make(&OrganCache::off())));
        make(&cache);
        group.bench_function(format!("{name}, again"), |b| b.iter(|| make(&cache)));
    }
    group.finish();
}

fn move_secondary(c: &mut Criterion) {
    // Texture triangles of 55 mm on the crate's own liver give about the 3,300 triangles of the paper of 2002.
    let texture_mesh = TextureMeshOptions { edge_length_m: Some(0.055), ..TextureMeshOptions::default() };
    let options = OrganOptions { texture_mesh, ..OrganOptions::default() };
    let mesh = procedural_liver(&ProceduralLiver::default());
    let organ = OrganModel::from_mesh(mesh, "liver", &options).expect("an organ");
    let triangles = organ.skin_mesh.indices.len() / 3;
    let secondary = SecondaryVertices::new(&organ.skin_mesh.secondary);
    let rest = organ.mesh.positions_m.clone();
    let mut normals = organ.mesh.vertex_normals();
    let (mut moved, mut positions, mut out_normals) =
        (rest.clone(), vec![Vec3::ZERO; secondary.len()], vec![Vec3::ZERO; secondary.len()]);
    let mut shift = 0.0_f32;
    c.bench_function(&format!("move {triangles} skin triangles"), |b| {
        b.iter(|| {
            shift += 1e-6;
            for (to, from) in moved.iter_mut().zip(&rest) {
                *to = *from + Vec3::splat(shift);
            }
            // A step that moves vertices renews their normals too.
            vertex_normals_into(black_box(&moved), &organ.mesh.triangles, &mut normals);
            secondary.update(black_box(&moved), &normals, &mut positions, &mut out_normals).expect("long enough");
        });
    });
}

fn tiles(c: &mut Criterion) {
    let mut group = c.benchmark_group("tiles");
    group.sample_size(10);
    group.bench_function("four of 512 px", |b| b.iter(|| TileSet::generate(black_box(&TileOptions::liver()))));
    group.finish();
}

criterion_group!(benches, load, move_secondary, tiles);
criterion_main!(benches);
