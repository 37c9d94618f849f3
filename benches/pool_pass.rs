//! A pool over a third of a picture of 800x600: none, calm, stirred with blood and foam, and stirred anew for each frame.
//!
//! The scenes take turns frame by frame, so that a machine that slows down slows all of them.

mod turns;

use bevy::camera::Hdr;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy_surgery::pool::{
    FluidAction, FluidSolver, FluidSource, FoamPatch, PoolGrid, PoolSurface, SolverSettings, WetMask,
};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use criterion::{Criterion, criterion_group, criterion_main};

#[derive(Clone, Copy, PartialEq)]
enum Scene {
    Without,
    Calm,
    Stirred,
    Changing,
}

const SCENES: [(Scene, &str); 4] = [
    (Scene::Without, "no pool"),
    (Scene::Calm, "calm water"),
    (Scene::Stirred, "waves, blood and foam"),
    (Scene::Changing, "the same, other texels in each frame"),
];
const STEP_S: f32 = 1.0 / 60.0;

/// A round pool of 15 mm, stirred for a second.
fn fluid() -> FluidSolver {
    let grid = PoolGrid::new(UVec2::splat(512), 4e-5).expect("a good grid");
    let mut fluid = FluidSolver::new(grid);
    fluid.set_mask(&WetMask::from_fn(&grid, |cell| grid.pool_from_cell(cell).length() < 7.5e-3)).expect("of its size");
    for step in 0..60 {
        let turn = Vec2::from_angle(0.1 * step as f32);
        let burr = FluidSource {
            place_m: 3e-3 * turn,
            radius_m: 1e-3,
            stir_m_s: 0.15,
            push_m_s: 0.05 * turn.perp(),
            amount: [20.0, 5.0],
            ..default()
        };
        let action = FluidAction { sources: vec![burr], ..default() };
        fluid.step_with(STEP_S, &SolverSettings::default(), &action);
    }
    fluid
}

struct Bench {
    app: TestApp,
    scene: Scene,
    pool: Option<Entity>,
    fluid: FluidSolver,
}

fn bench(scene: Scene) -> Bench {
    let mut app = TestApp::gpu_with(800, 600, |app| {
        app.add_plugins(PbrPlugin::default());
    });
    let view = Transform::from_xyz(0.0, -0.02, 0.249).looking_at(Vec3::ZERO, Vec3::Y);
    let camera = app.spawn_camera(view);
    let lens = PerspectiveProjection { fov: 0.08, near: 0.01, ..default() };
    app.world_mut().entity_mut(camera).insert((Projection::Perspective(lens), Hdr));
    app.world_mut().spawn((
        ScopeLight { intensity_cd: 222.0, ring_radius_m: 0.008, ..default() },
        Transform::from_xyz(0.02, 0.02, 0.25).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let floor = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.1, 0.1, 0.01));
    let colour = StandardMaterial { base_color: Color::srgb_u8(210, 180, 140), unlit: true, ..default() };
    let colour = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(colour);
    app.world_mut().spawn((Mesh3d(floor), MeshMaterial3d(colour), Transform::from_xyz(0.0, 0.0, -0.008)));
    let fluid = fluid();
    let mut surface = PoolSurface::new(*fluid.grid(), 0.0);
    surface.update(&fluid, 0.0, STEP_S, 9.81);
    match scene {
        Scene::Calm => {
            let mask = WetMask::from_fn(fluid.grid(), |cell| fluid.is_wet(cell));
            surface = PoolSurface::calm(*fluid.grid(), 0.0, &mask);
        }
        _ => surface.foam = vec![FoamPatch { place_m: Vec2::X * 3e-3, radius_m: 2e-3, amount: 0.7 }],
    }
    let pool = (scene != Scene::Without).then(|| app.world_mut().spawn(surface).id());
    app.warm_up();
    for _ in 0..6 {
        app.idle();
    }
    Bench { app, scene, pool, fluid }
}

fn frame(bench: &mut Bench) {
    if bench.scene == Scene::Changing
        && let Some(mut surface) = bench.pool.and_then(|pool| bench.app.world_mut().get_mut::<PoolSurface>(pool))
    {
        surface.update(&bench.fluid, 0.0, STEP_S, 9.81);
    }
    bench.app.idle();
}

fn frames(c: &mut Criterion) {
    let mut benches = SCENES.map(|(scene, _)| bench(scene));
    let pictures = [0, 1].map(|place: usize| benches[place].app.capture());
    let covered = pictures[0].pixels().zip(pictures[1].pixels()).filter(|(dry, wet)| dry != wet).count();
    println!("the pool covers {:.3} of the picture", covered as f32 / 480_000.0);
    let medians = turns::medians_ms(60, &mut benches, frame);
    for ((_, name), median) in SCENES.iter().zip(&medians) {
        println!("{name}: {median:.2} ms a frame, {:+.2} ms over no pool", median - medians[0]);
    }
    let mut group = c.benchmark_group("pool 800x600");
    group.sample_size(10);
    turns::bench_each(&mut group, &SCENES.map(|(_, name)| name), &mut benches, frame);
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
