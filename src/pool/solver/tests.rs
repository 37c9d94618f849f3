//! The solver against plain code that does one thing after another, number by number; and against itself.

use super::field::At;
use super::vectors::{Lanes, Work};
use super::*;
use glam::IVec2;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// A number per cell, and 0 beyond.
#[derive(Clone)]
struct Numbers {
    size: IVec2,
    values: Vec<f32>,
}

impl Numbers {
    fn new(size: IVec2, mut of: impl FnMut(IVec2) -> f32) -> Self {
        let cells = (0..size.y).flat_map(|y| (0..size.x).map(move |x| IVec2::new(x, y)));
        Self { size, values: cells.map(&mut of).collect() }
    }

    fn at(&self, cell: IVec2) -> f32 {
        let is_there = cell.min_element() >= 0 && cell.cmplt(self.size).all();
        if is_there { self.values[(cell.y * self.size.x + cell.x) as usize] } else { 0.0 }
    }
}

/// What the solver does to velocity and pressure, and with factors of 1 to what is dissolved.
struct Plain {
    size: IVec2,
    wet: Numbers,
    velocity: [Numbers; 2],
    pressure: Numbers,
    dissolved: [Numbers; 2],
}

const STEPS: [IVec2; 2] = [IVec2::X, IVec2::Y];

impl Plain {
    fn new(solver: &FluidSolver) -> Self {
        let size = solver.grid.size().as_ivec2();
        let of = |field: &Field| Numbers::new(size, |cell| field.at(cell.as_uvec2()));
        let dissolved = [0, 1]
            .map(|what| Numbers::new(size, |cell| solver.dissolved[what].at(cell.as_uvec2()) * solver.factors[what]));
        let velocity = [0, 1].map(|axis| of(&solver.velocity[axis]));
        Self { size, wet: of(&solver.places.wet), velocity, pressure: of(&solver.pressure), dissolved }
    }

    fn is_wet(&self, cell: IVec2) -> bool {
        self.wet.at(cell) > 0.0
    }

    /// Whether a number of a field moves, and whether it means something.
    fn open_and_known(&self, at: At, cell: IVec2) -> [bool; 2] {
        let other = match at {
            At::Left => cell - IVec2::X,
            At::Below => cell - IVec2::Y,
            At::Middle => cell,
        };
        [self.is_wet(cell) && self.is_wet(other), self.is_wet(cell) || self.is_wet(other)]
    }

    fn way(&self, at: At, cell: IVec2, cells_per_velocity: f32) -> Vec2 {
        let [u, v] = &self.velocity;
        let (x, y) = (IVec2::X, IVec2::Y);
        let velocity = match at {
            At::Left => {
                Vec2::new(u.at(cell), 0.25 * ((v.at(cell - x) + v.at(cell)) + (v.at(cell + y - x) + v.at(cell + y))))
            }
            At::Below => {
                Vec2::new(0.25 * ((u.at(cell - y) + u.at(cell - y + x)) + (u.at(cell) + u.at(cell + x))), v.at(cell))
            }
            At::Middle => Vec2::new(0.5 * (u.at(cell) + u.at(cell + x)), 0.5 * (v.at(cell) + v.at(cell + y))),
        };
        let most = Vec2::splat(MAX_CELLS_PER_STEP);
        (velocity * cells_per_velocity).clamp(-most, most)
    }

    /// Whether a way keeps so far away from walls that they do not matter; then it is gone at once.
    fn is_free(&self, cell: IVec2, way: Vec2) -> bool {
        let reach = (way.abs().max_element() + 2.0).floor() as i32;
        (-reach..=reach).all(|y| (-reach..=reach).all(|x| self.is_wet(cell + IVec2::new(x, y))))
    }

    /// Until before the first place in a wall, in steps of a cell at most.
    fn origin(&self, at: At, cell: IVec2, way: Vec2) -> Vec2 {
        if self.is_free(cell, way) {
            return cell.as_vec2() - way;
        }
        let steps = way.abs().max_element().ceil().max(1.0);
        let places = (1..=steps as u32).map(|step| cell.as_vec2() - way * (step as f32 / steps));
        let is_in = |place: &Vec2| self.is_wet((*place + (at.offset() + 0.5)).floor().as_ivec2());
        places.take_while(is_in).last().unwrap_or(cell.as_vec2())
    }

    fn corners(place: Vec2) -> ([IVec2; 4], [f32; 4]) {
        let shifted = place + 1.0;
        let floor = shifted.floor();
        let share = shifted - floor;
        let (Vec2 { x: a, y: b }, first) = (share, floor.as_ivec2() - 1);
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
        ([first, first + IVec2::X, first + IVec2::Y, first + IVec2::ONE], weights)
    }

