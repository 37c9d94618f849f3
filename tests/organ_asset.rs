//! Organs as assets: from files, with settings, from the cache.

use crate::support::{real_file, sphere_mesh};
use bevy::asset::LoadState;
use bevy::prelude::*;
use bevy_surgery::organ::load::{LoadOptions, MeshUnit};
use bevy_surgery::organ::{ChartKind, OrganCache, OrganError, OrganModel, OrganOptions};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use std::path::Path;

fn load(app: &mut TestApp, file: &Path, options: OrganOptions) -> Handle<OrganModel> {
    let assets = app.world().resource::<AssetServer>().clone();
    let handle: Handle<OrganModel> = assets
        .load_builder()
        .with_settings(move |settings: &mut OrganOptions| *settings = options.clone())
        .override_unapproved()
        .load(file.to_path_buf());
    app.idle_until("the file", |_| matches!(assets.load_state(&handle), LoadState::Loaded | LoadState::Failed(_)));
    handle
}

/// An octahedron with 10 cm radius as OBJ text.
fn octahedron() -> String {
    let mut text = String::new();
    for axis in ["0.1 0 0", "-0.1 0 0", "0 0.1 0", "0 -0.1 0", "0 0 0.1", "0 0 -0.1"] {
        text += &format!("v {axis}\n");
    }
    text + "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n"
}

#[test]
fn a_file_becomes_an_organ_with_a_shape() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("octahedron.obj");
    std::fs::write(&file, octahedron()).expect("written");
    let mut app = TestApp::cpu();
    let options = OrganOptions { table_width_px: 64, ..default() }.with_largest_extent_m(0.4).centred();
    let handle = load(&mut app, &file, options);
    let organ = app.world_mut().spawn(Organ(handle)).id();
    app.step(1);
    let shape = app.world().get::<OrganShape>(organ).expect("a loaded organ has a shape");
    assert_eq!(shape.positions_m().len(), 6);
    assert!(shape.positions_m().iter().all(|position| (position.length() - 0.2).abs() < 1e-6));
    assert!(shape.normals().iter().zip(shape.positions_m()).all(|(n, p)| n.dot(*p) > 0.19));
}

#[test]
fn a_file_that_cannot_be_used_says_so() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let open = octahedron().lines().filter(|line| *line != "f 1 4 6").collect::<Vec<_>>().join("\n");
    for (name, text, wanted) in
        [("open.obj", open.as_str(), "closed"), ("empty.stl", "", "empty"), ("text.ply", "hello", "text.ply")]
    {
        let file = folder.path().join(name);
        std::fs::write(&file, text).expect("written");
        let mut app = TestApp::cpu();
        let handle = load(&mut app, &file, OrganOptions::default());
        let LoadState::Failed(error) = app.world().resource::<AssetServer>().load_state(&handle) else {
            panic!("{name} was loaded")
        };
        let text = error.to_string();
        assert!(text.contains(name) && text.contains(wanted), "{name}: {text}");
    }
}

#[test]
fn senseless_options_are_errors() {
    let organ = |options: &OrganOptions| OrganModel::from_mesh(sphere_mesh(0.1, 1), "sphere", options);
    let mut options = OrganOptions { table_width_px: 0, ..default() };
    assert!(matches!(organ(&options), Err(OrganError::TableWidth { .. })));
    options.table_width_px = 1 << 20;
    assert!(matches!(organ(&options), Err(OrganError::TableWidth { .. })));
    options = OrganOptions { chart: ChartKind::OwnUvs, ..default() };
    let error = organ(&options).expect_err("a sphere without texture coordinates has none to use");
    assert!(error.to_string().starts_with("sphere: "), "{error}");
}

#[test]
fn the_cache_returns_the_same_organ_and_survives_damage() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let cache = OrganCache::in_folder(folder.path().join("organs"));
    let options = OrganOptions { table_width_px: 64, ..default() };
    let make = || OrganModel::from_mesh_cached(sphere_mesh(0.1, 2), "sphere", &options, &cache).expect("an organ");
    let same = |a: &OrganModel, b: &OrganModel| {
        a.texture_mesh == b.texture_mesh
            && a.skin_mesh == b.skin_mesh
            && a.report == b.report
            && a.atlas.chart() == b.atlas.chart()
    };
    let first = make();
    let files = || -> Vec<_> {
        std::fs::read_dir(folder.path().join("organs"))
            .expect("made")
            .map(|entry| entry.expect("an entry").path())
            .collect()
    };
    assert_eq!(files().len(), 1);
    let whole = std::fs::read(&files()[0]).expect("readable");
    assert!(same(&first, &make()), "what the cache returns is what was built");
    for damaged in [&whole[..whole.len() / 2], &[0u8; 100][..], &[][..]] {
        std::fs::write(&files()[0], damaged).expect("written");
        assert!(same(&first, &make()), "a damaged file is made anew");
        assert_eq!(std::fs::read(&files()[0]).expect("readable"), whole);
    }
    let mut flipped = whole.clone();
    flipped[whole.len() / 3] ^= 1;
    std::fs::write(&files()[0], &flipped).expect("written");
    assert!(same(&first, &make()), "one wrong bit is noticed");
    let other = OrganModel::from_mesh_cached(sphere_mesh(0.1001, 2), "sphere", &options, &cache).expect("an organ");
    assert!(!same(&first, &other));
    assert_eq!(files().len(), 2, "another surface is another file");
}

#[test]
fn real_organs_load_from_their_files() {
    let mut options =
        OrganOptions { load: LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..default() }, ..default() };
    options.table_width_px = 256;
    for name in ["liver.obj", "liver2.obj", "liver-smooth.obj", "gallbladder.stl"] {
        let Some(file) = real_file(&format!("mesh/{name}")) else { continue };
        let mut app = TestApp::cpu();
        let handle = load(&mut app, &file, options.clone());
        let models = app.world().resource::<Assets<OrganModel>>();
        let model = models.get(&handle).unwrap_or_else(|| panic!("{name} did not load"));
        assert!(model.atlas.chart().is_positive(), "{name}");
        let covered = model.table.faces.iter().all(|face| (*face as usize) < model.mesh.triangles.len());
        assert!(covered, "{name}: a texel without a face");
    }
}
