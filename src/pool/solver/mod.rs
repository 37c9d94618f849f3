//! Incompressible flow in the plane (paper of 2009, algorithm 1), on the processor.
//!
//! Velocities lie on the sides of the cells, pressure and what is dissolved in their middles: a side between fluid and wall has
//! no velocity, so that nothing flows through walls however few rounds the pressure gets.

mod act;
mod advect;
mod diffuse;
mod field;
mod places;
mod portable;
mod project;
mod spans;
#[cfg(test)]
mod tests;
mod vectors;
mod wave;
#[cfg(target_arch = "x86_64")]
mod x86;

use super::threads::for_cells;
use super::{FluidAction, FluidSource, PoolError, PoolGrid, StepAmounts, StirNoise, WetMask};
use advect::Flow;
use bevy::ecs::VariantDefaults;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use diffuse::Diffusion;
use field::{FRAME, Field};
use glam::{UVec2, Vec2};
use places::Places;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use vectors::Vectors;

/// Masks that solvers had so far: what is made of one is good as long as the number is the same.
static MASKS: AtomicU64 = AtomicU64::new(1);

/// Farthest that anything moves in a step, cells; what is faster is slowed down to it.
pub const MAX_CELLS_PER_STEP: f32 = 24.0;

/// How quantities are carried by the flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum Advection {
    /// From where the flow comes from, interpolated (Stam 1999). Eddies fade.
    #[default]
    SemiLagrangian,
    /// With the error taken off that going there and back shows, limited to the values that were there (Selle et al. 2008); and
    /// what is carried is the velocity reflected at the last step's pressure, which makes the step second order in time (Zehnder
    /// et al. 2018). Keeps eddies, takes about three times as long.
    MacCormack,
}

/// Settings of a [`FluidSolver`]. Numbers out of range are clamped where they are used; for those that are not finite 0 is taken.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
#[serde(default)]
pub struct SolverSettings {
    /// How quantities are carried.
    pub advection: Advection,
    /// Rounds of Jacobi's iteration for the pressure, 1 to 500; each step begins with the last one's pressure.
    pub pressure_iterations: u32,
    /// Kinematic viscosity, square metres per second; water has 1e-6.
    pub viscosity_m2_s: f32,
    /// Diffusion of what is dissolved, square metres per second.
    pub diffusion_m2_s: f32,
    /// Rounds of Jacobi's iteration for viscosity and diffusion, 1 to 100.
    pub diffusion_iterations: u32,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            advection: Advection::default(),
            pressure_iterations: 10,
            viscosity_m2_s: 0.0,
            diffusion_m2_s: 0.0,
            diffusion_iterations: 8,
        }
    }
}

/// What is dissolved in the fluid, as a share of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Reflect, Serialize, Deserialize)]
pub enum Dissolved {
    /// Blood.
    Blood,
    /// Dust of drilled bone.
    Dust,
}

/// Velocity, pressure and dissolved matter of a pool.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
#[require(SolverSettings)]
pub struct FluidSolver {
    grid: PoolGrid,
    noise: StirNoise,
    vectors: Vectors,
    mask: WetMask,
    places: Places,
    /// Another one for each mask.
    mask_revision: u64,
    /// Velocity through the left and the lower side of each cell, metres per second.
    velocity: [Field; 2],
    dissolved: [Field; 2],
    /// What the dissolved numbers must be multiplied by: amounts are corrected when they are next carried.
    factors: [f32; 2],
    /// Sums of the dissolved numbers, if they are known.
    sums: Option<[f64; 2]>,
    pressure: Field,
    /// Share of a step's pressure that the projection has to do, the rest of which the reflection did.
    pressure_share: f32,
    /// Room for the next state.
    next: [Field; 2],
    other: [Field; 2],
    reflected: [Field; 2],
    next_pressure: Field,
    rooms: Vec<project::Room>,
}

impl FluidSolver {
    /// Fluid at rest everywhere in a grid, with nothing dissolved.
    pub fn new(grid: PoolGrid) -> Self {
        let field = || Field::zero(grid.size());
        let mut made = Self {
            grid,
            noise: StirNoise::default(),
            vectors: Vectors::best(),
            mask: WetMask::from_fn(&grid, |_| true),
            places: Places::new(grid.size()),
            mask_revision: MASKS.fetch_add(1, Ordering::Relaxed),
            velocity: [field(), field()],
            dissolved: [field(), field()],
            factors: [1.0; 2],
            sums: Some([0.0; 2]),
            pressure: field(),
            pressure_share: 1.0,
            next: [field(), field()],
            other: [field(), field()],
            reflected: [field(), field()],
            next_pressure: field(),
            rooms: Vec::new(),
        };
        made.places.set(&made.mask, 0..grid.size().y as usize);
        made
    }

