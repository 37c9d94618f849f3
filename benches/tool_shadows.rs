//! Shadows of tools at 800x600: a liver under a lamp with a probe before it, without shadows, with shadows of a probe at
//! rest, and of one that moves.
//!
//! The scenes take turns frame by frame, so that a machine that slows down slows all of them.

mod turns;

use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use criterion::{Criterion, criterion_group, criterion_main};

#[derive(Clone, Copy, PartialEq)]
enum Scene {
    Without,
    AtRest,
    Moving,
}

fn app(scene: Scene) -> TestApp {
    let mut app = TestApp::gpu_with(800, 600, |app| {
        app.add_plugins(PbrPlugin::default());
    });
    let view = Transform::from_xyz(0.0, 0.1, 0.22).looking_at(Vec3::ZERO, Vec3::Y);
    app.spawn_camera(view);
    app.world_mut().spawn((ScopeLight::default(), view));
    let liver = OrganModel::procedural_liver(&OrganOptions::default()).expect("the crate's own liver");
    let liver = app.world_mut().resource_mut::<Assets<OrganModel>>().add(liver);
    app.world_mut().spawn((Organ(liver), Skin::liver()));
    let lamp = Transform::from_xyz(0.1, 0.25, 0.15).looking_at(Vec3::ZERO, Vec3::Y);
    app.world_mut().spawn((ToolShadows { half_angle_rad: 0.5, ..default() }, lamp));
    let probe = app.world_mut().resource_mut::<Assets<Mesh>>().add(Capsule3d::new(0.003, 0.12));
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    let place = Transform::from_xyz(0.03, 0.11, 0.02).with_rotation(Quat::from_rotation_z(-0.5));
    let probe = app.world_mut().spawn((Mesh3d(probe), MeshMaterial3d(material), place, Probe)).id();
    if scene != Scene::Without {
        app.world_mut().entity_mut(probe).insert(ToolShadow);
    }
    if scene == Scene::Moving {
        let shake = |mut probes: Query<&mut Transform, With<Probe>>, mut sign: Local<bool>| {
            *sign = !*sign;
            probes.iter_mut().for_each(|mut place| place.translation.x += if *sign { 1e-3 } else { -1e-3 });
        };
        app.add_systems(Update, shake);
    }
    app.warm_up();
    for _ in 0..10 {
        app.idle();
    }
    app
}

#[derive(Component)]
struct Probe;

fn frames(c: &mut Criterion) {
    let scenes = [(Scene::Without, "no shadows"), (Scene::AtRest, "probe at rest"), (Scene::Moving, "probe moving")];
    let mut apps: Vec<TestApp> = scenes.iter().map(|(scene, _)| app(*scene)).collect();
    let names = scenes.map(|(_, name)| name);
    let medians = turns::medians_ms(60, &mut apps, TestApp::idle);
    for (name, median) in names.iter().zip(&medians) {
        println!("{name}: {median:.2} ms a frame, {:+.2} ms over no shadows", median - medians[0]);
    }
    let mut group = c.benchmark_group("tool shadows 800x600");
    group.sample_size(10);
    turns::bench_each(&mut group, &names, &mut apps, TestApp::idle);
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
