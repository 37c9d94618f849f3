//! A step of a pool of 800 x 600 cells on the GPU, ten rounds of Jacobi's iteration, velocity, blood and dust: frames with one step
//! and frames without take turns.

mod turns;

use bevy::prelude::*;
use bevy_surgery::pool::render::flow::{GpuFlow, PoolReadings};
use bevy_surgery::pool::{Advection, FluidAction, FluidSolver, FluidSource, PoolGrid, SolverSettings};
use bevy_surgery::testing::TestApp;
use criterion::{Criterion, criterion_group, criterion_main};

const SCENES: [(Option<Advection>, &str); 3] = [
    (None, "no step"),
    (Some(Advection::SemiLagrangian), "semi-Lagrangian"),
    (Some(Advection::MacCormack), "MacCormack"),
];
const STEP_S: f32 = 1.0 / 60.0;

struct Bench {
    app: TestApp,
    pool: Entity,
    fluid: FluidSolver,
    advection: Option<Advection>,
}

/// A pool that was stirred: eddies of some cells per step.
fn bench(advection: Option<Advection>) -> Bench {
    let mut app = TestApp::gpu(64, 64);
    app.spawn_camera(Transform::from_xyz(0.0, 0.0, 1.0));
    let fluid = FluidSolver::new(PoolGrid::new(UVec2::new(800, 600), 1e-4).expect("a good grid"));
    let pool = app.world_mut().spawn((GpuFlow::default(), fluid.clone())).id();
    let mut made = Bench { app, pool, fluid, advection };
    (0..8).for_each(|_| made.app.idle());
    for k in 0..6 {
        let place_m = Vec2::new(0.01 * k as f32 - 0.025, 0.0);
        let burr = FluidSource { place_m, radius_m: 4e-3, stir_m_s: 0.05, amount: [50.0, 20.0], ..default() };
        push(&mut made, &FluidAction { sources: vec![burr], ..default() }, Advection::SemiLagrangian);
        made.app.idle();
    }
    // The pipelines may be ready only now.
    while made.app.world().get::<PoolReadings>(pool).expect("a pool on the GPU").step < 6 {
        made.app.idle();
    }
    made
}

fn push(bench: &mut Bench, action: &FluidAction, advection: Advection) {
    let settings = SolverSettings { advection, ..default() };
    let mut flow = bench.app.world_mut().get_mut::<GpuFlow>(bench.pool).expect("a device with compute shaders");
    flow.push(&bench.fluid, STEP_S, &settings, action);
}

fn frame(bench: &mut Bench) {
    if let Some(advection) = bench.advection {
        push(bench, &default(), advection);
    }
    bench.app.idle();
}

fn frames(c: &mut Criterion) {
    let mut benches = SCENES.map(|(advection, _)| bench(advection));
    let medians = turns::medians_ms(60, &mut benches, frame);
    for ((_, name), median) in SCENES.iter().zip(&medians) {
        println!("{name}: {median:.2} ms a frame, {:+.2} ms over no step", median - medians[0]);
    }
    let mut group = c.benchmark_group("pool on the GPU 800x600");
    group.sample_size(10);
    turns::bench_each(&mut group, &SCENES.map(|(_, name)| name), &mut benches, frame);
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