    /// The cells.
    pub fn grid(&self) -> &PoolGrid {
        &self.grid
    }

    /// Fluid is where a mask says from now on. What was dissolved in cells that became walls is lost; its amounts are returned, in
    /// cells full of it, blood first.
    ///
    /// # Errors
    /// A mask of another size than the grid.
    pub fn set_mask(&mut self, mask: &WetMask) -> Result<[f64; 2], PoolError> {
        if mask.size() != self.grid.size() {
            return Err(PoolError::MaskSize { found: mask.size(), expected: self.grid.size() });
        }
        let height = mask.size().y as usize;
        let differs = |y: &usize| self.mask.row(*y) != mask.row(*y);
        let Some(first) = (0..height).find(differs) else { return Ok([0.0; 2]) };
        let last = (first..height).rfind(differs).unwrap_or(first);
        let rows = first..last + 1;
        Ok(for_cells(rows.len() * mask.size().x as usize / 4, || self.wet(mask, rows)))
    }

    /// Fluid is where a mask says that differs in some rows only; returns what was dissolved in cells that became walls.
    fn wet(&mut self, mask: &WetMask, rows: Range<usize>) -> [f64; 2] {
        let change = self.places.set(mask, rows.clone());
        self.mask_revision = MASKS.fetch_add(1, Ordering::Relaxed);
        let places = &self.places;
        let in_rows = |field: &mut Field, rows: Range<usize>, of: &(dyn Fn(usize, &mut [f32]) -> f64 + Sync)| {
            let some = field.rows_mut().enumerate().skip(rows.start).take(rows.len());
            some.map(|(y, row)| of(y, row)).collect::<Vec<_>>().iter().sum::<f64>()
        };
        // Lower sides change with the cells below them.
        let sides = rows.start..(rows.end + 1).min(mask.size().y as usize);
        let [u, v] = &mut self.velocity;
        in_rows(u, sides.clone(), &|y, row| keep(row, places.open_x.row(y as isize)));
        in_rows(v, sides, &|y, row| keep(row, places.open_y.row(y as isize)));
        in_rows(&mut self.pressure, rows.clone(), &|y, row| keep(row, places.wet.row(y as isize)));
        let mut lost = [0.0; 2];
        for ((lost, field), factor) in lost.iter_mut().zip(&mut self.dissolved).zip(self.factors) {
            *lost = f64::from(factor) * in_rows(field, rows.clone(), &|y, row| keep(row, places.wet.row(y as isize)));
        }
        self.sums = None;
        // What is not written in a step must be 0.
        let room = self.next.iter_mut().chain(&mut self.other).chain(&mut self.reflected);
        for field in room.chain([&mut self.next_pressure]) {
            in_rows(field, rows.clone(), &|y, row| {
                for columns in spans::left(&change[y - rows.start], places.spans.of_row(y)) {
                    row[FRAME + columns.start..FRAME + columns.end].fill(0.0);
                }
                0.0
            });
        }
        self.mask.clone_from(mask);
        lost
    }

    /// Whether a cell holds fluid.
    pub fn is_wet(&self, cell: UVec2) -> bool {
        self.mask.is_wet(cell)
    }

    /// Velocity in the middle of a cell, metres per second; 0 beyond the grid.
    pub fn velocity_m_s(&self, cell: UVec2) -> Vec2 {
        if cell.cmpge(self.grid.size()).any() {
            return Vec2::ZERO;
        }
        let [u, v] = &self.velocity;
        0.5 * Vec2::new(u.at(cell) + u.at(cell + UVec2::X), v.at(cell) + v.at(cell + UVec2::Y))
    }

    /// Velocities through the sides, metres per second: through the left one of a cell (x) and the one towards lower rows (y).
    pub fn side_velocity_m_s(&self, cell: UVec2) -> Vec2 {
        if cell.cmpgt(self.grid.size()).any() {
            return Vec2::ZERO;
        }
        Vec2::new(self.velocity[0].at(cell), self.velocity[1].at(cell))
    }

    /// Share of a cell that is blood or dust; 0 beyond the grid.
    pub fn share(&self, what: Dissolved, cell: UVec2) -> f32 {
        let what = what as usize;
        if cell.cmplt(self.grid.size()).all() { self.dissolved[what].at(cell) * self.factors[what] } else { 0.0 }
    }

