//! Scenes of every version of the crate, as files: one per version in `tests/fixtures`, which must go on loading.

#[cfg(feature = "render")]
use super::components::{altered, authored};
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::{SceneComponents, SceneVersion, load_scene, scene_text};
use bevy_surgery::testing::TestApp;
#[cfg(feature = "render")]
use bevy_surgery::tools::ToolRig;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures");

fn file_of(version: SceneVersion) -> PathBuf {
    Path::new(FOLDER).join(format!("scene-{version}.surgery.scn.ron"))
}

/// A world with every component that is saved.
#[cfg(feature = "render")]
fn everything() -> TestApp {
    let mut app = TestApp::cpu();
    let assets = app.world().resource::<AssetServer>().clone();
    for path in authored() {
        altered(app.world_mut(), path);
    }
    let world = app.world_mut();
    world.spawn((Name::new("organ of a file"), Organ(assets.load("nowhere/liver.obj"))));
    let volume = (Name::new("volume of a file"), CtVolume(assets.load("nowhere/bone.nrrd")));
    let volume = world.spawn(volume).id();
    let pool = Pool { cell_m: 2e-4, ..Pool::new(volume) };
    world.spawn((Name::new("pool"), pool, ChildOf(volume)));
    let lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a lattice");
    let body = ElasticBody::uniform(&lattice, ElasticTissue::FAT).expect("a body").pinned_where(|at| at.x == 0.0);
    world.spawn((Name::new("body"), lattice, body));
    let scope = world.spawn((Name::new("scope"), Microscope::default())).id();
    world.spawn((Name::new("rig"), ToolRig::before_camera(scope, 0.25)));
    world.spawn((Name::new("monitor"), MonitorView { of: scope }));
    app
}

#[cfg(feature = "render")]
#[test]
#[ignore = "writes the file of a new version"]
fn write_the_file_of_this_version() {
    let file = file_of(SceneVersion::NOW);
    assert!(!file.exists(), "{} is there already; a new version has a new file", file.display());
    let text = scene_text(everything().world()).expect("it can be saved");
    std::fs::write(file, text).expect("it can be written");
}

fn texts() -> Vec<(String, String)> {
    let files = std::fs::read_dir(FOLDER).expect("the folder").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> = files.filter(|path| path.to_string_lossy().ends_with(".surgery.scn.ron")).collect();
    files.sort();
    assert!(!files.is_empty());
    let read = |path: &PathBuf| std::fs::read_to_string(path).expect("a file");
    files.iter().map(|path| (path.display().to_string(), read(path))).collect()
}

/// Whatever changes in the crate, these load: else `SceneVersion::NOW` must grow and `src/scenes/migrate.rs` say what became of what.
#[test]
fn scenes_of_all_versions_load() {
    for (file, text) in texts() {
        let mut app = TestApp::cpu();
        load_scene(app.world_mut(), &file, &text).unwrap_or_else(|error| panic!("{error}"));
        let named = |name: &str, world: &mut World| {
            let mut names = world.query::<(Entity, &Name)>();
            names.iter(world).find(|(_, it)| it.as_str() == name).unwrap_or_else(|| panic!("{file}: {name}")).0
        };
        let world = app.world_mut();
        let (pool, volume) = (named("pool", world), named("volume of a file", world));
        assert_eq!(world.get::<Pool>(pool), Some(&Pool { cell_m: 2e-4, ..Pool::new(volume) }));
        assert_eq!(world.get::<ChildOf>(pool).map(ChildOf::parent), Some(volume));
        let body = named("body", world);
        assert_eq!(world.get::<ElasticBody>(body).map(|body| body.cell(7).tissue), Some(ElasticTissue::FAT));
        let organ = named("organ of a file", world);
        let path = world.get::<Organ>(organ).and_then(|organ| organ.0.path().map(ToString::to_string));
        assert_eq!(path.as_deref(), Some("nowhere/liver.obj"));
        #[cfg(feature = "render")]
        {
            let (monitor, scope) = (named("monitor", world), named("scope", world));
            assert_eq!(world.get::<MonitorView>(monitor), Some(&MonitorView { of: scope }));
        }
        // It runs, too.
        app.step(2);
    }
}

/// The file of this version holds everything that this version saves.
#[test]
fn this_version_has_its_file() {
    let file = file_of(SceneVersion::NOW);
    let text = std::fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    for path in SceneComponents::authored_of_crate() {
        assert!(text.contains(&format!("\"{path}\": ")), "{path} is missing in {}", file.display());
    }
}

/// Asset servers load scenes with the crate's loader and with Bevy's.
#[test]
fn asset_servers_load_scenes() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut source = TestApp::cpu();
    source.world_mut().spawn((Skin::spleen(), Name::new("spleen")));
    let text = scene_text(source.world()).expect("a scene");
    let newer = format!("minor: {}", SceneVersion::NOW.minor + 1);
    let future = text.replacen(&format!("minor: {}", SceneVersion::NOW.minor), &newer, 1);
    for (name, text) in [("a.surgery.scn.ron", &text), ("b.scn.ron", &text), ("c.surgery.scn.ron", &future)] {
        std::fs::write(folder.path().join(name), text).expect("it can be written");
    }
    let mut app = App::new();
    let assets = AssetPlugin {
        file_path: folder.path().to_string_lossy().into_owned(),
        unapproved_path_mode: UnapprovedPathMode::Deny,
        ..default()
    };
    app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin, assets, SurgeryPlugins));
    app.finish();
    app.cleanup();
    let assets = app.world().resource::<AssetServer>().clone();
    let scenes = ["a.surgery.scn.ron", "b.scn.ron", "c.surgery.scn.ron"].map(|name| assets.load::<DynamicWorld>(name));
    for scene in &scenes {
        app.world_mut().spawn(DynamicWorldRoot(scene.clone()));
    }
    let started = Instant::now();
    let mut skins = app.world_mut().query::<&Skin>();
    loop {
        app.update();
        let is_refused = matches!(assets.get_load_state(&scenes[2]), Some(bevy::asset::LoadState::Failed(_)));
        if skins.iter(app.world()).count() == 2 && is_refused {
            break;
        }
        assert!(started.elapsed() < Duration::from_secs(60), "waited a minute for the scenes");
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(skins.iter(app.world()).all(|skin| *skin == Skin::spleen()));
    let Some(bevy::asset::LoadState::Failed(error)) = assets.get_load_state(&scenes[2]) else {
        panic!("it was refused")
    };
    assert!(error.to_string().contains("c.surgery.scn.ron: the scene is of version"), "{error}");
}
