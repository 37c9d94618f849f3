//! Scenes of programs that draw: Bevy's renderer adds components to cameras and lights.

use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::{load_scene, mastoid_scene, scene_text, soft_volume_scene};
use bevy_surgery::testing::TestApp;

fn spawned(spawn: impl FnOnce(&mut World)) -> TestApp {
    let mut app = TestApp::gpu(64, 48);
    spawn(app.world_mut());
    app.idle();
    app.idle();
    app
}

fn comes_back(mut app: TestApp, names: &[&str]) {
    let text = scene_text(app.world()).expect("it can be written down");
    for name in names {
        assert!(text.contains(name), "{name} is not in it");
    }
    let mut another = TestApp::gpu(64, 48);
    load_scene(another.world_mut(), "a scene", &text).expect("it can be read");
    another.idle();
    another.idle();
    let again = scene_text(another.world()).expect("it can be written down again");
    assert_eq!(again.lines().count(), text.lines().count());
    let cameras = |app: &mut TestApp| app.world_mut().query::<&Camera3d>().iter(app.world()).count();
    assert_eq!(cameras(&mut another), cameras(&mut app));
}

#[test]
fn a_drawn_liver_scene_is_saved_and_loaded() {
    let app = spawned(|world| {
        world.spawn_scene(liver_scene()).expect("it is ready");
    });
    comes_back(app, &["Endoscope", "ScopeLight", "AbdominalWall", "Camera3d"]);
}

#[test]
fn a_drawn_mastoid_scene_is_saved_and_loaded() {
    let app = spawned(|world| {
        world.spawn_scene(mastoid_scene()).expect("it is ready");
    });
    comes_back(app, &["Microscope", "MicroscopeLamp", "ToolShadows", "Pool"]);
}

#[test]
fn a_drawn_soft_volume_is_saved_and_loaded() {
    let app = spawned(|world| {
        world.spawn_scene(soft_volume_scene()).expect("it is ready");
    });
    comes_back(app, &["SoftVolume", "DirectionalLight", "Projection"]);
}

#[test]
fn lights_and_layers_are_saved() {
    let app = spawned(|world| {
        let layers = bevy::camera::visibility::RenderLayers::layer(2);
        world.spawn((Name::new("one"), PointLight::default(), layers));
        world.spawn((Name::new("two"), SpotLight::default()));
        world.spawn((Name::new("three"), DirectionalLight::default(), Transform::default()));
        world.spawn((Name::new("pair"), Microscope::default(), StereoPair::default(), Msaa::Off));
    });
    comes_back(app, &["PointLight", "SpotLight", "DirectionalLight", "RenderLayers", "StereoPair"]);
}
