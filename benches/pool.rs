//! A step of a pool of 800 x 600 cells with ten rounds for the pressure: all wet, carried either way, and with a disk that is a
//! tenth of it; and a mask that changes a little.
//!
//! Floor: a step has to read and write two velocities, the pressure and two dissolved quantities. The velocity is carried (2
//! fields read, 2 written), the pressure goes over it (3 read, 3 written), what is dissolved is carried by it (4 read, 2
//! written): 16 fields of 4 bytes a cell, 31 MB. The bench "the floor" copies half as many bytes.
//!
//! `script/compare-pool` runs numba beside it.

use bevy_surgery::pool::{Advection, Dissolved, FluidSolver, PoolGrid, SolverSettings, WetMask};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{UVec2, Vec2};
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

const SIZE: UVec2 = UVec2::new(800, 600);
/// Fields that a step reads and writes at least.
const FIELDS: usize = 16;

/// The same flow and the same dissolved noise as in `pool_numba.py`, in cells of 1 m and steps of 1 s.
fn pool(mask: impl Fn(UVec2) -> bool + Sync) -> FluidSolver {
    let grid = PoolGrid::new(SIZE, 1.0).expect("a grid");
    let mut solver = FluidSolver::new(grid);
    solver.set_mask(&WetMask::from_fn(&grid, mask)).expect("of the same size");
    solver.push(|at| {
        let cell = grid.cell_from_pool(at);
        3.0 * Vec2::new((cell.y / 40.0).sin(), (cell.x / 50.0).cos())
    });
    let mut state = 7u64;
    for cell in (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y))) {
        for what in [Dissolved::Blood, Dissolved::Dust] {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            solver.add(what, cell, (state >> 40) as f32 / (1u64 << 24) as f32);
        }
    }
    solver
}

/// A bowl, and a burr's hole beside it that moves on by a cell.
fn drilled(size: UVec2, step: u32) -> WetMask {
    let grid = PoolGrid::new(size, 1.0).expect("a grid");
    let middle = size.as_vec2() * 0.5;
    let hole = middle + Vec2::new(0.4 * size.y as f32 + step as f32, 0.0);
    WetMask::from_fn(&grid, |cell| {
        cell.as_vec2().distance(middle) < 0.4 * size.y as f32 || cell.as_vec2().distance(hole) < 30.0
    })
}

fn steps(c: &mut Criterion) {
    let middle = SIZE.as_vec2() * 0.5;
    // A tenth of all cells.
    let radius = (SIZE.element_product() as f32 * 0.1 / std::f32::consts::PI).sqrt();
    let mut group = c.benchmark_group("pool");
    for threads in [1, 4] {
        let rayon = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        // Timed inside the pool: an app's systems run in theirs.
        let mut bench = |name: &str, run: &mut (dyn FnMut() + Send)| {
            group.bench_function(format!("{name}, {threads} threads"), |b| {
                b.iter_custom(|times| {
                    rayon.install(|| {
                        let start = Instant::now();
                        (0..times).for_each(|_| run());
                        start.elapsed()
                    })
                });
            });
        };
        for advection in [Advection::SemiLagrangian, Advection::MacCormack] {
            let mut solver = pool(|_| true);
            let settings = SolverSettings { advection, ..SolverSettings::default() };
            bench(&format!("{advection:?}"), &mut || solver.step(1.0, black_box(&settings)));
        }
        let mut solver = pool(|cell| cell.as_vec2().distance(middle) < radius);
        bench("a tenth wet", &mut || solver.step(1.0, black_box(&SolverSettings::default())));

        let size = UVec2::new(512, 384);
        let mut solver = FluidSolver::new(PoolGrid::new(size, 1.0).expect("a grid"));
        let masks: Vec<WetMask> = (0..8).map(|step| drilled(size, step)).collect();
        let mut turn = 0;
        bench("a mask that changes, 512 x 384", &mut || {
            turn += 1;
            solver.set_mask(black_box(&masks[turn % masks.len()])).expect("of the same size");
        });

        let from = vec![1.0_f32; FIELDS / 2 * SIZE.element_product() as usize];
        let mut into = from.clone();
        let bytes = FIELDS * SIZE.element_product() as usize * size_of::<f32>();
        bench(&format!("the floor: {:.1} MB", bytes as f64 * 1e-6), &mut || {
            let parts = into.par_chunks_mut(1 << 14).zip(from.par_chunks(1 << 14));
            parts.for_each(|(into, from)| into.copy_from_slice(black_box(from)));
        });
    }
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
