//! The flow in a pool against flows that are known.

use bevy_surgery::pool::{
    Advection, Dissolved, FluidSolver, MAX_CELLS_PER_STEP, PoolError, PoolGrid, SolverSettings, WetMask,
};
use glam::{UVec2, Vec2};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f32::consts::PI;

fn grid(width: u32, height: u32, cell_m: f32) -> PoolGrid {
    PoolGrid::new(UVec2::new(width, height), cell_m).expect("a good grid")
}

fn cells(size: UVec2) -> impl Iterator<Item = UVec2> {
    (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec2::new(x, y)))
}

/// Mean of the squares of the velocities through all sides.
fn energy(solver: &FluidSolver) -> f64 {
    let size = solver.grid().size();
    cells(size).map(|cell| f64::from(solver.side_velocity_m_s(cell).length_squared())).sum::<f64>()
        / solver.grid().count() as f64
}

fn divergence(solver: &FluidSolver, cell: UVec2) -> f32 {
    let own = solver.side_velocity_m_s(cell);
    let (right, above) = (solver.side_velocity_m_s(cell + UVec2::X), solver.side_velocity_m_s(cell + UVec2::Y));
    right.x - own.x + above.y - own.y
}

/// The steady eddy `u = sin(pi x) cos(pi y)`, `v = -cos(pi x) sin(pi y)` in a box with sides of 1 m.
fn eddy(side: u32) -> FluidSolver {
    let mut solver = FluidSolver::new(grid(side, side, 1.0 / side as f32));
    solver.push(|at| {
        let (x, y) = (at.x + 0.5, at.y + 0.5);
        Vec2::new((PI * x).sin() * (PI * y).cos(), -(PI * x).cos() * (PI * y).sin())
    });
    solver
}

/// Share of an eddy's energy that is left after the time in which its middle turns over once.
fn energy_left(advection: Advection) -> f64 {
    let side = 128;
    let mut solver = eddy(side);
    let settings = SolverSettings { advection, pressure_iterations: 60, ..SolverSettings::default() };
    let before = energy(&solver);
    // The middle turns with pi radians per second; the fastest goes a cell and a half in a step.
    let (turn_s, steps) = (2.0, 171);
    for _ in 0..steps {
        solver.step(turn_s / steps as f32, &settings);
    }
    energy(&solver) / before
}

#[test]
fn eddies_last() {
    let plain = energy_left(Advection::SemiLagrangian);
    let corrected = energy_left(Advection::MacCormack);
    println!("energy left after one turn: {plain:.4} semi-Lagrangian, {corrected:.4} MacCormack");
    assert!(corrected > 0.97 && corrected < 1.001, "{corrected}");
    assert!(plain > 0.5 && plain < corrected, "{plain}");
}

#[test]
fn nothing_flows_through_walls() {
    let grid = grid(70, 66, 1e-3);
    // A bowl with an island, and another bowl beside a wall of one cell.
    let mask = WetMask::from_fn(&grid, |cell| {
        let at = cell.as_vec2();
        at.distance(Vec2::new(24.0, 32.0)) < 20.0 && at.distance(Vec2::new(24.0, 32.0)) > 4.0 && cell.x != 40
            || (cell.x > 44 && cell.x < 64 && cell.y > 10 && cell.y < 50 && cell.x != 50)
    });
    let mut solver = FluidSolver::new(grid);
    assert_eq!(solver.set_mask(&mask), Ok([0.0; 2]));
    for cell in cells(grid.size()).filter(|cell| cell.x > 50) {
        solver.add(Dissolved::Blood, cell, 0.5);
    }
    for step in 0..200 {
        let gust = Vec2::new((step as f32 * 0.7).sin(), (step as f32 * 1.3).cos()) * 0.4;
        solver.push(|at| gust * (-at.length_squared() / 2e-4).exp());
        solver.step(1.0 / 60.0, &SolverSettings::default());
    }
    let mut fastest = 0.0_f32;
    for cell in cells(grid.size()) {
        let velocity = solver.side_velocity_m_s(cell);
        fastest = fastest.max(velocity.length());
        let is_wet = |x: i32, y: i32| {
            let other = cell.as_ivec2() + glam::IVec2::new(x, y);
            other.min_element() >= 0 && mask.is_wet(other.as_uvec2())
        };
        if !(is_wet(0, 0) && is_wet(-1, 0)) {
            assert_eq!(velocity.x, 0.0, "through the left side of {cell}");
        }
        if !(is_wet(0, 0) && is_wet(0, -1)) {
            assert_eq!(velocity.y, 0.0, "through the lower side of {cell}");
        }
        if !mask.is_wet(cell) {
            assert_eq!(solver.share(Dissolved::Blood, cell), 0.0, "in the wall at {cell}");
        }
        // The wall at column 50 holds, and blood began on its other side.
        if cell.x < 50 {
            assert_eq!(solver.share(Dissolved::Blood, cell), 0.0, "beyond the wall at {cell}");
        }
    }
    assert!(fastest > 0.01, "{fastest} m/s: it moves");
}

