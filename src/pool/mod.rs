//! Irrigation and blood: a pool of fluid in a plane across the cavity (paper of 2009, section 4).
//!
//! - A [`PoolGrid`] lies in the world and not on the screen: moving cameras do not disturb it.
//! - A [`WetMask`] says which of its cells hold fluid.
//! - A [`FluidSolver`] moves velocity and what is dissolved, on the processor and the same on any number of threads. On an entity
//!   it is stepped in [`SurgerySystems::Flow`].

mod error;
mod grid;
mod mask;
mod noise;
mod solver;
mod source;

pub use error::PoolError;
pub use grid::{MAX_CELLS, MIN_CELLS, PoolGrid};
pub use mask::WetMask;
pub use noise::StirNoise;
pub use solver::{Advection, Dissolved, FluidSolver, MAX_CELLS_PER_STEP, SolverSettings};
pub use source::{FLOW_REACH, FluidAction, FluidSource, MAX_SOURCES, SOURCE_REACH, StepAmounts};

use crate::schedule::SurgerySystems;
use bevy::prelude::*;

/// Pools of fluid. Needs [`SurgerySchedulePlugin`](crate::schedule::SurgerySchedulePlugin).
pub struct PoolPlugin;

impl Plugin for PoolPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<PoolError>()
            .register_type::<PoolGrid>()
            .register_type::<WetMask>()
            .register_type::<Advection>()
            .register_type::<Dissolved>()
            .register_type::<FluidSolver>()
            .register_type::<SolverSettings>()
            .add_systems(FixedUpdate, step_pools.in_set(SurgerySystems::Flow));
    }
}

fn step_pools(mut pools: Query<(&mut FluidSolver, &SolverSettings)>, time: Res<Time>) {
    for (mut fluid, settings) in &mut pools {
        fluid.step(time.delta_secs(), settings);
    }
}