    fn interpolate(&self, from: &Numbers, at: At, place: Vec2, is_free: bool, other: f32) -> f32 {
        let (cells, weights) = Self::corners(place);
        let values = cells.map(|cell| from.at(cell));
        let part = |k: usize| weights[k] * values[k];
        if is_free {
            return (part(0) + part(1)) + (part(2) + part(3));
        }
        let counts = cells.map(|cell| f32::from(u8::from(self.open_and_known(at, cell)[1])));
        let weight: f32 = (0..4).map(|k| weights[k] * counts[k]).sum();
        let sum: f32 = (0..4).map(|k| weights[k] * counts[k] * values[k]).sum();
        if weight > 1e-6 { sum / weight } else { other }
    }

    fn carry(&self, from: &Numbers, at: At, cells_per_velocity: f32) -> Numbers {
        Numbers::new(self.size, |cell| {
            if !self.open_and_known(at, cell)[0] {
                return 0.0;
            }
            let way = self.way(at, cell, cells_per_velocity);
            self.interpolate(from, at, self.origin(at, cell, way), self.is_free(cell, way), from.at(cell))
        })
    }

    fn carry_and_correct(&self, from: &Numbers, at: At, cells_per_velocity: f32) -> Numbers {
        let carried = self.carry(from, at, cells_per_velocity);
        let returned = self.carry(&carried, at, -cells_per_velocity);
        Numbers::new(self.size, |cell| {
            if !self.open_and_known(at, cell)[0] {
                return 0.0;
            }
            let way = self.way(at, cell, cells_per_velocity);
            let is_free = self.is_free(cell, way);
            let cells = Self::corners(self.origin(at, cell, way)).0;
            let counting = cells.into_iter().filter(|cell| is_free || self.open_and_known(at, *cell)[1]);
            let values: Vec<f32> = counting.map(|cell| from.at(cell)).collect();
            if values.is_empty() {
                return carried.at(cell);
            }
            let (least, most) = (values.iter().copied().fold(f32::INFINITY, f32::min), values.iter().copied());
            let corrected = carried.at(cell) + 0.5 * (from.at(cell) - returned.at(cell));
            corrected.clamp(least, most.fold(f32::NEG_INFINITY, f32::max))
        })
    }

    fn less_gradient(&self) -> [Numbers; 2] {
        [(0, At::Left), (1, At::Below)].map(|(axis, at)| {
            Numbers::new(self.size, |cell| {
                let difference = self.pressure.at(cell) - self.pressure.at(cell - STEPS[axis]);
                let is_open = self.open_and_known(at, cell)[0];
                self.velocity[axis].at(cell) - if is_open { difference } else { 0.0 }
            })
        })
    }

    fn diffuse(&self, field: &Numbers, at: At, strength: f32, rounds: u32) -> Numbers {
        let mut now = field.clone();
        for _ in 0..rounds {
            now = Numbers::new(self.size, |cell| {
                if !self.open_and_known(at, cell)[0] {
                    return 0.0;
                }
                let around = [cell - IVec2::X, cell + IVec2::X, cell - IVec2::Y, cell + IVec2::Y];
                let open = around.into_iter().filter(|cell| self.open_and_known(at, *cell)[0]);
                let sum: f32 = open.clone().map(|cell| now.at(cell)).sum();
                (field.at(cell) + strength * sum) / (1.0 + strength * open.count() as f32)
            });
        }
        now
    }

    fn project(&mut self, rounds: u32) {
        let [u, v] = &self.velocity;
        let divergence =
            Numbers::new(self.size, |cell| u.at(cell + IVec2::X) - u.at(cell) + v.at(cell + IVec2::Y) - v.at(cell));
        let mut before = self.pressure.clone();
        for _ in 0..rounds {
            let next = Numbers::new(self.size, |cell| {
                let side = |step: IVec2| {
                    let is_open = self.is_wet(cell) && self.is_wet(cell + step);
                    if is_open { [1.0, self.pressure.at(cell + step)] } else { [0.0; 2] }
                };
                let [left, right, below, above] = [-IVec2::X, IVec2::X, -IVec2::Y, IVec2::Y].map(side);
                let sides: f32 = left[0] + right[0] + below[0] + above[0];
                (((left[1] + right[1]) + (below[1] + above[1])) - divergence.at(cell)) / sides.max(1.0)
            });
            before = std::mem::replace(&mut self.pressure, next);
        }
        let mean = |cell| 0.5 * (self.pressure.at(cell) + before.at(cell));
        self.pressure = Numbers::new(self.size, mean);
        self.velocity = self.less_gradient();
    }