#[test]
fn pressure_takes_the_divergence_away() {
    let grid = grid(48, 40, 1e-3);
    let mut solver = FluidSolver::new(grid);
    solver.push(|at| Vec2::new((at.x * 300.0).sin(), (at.y * 220.0 + at.x * 90.0).cos()) * 1e-3);
    let settings = |pressure_iterations| SolverSettings { pressure_iterations, ..SolverSettings::default() };
    let largest =
        |solver: &FluidSolver| cells(grid.size()).map(|cell| divergence(solver, cell).abs()).fold(0.0_f32, f32::max);
    let mut exact = solver.clone();
    solver.step(1e-4, &settings(10));
    for _ in 0..6 {
        exact.step(1e-4, &settings(500));
    }
    assert!(largest(&exact) < 1e-6, "{}", largest(&exact));
    assert!(largest(&solver) > 10.0 * largest(&exact));
}

#[test]
fn blood_stays() {
    let grid = grid(160, 96, 2e-4);
    let mask = WetMask::from_fn(&grid, |cell| (cell.as_vec2() - Vec2::new(80.0, 48.0)).length() < 45.0 && cell.y != 60);
    for advection in [Advection::SemiLagrangian, Advection::MacCormack] {
        let mut solver = FluidSolver::new(grid);
        solver.set_mask(&mask).expect("of the same size");
        for cell in cells(grid.size()).filter(|cell| cell.as_vec2().distance(Vec2::new(70.0, 40.0)) < 9.0) {
            solver.add(Dissolved::Blood, cell, 0.8);
            solver.add(Dissolved::Dust, cell + UVec2::X * 5, 0.3);
        }
        let before = [Dissolved::Blood, Dissolved::Dust].map(|what| solver.total(what));
        assert!(before.iter().all(|total| *total > 50.0), "{before:?}");
        let settings =
            SolverSettings { advection, diffusion_m2_s: 1e-9, viscosity_m2_s: 1e-6, ..SolverSettings::default() };
        for step in 0..1000 {
            if step % 7 == 0 {
                let turn = step as f32 * 0.1;
                solver.push(|at| {
                    Vec2::from_angle(turn) * 0.02 * (-(at - Vec2::new(0.004, 0.0)).length_squared() / 4e-6).exp()
                });
            }
            solver.step(1.0 / 60.0, &settings);
        }
        for (what, before) in [Dissolved::Blood, Dissolved::Dust].into_iter().zip(before) {
            let after = solver.total(what);
            assert!((after / before - 1.0).abs() < 1e-4, "{advection:?}: {after} of {before} {what:?}");
        }
        let spread = cells(grid.size()).filter(|cell| solver.share(Dissolved::Blood, *cell) > 0.01).count();
        assert!(spread > 1000, "{advection:?}: it spreads over {spread} cells");
    }
}

#[test]
fn diffusion_widens_a_cloud_as_heat_spreads() {
    let grid = grid(128, 128, 1e-3);
    let mut solver = FluidSolver::new(grid);
    let squares_before = 2.0 * 4.0_f64.powi(2);
    for cell in cells(grid.size()) {
        let squared = (cell.as_vec2() - 63.5).length_squared();
        solver.add(Dissolved::Blood, cell, (-squared / (2.0 * 16.0)).exp());
    }
    let squares = |solver: &FluidSolver| {
        let of = |cell: UVec2| {
            f64::from(solver.share(Dissolved::Blood, cell)) * f64::from((cell.as_vec2() - 63.5).length_squared())
        };
        cells(grid.size()).map(of).sum::<f64>() / solver.total(Dissolved::Blood)
    };
    assert!((squares(&solver) / squares_before - 1.0).abs() < 1e-3);
    // 4 D t is 64 cells squared.
    let settings = SolverSettings { diffusion_m2_s: 1.6e-5, diffusion_iterations: 30, ..SolverSettings::default() };
    for _ in 0..60 {
        solver.step(1.0 / 60.0, &settings);
    }
    let widened = squares(&solver) - squares_before;
    assert!((widened / 64.0 - 1.0).abs() < 0.02, "{widened} cells squared");
}