    /// Amount of blood or dust in the whole pool, in cells full of it.
    pub fn total(&self, what: Dissolved) -> f64 {
        let what = what as usize;
        let sum = self.sums.map_or_else(|| self.dissolved[what].sum(&self.places.spans), |sums| sums[what]);
        sum * f64::from(self.factors[what])
    }

    /// How high the pressure lifts the surface of a cell above its mean, metres, when steps take so many seconds and gravity is
    /// so strong (metres per second squared); the paper's height field (section 4.2).
    pub fn height_m(&self, cell: UVec2, step_s: f32, gravity_m_s2: f32) -> f32 {
        if cell.cmpge(self.grid.size()).any() || step_s <= 0.0 || gravity_m_s2 <= 0.0 {
            return 0.0;
        }
        self.pressure.at(cell) * self.grid.cell_m() / (self.pressure_share * step_s * gravity_m_s2)
    }

    /// Adds blood or dust to a cell, as a share of it; the share stays between 0 and 1. Nothing happens in walls.
    pub fn add(&mut self, what: Dissolved, cell: UVec2, share: f32) {
        if self.is_wet(cell) && share.is_finite() {
            self.settle();
            let own = self.dissolved[what as usize].at_mut(cell);
            *own = (*own + share).clamp(0.0, 1.0);
        }
    }

    /// Multiplies what is dissolved by the factors that it waits for, before something else is done with it.
    fn settle(&mut self) {
        for (field, factor) in self.dissolved.iter_mut().zip(&mut self.factors) {
            if *factor != 1.0 {
                field.update(&self.places.spans, |_, share| share * *factor);
                *factor = 1.0;
            }
        }
        self.sums = None;
    }

    /// Adds to the velocity, metres per second, of all sides between wet cells; the function gets places of the pool's plane in
    /// metres and is called for both directions. What is not finite adds nothing.
    pub fn push(&mut self, by_m_s: impl Fn(Vec2) -> Vec2 + Sync) {
        let grid = self.grid;
        let half_m = 0.5 * grid.cell_m();
        let [u, v] = &mut self.velocity;
        for (field, open, axis) in [(u, &self.places.open_x, 0), (v, &self.places.open_y, 1)] {
            let mut side_m = Vec2::ZERO;
            side_m[axis] = half_m;
            field.update(&self.places.spans, |cell, velocity| {
                let by = by_m_s(grid.pool_from_cell(cell) - side_m)[axis];
                if by.is_finite() && open.at(cell) > 0.0 { velocity + by } else { velocity }
            });
        }
    }

    /// Moves the fluid by a step of so many seconds, with nothing that acts on it. Nothing happens for steps that are not above 0.
    pub fn step(&mut self, step_s: f32, settings: &SolverSettings) {
        self.step_with(step_s, settings, &FluidAction::default());
    }

    /// The same with sources, and returns what they brought and took.
    pub fn step_with(&mut self, step_s: f32, settings: &SolverSettings, action: &FluidAction) -> StepAmounts {
        if !(step_s > 0.0 && step_s.is_finite()) {
            return StepAmounts::default();
        }
        for_cells(self.places.spans.cells(), || self.step_in_threads(step_s, settings, action))
    }

    /// The noise with which sources stir.
    pub fn noise(&self) -> &StirNoise {
        &self.noise
    }

    /// Sources stir with another noise from now on.
    pub fn set_noise(&mut self, noise: StirNoise) {
        self.noise = noise;
    }

    /// Sum of a source's weights over the cells with fluid: what it brings is shared out in proportion to them.
    pub fn weight_sum(&self, source: &FluidSource) -> f32 {
        if source.is_good() { act::weight_sum(&self.grid, &self.places, source) } else { 0.0 }
    }