    fn step(&mut self, step_s: f32, cell_m: f32, settings: &SolverSettings) {
        let cells = step_s / cell_m;
        let strength = |m2_s: f32| m2_s * step_s / (cell_m * cell_m);
        let is_corrected = settings.advection == Advection::MacCormack;
        let from = if is_corrected { self.less_gradient() } else { self.velocity.clone() };
        let carry = |plain: &Self, from: &Numbers, at: At| match is_corrected {
            true => plain.carry_and_correct(from, at, cells),
            false => plain.carry(from, at, cells),
        };
        self.velocity = [carry(self, &from[0], At::Left), carry(self, &from[1], At::Below)];
        let rounds = settings.diffusion_iterations;
        if settings.viscosity_m2_s > 0.0 {
            let strength = strength(settings.viscosity_m2_s);
            let [u, v] = &self.velocity;
            self.velocity = [(u, At::Left), (v, At::Below)].map(|(of, at)| self.diffuse(of, at, strength, rounds));
        }
        self.project(settings.pressure_iterations);
        for what in 0..2 {
            let sum = |of: &Numbers| of.values.iter().map(|share| f64::from(*share)).sum::<f64>();
            let before = sum(&self.dissolved[what]);
            let mut carried = carry(self, &self.dissolved[what], At::Middle);
            if settings.diffusion_m2_s > 0.0 {
                carried = self.diffuse(&carried, At::Middle, strength(settings.diffusion_m2_s), rounds);
            }
            let after = sum(&carried);
            let factor = if after > 0.0 { (before / after) as f32 } else { 1.0 };
            self.dissolved[what] = Numbers::new(self.size, |cell| carried.at(cell) * factor);
        }
    }
}

/// A mask with islands, walls of one cell and single dry cells, more or less of them.
fn mask(grid: &PoolGrid, rng: &mut Pcg32) -> WetMask {
    let size = grid.size().as_vec2();
    let dry_of_1000 = [0, 0, 3, 50, 300][rng.random_range(0..5)];
    let dry: Vec<bool> = (0..grid.count()).map(|_| rng.random_range(0..1000) < dry_of_1000).collect();
    let disk = |rng: &mut Pcg32| (size * Vec2::new(rng.random(), rng.random()), size.x * rng.random_range(0.1..0.7));
    let (island, bowl) = (disk(rng), disk(rng));
    let (has_island, has_bowl, has_wall) = (rng.random(), rng.random(), rng.random::<bool>());
    let wall = rng.random_range(0..grid.size().x);
    WetMask::from_fn(grid, |cell| {
        let is_in = |(middle, radius): (Vec2, f32)| cell.as_vec2().distance(middle) < radius;
        !(dry[(cell.y * grid.size().x + cell.x) as usize]
            || (has_island && is_in(island))
            || (has_bowl && !is_in(bowl))
            || (has_wall && cell.x == wall))
    })
}

fn stir(solver: &mut FluidSolver, rng: &mut Pcg32, speed_m_s: f32) {
    let (length, turn): (f32, f32) = (rng.random_range(4.0..20.0), rng.random_range(0.0..6.0));
    let cell_m = solver.grid.cell_m();
    solver.push(|at| {
        let at = at / cell_m / length;
        Vec2::new((at.y + turn).sin() + (at.x * 0.7).cos(), (at.x - turn).cos()) * speed_m_s
    });
    for y in 0..solver.grid.size().y {
        for x in 0..solver.grid.size().x {
            solver.add(Dissolved::Blood, UVec2::new(x, y), rng.random_range(0.0..0.5));
            solver.add(Dissolved::Dust, UVec2::new(x, y), if (x / 5 + y / 7) % 3 == 0 { 0.4 } else { 0.0 });
        }
    }
}

fn settings(rng: &mut Pcg32) -> SolverSettings {
    SolverSettings {
        advection: if rng.random() { Advection::MacCormack } else { Advection::SemiLagrangian },
        pressure_iterations: rng.random_range(1..30),
        viscosity_m2_s: if rng.random() { 3e-5 } else { 0.0 },
        diffusion_m2_s: if rng.random() { 2e-5 } else { 0.0 },
        diffusion_iterations: rng.random_range(1..20),
    }
}

/// All that a solver holds.
fn state(solver: &FluidSolver) -> Vec<u32> {
    let fields = solver.velocity.iter().chain(&solver.dissolved).chain([&solver.pressure]);
    let values = fields.flat_map(|field| field.values().iter().copied()).chain(solver.factors);
    values.map(f32::to_bits).collect()
}