#[test]
fn only_wet_tiles_are_worked_on_and_the_rest_stays_0() {
    let grid = grid(256, 256, 1e-3);
    let inside = |cell: UVec2| cell.as_vec2().distance(Vec2::new(40.0, 200.0)) < 30.0;
    let mut solver = FluidSolver::new(grid);
    solver.push(|at| Vec2::new(at.y, -at.x));
    for cell in cells(grid.size()) {
        solver.add(Dissolved::Blood, cell, 0.25);
    }
    let lost = solver.set_mask(&WetMask::from_fn(&grid, inside)).expect("of the same size");
    let wet = cells(grid.size()).filter(|cell| inside(*cell)).count() as f64;
    assert!((lost[0] - 0.25 * (65536.0 - wet)).abs() < 1e-3 && lost[1] == 0.0, "{lost:?}");
    for _ in 0..5 {
        solver.step(1.0 / 60.0, &SolverSettings { advection: Advection::MacCormack, ..SolverSettings::default() });
    }
    for cell in cells(grid.size()).filter(|cell| !inside(*cell)) {
        assert_eq!((solver.velocity_m_s(cell), solver.share(Dissolved::Blood, cell)), (Vec2::ZERO, 0.0), "{cell}");
    }
    assert!((solver.total(Dissolved::Blood) - 0.25 * wet).abs() < 1e-2);
}

#[test]
fn many_random_pushes_change_no_bounds() {
    let grid = grid(24, 20, 1e-3);
    let mask = WetMask::from_fn(&grid, |cell| cell.as_vec2().distance(Vec2::new(11.0, 9.0)) < 9.5 && cell.y != 5);
    let mut solver = FluidSolver::new(grid);
    solver.set_mask(&mask).expect("of the same size");
    let mut rng = Pcg32::seed_from_u64(5);
    let most_m_s = MAX_CELLS_PER_STEP * grid.cell_m() * 60.0;
    let mut energies = Vec::new();
    for step in 0..100_000 {
        let (at, by) =
            (Vec2::new(rng.random_range(-0.01..0.01), rng.random_range(-0.01..0.01)), rng.random_range(-0.4..0.4));
        if step % 3 == 0 {
            let direction = Vec2::from_angle(rng.random_range(0.0..6.0));
            solver.push(|place| direction * by * (-(place - at).length_squared() / 4e-6).exp());
        }
        let advection = if step % 2 == 0 { Advection::MacCormack } else { Advection::SemiLagrangian };
        solver.step(1.0 / 60.0, &SolverSettings { advection, pressure_iterations: 5, ..SolverSettings::default() });
        if step % 5_000 == 4_999 {
            energies.push(energy(&solver));
            for cell in cells(grid.size()) {
                let velocity = solver.velocity_m_s(cell);
                assert!(velocity.is_finite() && velocity.length() < 10.0 * most_m_s, "{velocity} in step {step}");
                assert!(solver.height_m(cell, 1.0 / 60.0, 9.81).is_finite());
            }
        }
    }
    let (early, late) = (energies[..10].iter().sum::<f64>(), energies[10..].iter().sum::<f64>());
    assert!(late < 3.0 * early, "{energies:?}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| {
            let mut solver = eddy(100);
            for cell in cells(UVec2::splat(100)) {
                solver.add(Dissolved::Blood, cell, (cell.x * 7 % 13) as f32 / 13.0);
            }
            let settings = SolverSettings {
                advection: Advection::MacCormack,
                viscosity_m2_s: 1e-5,
                diffusion_m2_s: 1e-5,
                ..SolverSettings::default()
            };
            for _ in 0..20 {
                solver.step(1.0 / 60.0, &settings);
            }
            let of = |cell| (solver.velocity_m_s(cell), solver.share(Dissolved::Blood, cell));
            cells(UVec2::splat(100)).map(of).collect::<Vec<_>>()
        })
    };
    assert!(run(1) == run(3));
}

