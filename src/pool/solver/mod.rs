//! Incompressible flow in the plane (paper of 2009, algorithm 1), on the processor.
//!
//! Velocities lie on the sides of the cells, pressure and what is dissolved in their middles: a side between fluid and wall has
//! no velocity, so that nothing flows through walls however few rounds the pressure gets.

mod act;
mod advect;
mod diffuse;
mod field;
mod project;
mod spans;

use super::{FluidAction, FluidSource, PoolError, PoolGrid, StepAmounts, StirNoise, WetMask};
use advect::Flow;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use field::{Field, Places};
use glam::{UVec2, Vec2};
use serde::{Deserialize, Serialize};
use spans::Spans;

/// Farthest that anything moves in a step, cells; what is faster is slowed down to it.
pub const MAX_CELLS_PER_STEP: f32 = 24.0;

/// How quantities are carried by the flow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
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
    places: Places,
    spans: Spans,
    /// Velocity through the left and the lower side of each cell, metres per second.
    velocity: [Field; 2],
    dissolved: [Field; 2],
    pressure: Field,
    /// Share of a step's pressure that the projection has to do, the rest of which the reflection did.
    pressure_share: f32,
    /// Room for the next state.
    next: [Field; 2],
    other: [Field; 2],
    reflected: [Field; 2],
    divergence: Field,
}

impl FluidSolver {
    /// Fluid at rest everywhere in a grid, with nothing dissolved.
    pub fn new(grid: PoolGrid) -> Self {
        let field = || Field::zero(grid.size());
        let mut made = Self {
            grid,
            noise: StirNoise::default(),
            places: Places::new(grid.size()),
            spans: Spans::default(),
            velocity: [field(), field()],
            dissolved: [field(), field()],
            pressure: field(),
            pressure_share: 1.0,
            next: [field(), field()],
            other: [field(), field()],
            reflected: [field(), field()],
            divergence: field(),
        };
        made.wet(|_| true);
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
        let before = self.totals();
        self.wet(|cell| mask.is_wet(cell));
        let after = self.totals();
        Ok([before[0] - after[0], before[1] - after[1]])
    }

    fn wet(&mut self, is_wet: impl Fn(UVec2) -> bool) {
        self.places.set(is_wet);
        self.spans = Spans::new(&self.places);
        self.velocity[0].keep(&self.places.open_x);
        self.velocity[1].keep(&self.places.open_y);
        for field in self.dissolved.iter_mut().chain([&mut self.pressure]) {
            field.keep(&self.places.wet);
        }
        // What is not written in a step must be 0.
        for field in
            self.next.iter_mut().chain(&mut self.other).chain(&mut self.reflected).chain([&mut self.divergence])
        {
            *field = Field::zero(self.grid.size());
        }
    }

    /// Whether a cell holds fluid.
    pub fn is_wet(&self, cell: UVec2) -> bool {
        cell.cmplt(self.grid.size()).all() && self.places.wet.at(cell) > 0.0
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
        if cell.cmplt(self.grid.size()).all() { self.dissolved[what as usize].at(cell) } else { 0.0 }
    }

    /// Amount of blood or dust in the whole pool, in cells full of it.
    pub fn total(&self, what: Dissolved) -> f64 {
        self.dissolved[what as usize].sum(&self.spans)
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
            let own = self.dissolved[what as usize].at_mut(cell);
            *own = (*own + share).clamp(0.0, 1.0);
        }
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
            field.update(&self.spans, |cell, velocity| {
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
        // Once into the threads' pool, and not at each of the many passes.
        rayon::scope(|_| self.step_in_threads(step_s, settings, action))
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
        let flow = Flow { places: &self.places, spans: &self.spans, cells_per_velocity };

        let is_reflected = settings.advection == Advection::MacCormack;
        if is_reflected {
            for (reflected, velocity) in self.reflected.iter_mut().zip(&self.velocity) {
                reflected.values.copy_from_slice(&velocity.values);
            }
            project::subtract_gradient(&mut self.reflected, &self.pressure, &self.places, &self.spans);
        }
        self.pressure_share = if is_reflected { 0.5 } else { 1.0 };
        let reflected = is_reflected.then_some(&self.reflected);
        flow.carry_velocity(&mut self.velocity, reflected, &mut self.next, &mut self.other, settings.advection);
        let viscosity = strength(settings.viscosity_m2_s);
        if viscosity > 0.0 {
            for (field, open) in self.velocity.iter_mut().zip([&self.places.open_x, &self.places.open_y]) {
                diffuse::diffuse(field, &mut self.next, open, &self.spans, viscosity, rounds);
            }
        }
        for source in action.good_sources() {
            act::push(&mut self.velocity, &self.grid, &self.places, source, &self.noise);
        }
        project::project(
            &mut self.velocity,
            &mut self.pressure,
            &mut self.next[0],
            &mut self.divergence,
            &self.places,
            &self.spans,
            settings.pressure_iterations.clamp(1, 500),
        );
        let mut amounts = StepAmounts::default();
        for source in action.good_sources() {
            act::flow(&mut self.velocity, &self.grid, &self.places, source);
            act::dissolve(&mut self.dissolved, &self.grid, &self.places, source, &mut amounts);
        }
        let before = self.totals();
        let flow = Flow { places: &self.places, spans: &self.spans, cells_per_velocity };
        flow.carry_dissolved(&mut self.dissolved, &self.velocity, &mut self.next, &mut self.other, settings.advection);
        let diffusion = strength(settings.diffusion_m2_s);
        if diffusion > 0.0 {
            for field in &mut self.dissolved {
                diffuse::diffuse(field, &mut self.next, &self.places.wet, &self.spans, diffusion, rounds);
            }
        }
        // Interpolation does not keep amounts: what is missing or too much is shared out over all that there is.
        let after = self.totals();
        let keep = action.keep();
        for (what, field) in self.dissolved.iter_mut().enumerate() {
            amounts.faded[what] = before[what] * (1.0 - f64::from(keep[what]));
            if after[what] > 0.0 {
                field.scale(&self.spans, (before[what] / after[what]) as f32 * keep[what]);
            }
        }
        amounts
    }

    fn totals(&self) -> [f64; 2] {
        [Dissolved::Blood, Dissolved::Dust].map(|what| self.total(what))
    }
}
