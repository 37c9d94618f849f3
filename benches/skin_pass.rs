//! The skin pass at 800x600 beside an empty Bevy scene and Bevy's own material on the same surface.
//!
//! The three scenes take turns frame by frame, so that a machine that slows down slows all of them; Criterion then sees
//! the time of one of them per bench.

mod turns;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use criterion::{Criterion, criterion_group, criterion_main};

/// What the camera sees.
#[derive(Clone, Copy, PartialEq)]
enum Scene {
    Empty,
    Skin,
    StandardMaterial,
}

fn app(scene: Scene) -> TestApp {
    let mut app = TestApp::gpu_with(800, 600, |app| {
        app.add_plugins(PbrPlugin::default());
    });
    let view = Transform::from_xyz(0.0, 0.1, 0.22).looking_at(Vec3::ZERO, Vec3::Y);
    app.spawn_camera(view);
    let model = OrganModel::procedural_liver(&OrganOptions::default()).expect("the crate's own liver");
    match scene {
        Scene::Empty => {}
        Scene::Skin => {
            app.world_mut().spawn((ScopeLight::default(), view));
            let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model);
            app.world_mut().spawn((Organ(organ), Skin::liver()));
        }
        Scene::StandardMaterial => {
            app.world_mut().spawn((PointLight::default(), view));
            let positions: Vec<[f32; 3]> = model.mesh.positions_m.iter().map(Vec3::to_array).collect();
            let normals: Vec<[f32; 3]> = model.mesh.vertex_normals().iter().map(Vec3::to_array).collect();
            let indices = model.mesh.triangles.iter().flatten().copied().collect();
            let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
                .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
                .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
                .with_inserted_indices(Indices::U32(indices));
            let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
            let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
            app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material)));
        }
    }
    app.warm_up();
    for _ in 0..10 {
        app.idle();
    }
    app
}

fn frames(c: &mut Criterion) {
    let scenes = [(Scene::Empty, "empty scene"), (Scene::Skin, "skin"), (Scene::StandardMaterial, "StandardMaterial")];
    let mut apps: Vec<TestApp> = scenes.iter().map(|(scene, _)| app(*scene)).collect();
    let names = scenes.map(|(_, name)| name);
    // First the comparison itself: medians of frames drawn in turn.
    let medians = turns::medians_ms(60, &mut apps, TestApp::idle);
    for (name, median) in names.iter().zip(&medians) {
        println!("{name}: {median:.2} ms a frame, {:+.2} ms over the empty scene", median - medians[0]);
    }
    let mut group = c.benchmark_group("frame 800x600");
    group.sample_size(20);
    turns::bench_each(&mut group, &names, &mut apps, TestApp::idle);
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