#[test]
fn grains_go_and_cavities_stay() {
    let grid = grid(30, 20, 1e-3);
    let cavity = |cell: UVec2| (5..25).contains(&cell.x) && (4..16).contains(&cell.y);
    let hole = UVec2::new(12, 9);
    let grains = [UVec2::new(1, 1), UVec2::new(28, 10), UVec2::new(29, 10)];
    let mask = WetMask::from_fn(&grid, |cell| (cavity(cell) && cell != hole) || grains.contains(&cell));
    let clean = mask.without_grains();
    // Corners of the cavity have three of five and go; all that is left grows by a cell.
    let is_corner = |cell: UVec2| [5, 24].contains(&cell.x) && [4, 15].contains(&cell.y);
    let stays = |x: i32, y: i32| {
        let cell = glam::IVec2::new(x, y).as_uvec2();
        cavity(cell) && !is_corner(cell)
    };
    for cell in cells(grid.size()) {
        let (x, y) = (cell.x as i32, cell.y as i32);
        let expected = stays(x, y) || stays(x - 1, y) || stays(x + 1, y) || stays(x, y - 1) || stays(x, y + 1);
        assert_eq!(clean.is_wet(cell), expected, "{cell}");
    }
    assert!(clean.is_wet(hole), "noise in the fluid goes as well");
    assert_eq!(WetMask::from_fn(&grid, |_| false).without_grains().count(), 0);
    let all = WetMask::from_fn(&grid, |_| true);
    assert_eq!(all.without_grains().count(), all.count(), "the edges of the grid are no wall");
}

#[test]
fn pools_that_cannot_be_are_refused() {
    for size in [UVec2::ZERO, UVec2::new(3, 100), UVec2::new(100, 3000), UVec2::MAX] {
        let error = PoolGrid::new(size, 1e-3).expect_err("no pool");
        assert!(error.to_string().starts_with(&format!("size: a pool of {} x {}", size.x, size.y)), "{error}");
    }
    for cell_m in [0.0, -1.0, f32::NAN, f32::INFINITY, 2.0] {
        assert!(matches!(PoolGrid::new(UVec2::splat(8), cell_m), Err(PoolError::Cell { .. })), "{cell_m}");
    }
    let mut solver = FluidSolver::new(grid(8, 8, 1e-3));
    let other = WetMask::from_fn(&grid(8, 9, 1e-3), |_| true);
    assert!(matches!(solver.set_mask(&other), Err(PoolError::MaskSize { .. })));
    // Beyond the grid there is nothing, and nonsense adds nothing.
    let beyond = UVec2::new(8, 8);
    solver.add(Dissolved::Blood, beyond, 1.0);
    solver.add(Dissolved::Blood, UVec2::splat(3), f32::NAN);
    solver.push(|_| Vec2::NAN);
    let odd = SolverSettings {
        pressure_iterations: 0,
        viscosity_m2_s: f32::NAN,
        diffusion_m2_s: -1.0,
        ..SolverSettings::default()
    };
    for step_s in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e6, 1e-9] {
        solver.step(step_s, &odd);
    }
    assert_eq!((solver.total(Dissolved::Blood), solver.velocity_m_s(beyond), energy(&solver)), (0.0, Vec2::ZERO, 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_pool_keeps_its_blood_and_its_walls(width in 4_u32..80, height in 4_u32..80, seed: u64, speed in 0.0_f32..3.0) {
        let grid = grid(width, height, 1e-3);
        let mut rng = Pcg32::seed_from_u64(seed);
        let dry: Vec<bool> = (0..grid.count()).map(|_| rng.random_range(0..10) == 0).collect();
        let mask = WetMask::from_fn(&grid, |cell| !dry[(cell.y * width + cell.x) as usize]);
        let mut solver = FluidSolver::new(grid);
        solver.set_mask(&mask).expect("of the same size");
        for cell in cells(grid.size()) {
            solver.add(Dissolved::Blood, cell, rng.random_range(0.0..0.5));
        }
        let before = solver.total(Dissolved::Blood);
        for step in 0..6 {
            solver.push(|at| Vec2::new((at.y * 900.0 + step as f32).sin(), (at.x * 700.0).cos()) * speed);
            solver.step(1.0 / 60.0, &SolverSettings::default());
        }
        prop_assert!((solver.total(Dissolved::Blood) - before).abs() <= 1e-4 * before.max(1.0));
        for cell in cells(grid.size()) {
            prop_assert!(solver.velocity_m_s(cell).is_finite());
            prop_assert!(mask.is_wet(cell) || solver.share(Dissolved::Blood, cell) == 0.0);
        }
    }
}