/// Numbers that every step leaves as they are.
fn assert_zero_beyond_spans(solver: &FluidSolver) {
    let room = solver.next.iter().chain(&solver.other).chain(&solver.reflected).chain([&solver.next_pressure]);
    for field in room.chain(&solver.velocity).chain(&solver.dissolved).chain([&solver.pressure]) {
        for y in -1..=solver.grid.size().y as isize {
            let is_frame = y < 0 || y as u32 == solver.grid.size().y;
            let spans = if is_frame { &[] } else { solver.places.spans.of_row(y as usize) };
            for (k, value) in field.row(y).iter().enumerate() {
                let is_in = spans.iter().any(|span| (FRAME + span.start..FRAME + span.end).contains(&k));
                assert!(is_in || *value == 0.0, "{value} in row {y}, column {k}");
            }
        }
    }
}

const STEP_S: f32 = 1.0 / 60.0;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn steps_are_those_of_plain_code(width in prop_oneof![4_u32..90, 200_u32..600], height in 4_u32..40, seed: u64, cells in 0.1_f32..40.0) {
        let mut rng = Pcg32::seed_from_u64(seed);
        let grid = PoolGrid::new(UVec2::new(width, height), 1e-3).expect("a grid");
        let mut solver = FluidSolver::new(grid);
        for _ in 0..2 {
            solver.set_mask(&mask(&grid, &mut rng)).expect("of the same size");
            let settings = settings(&mut rng);
            stir(&mut solver, &mut rng, cells * grid.cell_m() / STEP_S);
            for step in 0..2 {
                let mut plain = Plain::new(&solver);
                solver.step(STEP_S, &settings);
                plain.step(STEP_S, grid.cell_m(), &settings);
                for k in 0..grid.count() as i32 {
                    let cell = IVec2::new(k % plain.size.x, k / plain.size.x);
                    let velocity = Vec2::new(plain.velocity[0].at(cell), plain.velocity[1].at(cell));
                    let at = cell.as_uvec2();
                    prop_assert_eq!(solver.side_velocity_m_s(at), velocity, "{} in step {} {:?}", at, step, settings);
                    prop_assert_eq!(solver.pressure.at(at), plain.pressure.at(cell), "{}", at);
                    for what in [Dissolved::Blood, Dissolved::Dust] {
                        let (share, expected) = (solver.share(what, at), plain.dissolved[what as usize].at(cell));
                        prop_assert!((share - expected).abs() < 1e-5, "{} for {} at {}", share, expected, at);
                    }
                }
            }
            assert_zero_beyond_spans(&solver);
        }
    }

    #[test]
    fn vectors_and_threads_leave_the_same_bits(width in 4_u32..500, height in 4_u32..150, seed: u64, cells in 0.1_f32..40.0) {
        let run = |vectors: Vectors, threads: usize| {
            let mut rng = Pcg32::seed_from_u64(seed);
            let grid = PoolGrid::new(UVec2::new(width, height), 1e-3).expect("a grid");
            let mut solver = FluidSolver::new(grid);
            solver.vectors = vectors;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| {
                for _ in 0..2 {
                    solver.set_mask(&mask(&grid, &mut rng)).expect("of the same size");
                    stir(&mut solver, &mut rng, cells * grid.cell_m() / STEP_S);
                    let settings = settings(&mut rng);
                    (0..3).for_each(|_| solver.step(STEP_S, &settings));
                }
            });
            state(&solver)
        };
        let expected = run(Vectors::Portable, 1);
        for (k, vectors) in Vectors::all().into_iter().enumerate() {
            for threads in [1 + k, 4] {
                prop_assert!(run(vectors, threads) == expected, "{:?} on {} threads", vectors, threads);
            }
        }
    }

    #[test]
    fn masks_that_change_are_as_new_ones(width in 4_u32..90, height in 4_u32..90, seed: u64) {
        let mut rng = Pcg32::seed_from_u64(seed);
        let grid = PoolGrid::new(UVec2::new(width, height), 1e-3).expect("a grid");
        let mut solver = FluidSolver::new(grid);
        let mut all = mask(&grid, &mut rng);
        for change in 0..6 {
            solver.set_mask(&all).expect("of the same size");
            let mut fresh = Places::new(grid.size());
            fresh.set(&all, 0..height as usize);
            let (places, fields) = (&solver.places, |places: &Places| {
                let fields = [&places.wet, &places.open_x, &places.open_y, &places.known_x, &places.known_y];
                fields.map(|field| field.values().to_vec())
            });
            prop_assert!(fields(places) == fields(&fresh), "change {}", change);
            prop_assert!(places.clearance == fresh.clearance, "change {}", change);
            for y in 0..height {
                prop_assert_eq!(places.spans.of_row(y as usize), fresh.spans.of_row(y as usize));
                for x in 0..width {
                    let cell = IVec2::new(x as i32, y as i32);
                    let is_wet = |cell: IVec2| cell.min_element() >= 0 && all.is_wet(cell.as_uvec2());
                    let is_clear = |away: i32| {
                        (-away..=away).all(|y| (-away..=away).all(|x| is_wet(cell + IVec2::new(x, y))))
                    };
                    let clearance = (0..27).find(|away| !is_clear(*away)).unwrap_or(27);
                    prop_assert_eq!(i32::from(places.clearance[places.wet.place(cell.as_uvec2())]), clearance);
                }
            }
            assert_zero_beyond_spans(&solver);
            stir(&mut solver, &mut rng, 0.2);
            solver.step(STEP_S, &settings(&mut rng));
            all = if change == 3 { mask(&grid, &mut rng) } else {
                let middle = Vec2::new(rng.random(), rng.random()) * grid.size().as_vec2();
                let becomes_wet = rng.random();
                WetMask::from_fn(&grid, |cell| {
                    if cell.as_vec2().distance(middle) < 5.0 { becomes_wet } else { all.is_wet(cell) }
                })
            };
        }
    }
}