    fn step_in_threads(&mut self, step_s: f32, settings: &SolverSettings, action: &FluidAction) -> StepAmounts {
        let cells_per_velocity = step_s / self.grid.cell_m();
        let square = self.grid.cell_m() * self.grid.cell_m();
        let rounds = settings.diffusion_iterations.clamp(1, 100);
        let strength = |m2_s: f32| if m2_s > 0.0 && m2_s.is_finite() { m2_s * step_s / square } else { 0.0 };
        let (places, vectors) = (&self.places, self.vectors);
        let flow = Flow { places, vectors, cells_per_velocity };

        let is_reflected = settings.advection == Advection::MacCormack;
        if is_reflected {
            project::subtract_gradient(&self.velocity, &self.pressure, places, vectors, &mut self.reflected);
        }
        self.pressure_share = if is_reflected { 0.5 } else { 1.0 };
        let reflected = is_reflected.then_some(&self.reflected);
        flow.carry_velocity(&self.velocity, reflected, &mut self.next, &mut self.other, settings.advection);
        let carried = &mut self.next;
        let spans = &places.spans;
        let viscosity = strength(settings.viscosity_m2_s);
        if viscosity > 0.0 {
            for (field, there) in carried.iter_mut().zip([&places.open_x, &places.open_y]) {
                let diffusion = Diffusion { there, spans, vectors, strength: viscosity, rounds };
                diffusion.run(field, &mut self.other, &mut self.rooms);
            }
        }
        for source in action.good_sources() {
            act::push(carried, &self.grid, places, source, &self.noise);
        }
        project::project(
            carried,
            &mut self.velocity,
            &mut self.pressure,
            &mut self.next_pressure,
            places,
            vectors,
            settings.pressure_iterations.clamp(1, 500),
            &mut self.rooms,
        );
        let mut amounts = StepAmounts::default();
        for source in action.good_sources() {
            act::flow(&mut self.velocity, &self.grid, &self.places, source);
            if act::dissolves(source) {
                self.settle();
                act::dissolve(&mut self.dissolved, &self.grid, &self.places, source, &mut amounts);
            }
        }
        let before = self.totals();
        let flow = Flow { places: &self.places, vectors, cells_per_velocity };
        let (factors, advection) = (self.factors, settings.advection);
        let room = [&mut self.next, &mut self.other];
        let mut after = flow.carry_dissolved(&mut self.dissolved, factors, &self.velocity, room, advection);
        let diffusion = strength(settings.diffusion_m2_s);
        if diffusion > 0.0 {
            let (there, spans) = (&self.places.wet, &self.places.spans);
            let diffusion = Diffusion { there, spans, vectors, strength: diffusion, rounds };
            for (field, after) in self.dissolved.iter_mut().zip(&mut after) {
                diffusion.run(field, &mut self.next, &mut self.rooms);
                *after = field.sum(spans);
            }
        }
        // Interpolation does not keep amounts: what is missing or too much is shared out over all that there is.
        let keep = action.keep();
        self.sums = Some(after);
        for what in 0..2 {
            amounts.faded[what] = before[what] * (1.0 - f64::from(keep[what]));
            self.factors[what] = if after[what] > 0.0 { (before[what] / after[what]) as f32 * keep[what] } else { 1.0 };
        }
        amounts
    }

    /// Tells masks apart, also those of other solvers; a clone has the same mask.
    #[cfg_attr(not(feature = "render"), expect(dead_code, reason = "only the GPU copies masks"))]
    pub(crate) fn mask_revision(&self) -> u64 {
        self.mask_revision
    }

    fn totals(&self) -> [f64; 2] {
        [Dissolved::Blood, Dissolved::Dust].map(|what| self.total(what))
    }
}

/// 0 where another row is 0; returns the sum of what was there.
fn keep(row: &mut [f32], where_: &[f32]) -> f64 {
    let mut lost = 0.0;
    for (value, kept) in row.iter_mut().zip(where_) {
        if *kept == 0.0 {
            lost += f64::from(*value);
            *value = 0.0;
        }
    }
    lost
}

/// What is drawn of a pool.
impl FluidSolver {
    /// A row of cells: 1 where there is fluid, pressure, and what is shares of blood and dust times [`Self::share_factors`].
    pub(crate) fn row(&self, y: u32) -> [&[f32]; 4] {
        let [blood, dust] = &self.dissolved;
        let width = self.grid.size().x as usize;
        [&self.places.wet, &self.pressure, blood, dust].map(|field| &field.row(y as isize)[FRAME..][..width])
    }

    /// What numbers of blood and dust in a [`Self::row`] must be multiplied by.
    pub(crate) fn share_factors(&self) -> [f32; 2] {
        self.factors
    }

    /// [`FluidSolver::height_m`] of a cell by its pressure, metres.
    pub(crate) fn height_per_pressure_m(&self, step_s: f32, gravity_m_s2: f32) -> f32 {
        let per_pressure = self.grid.cell_m() / (self.pressure_share * step_s * gravity_m_s2);
        if per_pressure.is_finite() && per_pressure > 0.0 { per_pressure } else { 0.0 }
    }
}