#[test]
fn bands_hold_all_rows_with_fluid_once() {
    let grid = PoolGrid::new(UVec2::new(40, 300), 1e-3).expect("a grid");
    let mut rng = Pcg32::seed_from_u64(3);
    for case in 0..200 {
        let first = rng.random_range(0..300);
        let end = rng.random_range(first..=300);
        let mut places = Places::new(grid.size());
        places.set(&WetMask::from_fn(&grid, |cell| (first..end).contains(&cell.y) && cell.y % 50 != case % 50), 0..300);
        for threads in 1..9 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let bands = pool.install(|| places.spans.bands_for_threads());
            assert!(bands.windows(2).all(|pair| pair[0].end == pair[1].start), "{bands:?}");
            let is_in = |y: usize| bands.iter().any(|band| band.contains(&y));
            assert!((0..300).all(|y| is_in(y) || places.spans.of_row(y).is_empty()), "{bands:?} of {first}..{end}");
        }
    }
}

#[test]
fn velocities_that_are_no_numbers_harm_nothing_else() {
    let grid = PoolGrid::new(UVec2::new(70, 50), 1e-3).expect("a grid");
    for vectors in Vectors::all() {
        let mut solver = FluidSolver::new(grid);
        solver.vectors = vectors;
        for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            for (axis, at) in [UVec2::new(20, 20), UVec2::new(2, 3)].into_iter().enumerate() {
                *solver.velocity[axis].at_mut(at) = odd;
            }
            for advection in [Advection::SemiLagrangian, Advection::MacCormack] {
                solver.step(STEP_S, &SolverSettings { advection, ..SolverSettings::default() });
            }
        }
        assert!(solver.is_wet(UVec2::new(2, 3)));
    }
}

/// Numbers of a slice at places, and after them, whatever the places are.
struct Pairs<'a>(&'a [f32], &'a [f32]);

impl Work for Pairs<'_> {
    type Output = Vec<[f32; 2]>;

    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let mut pairs = [[0.0; 16]; 2];
        for first in (0..16).step_by(L::COUNT) {
            let [low, high] = L::pairs(self.0, L::load(&self.1[first..]));
            L::store(low, &mut pairs[0][first..]);
            L::store(high, &mut pairs[1][first..]);
        }
        pairs[0].into_iter().zip(pairs[1]).map(|(low, high)| [low, high]).collect()
    }
}

#[test]
fn nothing_is_read_beyond_a_slice() {
    let of: Vec<f32> = (0..50).map(|k| k as f32).collect();
    let odd = [f32::NAN, -1.0, 49.0, 50.0, 1e9, 3e9, 5e9, f32::INFINITY, f32::NEG_INFINITY, -1e9, f32::MAX];
    let places: Vec<f32> = [0.0, 1.0, 7.0, 47.0, 48.0].into_iter().chain(odd).collect();
    for vectors in Vectors::all() {
        let pairs = vectors.run(Pairs(&of, &places));
        for (place, pair) in places.iter().zip(pairs) {
            let low = if (0.0..48.0).contains(place) { *place } else { 48.0 };
            assert_eq!(pair, [low, low + 1.0], "{vectors:?} at {place}");
        }
    }
}
