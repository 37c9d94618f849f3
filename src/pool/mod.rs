//! Irrigation and blood: a pool of fluid in a plane across the cavity (paper of 2009, sections 4, 5.1 to 5.3, 7 and 8).
//!
//! - A [`Pool`] lies in the world and not on the screen: moving cameras do not disturb it. It looks at a volume from above, column
//!   by column: the [`Cavity`].
//! - How high it stands follows from a [`WaterBudget`] or is set ([`PoolLevel`]).
//! - A [`WetMask`] says which of its cells hold fluid.
//! - A [`FluidSolver`] moves velocity and what is dissolved, on the processor and the same on any number of threads.
//! - Burrs stir it, a [`SuctionIrrigator`] irrigates and sucks, a [`Bleeder`] bleeds into it.

mod backend;
mod bleeding;
mod cavity;
mod columns;
mod component;
mod error;
mod grid;
mod hiding;
mod irrigator;
mod look;
mod mask;
mod noise;
#[cfg(feature = "render")]
pub mod render;
pub mod software;
mod solver;
mod source;
mod step;
mod surface;
mod threads;
mod water;

pub use backend::PoolBackend;
pub use bleeding::{Bleeder, BleedingControl, BleedingRules, TreatBleeders, VesselOpened};
pub use cavity::{Cavity, NO_BONE_M};
pub use component::{FoamPatch, MAX_FOAM, Pool, PoolFault, PoolFluid, PoolState, PoolTemplate};
pub use error::PoolError;
pub use grid::{MAX_CELLS, MIN_CELLS, PoolGrid};
pub use hiding::Hiding;
pub use irrigator::{SuctionGurgled, SuctionIrrigator, SuctionState};
pub use look::{FresnelModel, PoolLook};
pub use mask::WetMask;
pub use noise::StirNoise;
pub use solver::{Advection, Dissolved, FluidSolver, MAX_CELLS_PER_STEP, SolverSettings};
pub use source::{FLOW_REACH, FluidAction, FluidSource, MAX_SOURCES, SOURCE_REACH, StepAmounts};
pub use surface::{PoolSurface, SURFACE_TILE};
pub use water::{PoolLevel, WaterBudget};

use crate::checkpoint::KeepState;
use crate::gravity::SurgeryGravity;
use crate::schedule::SurgerySystems;
use bevy::prelude::*;

/// In [`SurgerySystems::Flow`]: pools look at their volumes and take their step.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct FlowPools;

/// Pools of fluid. Needs [`SurgerySchedulePlugin`](crate::schedule::SurgerySchedulePlugin) and
/// [`VolumePlugin`](crate::volume::VolumePlugin).
pub struct PoolPlugin;

impl Plugin for PoolPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<PoolError>()
            .register_type::<PoolGrid>()
            .register_type::<WetMask>()
            .register_type::<Hiding>()
            .register_type::<Advection>()
            .register_type::<Dissolved>()
            .register_type::<FluidSolver>()
            .register_type::<FresnelModel>()
            .register_type::<PoolLook>()
            .register_type::<PoolSurface>()
            .register_type::<software::PoolMixture>()
            .register_type::<SolverSettings>()
            .register_type::<StirNoise>()
            .register_type::<FluidSource>()
            .register_type::<FluidAction>()
            .register_type::<StepAmounts>();
        app.register_type::<Cavity>()
            .register_type::<Pool>()
            .register_type::<PoolFault>()
            .register_type::<PoolFluid>()
            .register_type::<PoolState>()
            .register_type::<FoamPatch>()
            .register_type::<PoolLevel>()
            .register_type::<WaterBudget>()
            .register_type::<SuctionIrrigator>()
            .register_type::<SuctionState>()
            .register_type::<SuctionGurgled>()
            .add_message::<SuctionGurgled>();
        app.init_resource::<SurgeryGravity>()
            .keep_component::<columns::Measured>()
            .keep_component::<step::Shown>()
            // Heights as they were and as they are; velocities, pressure and what is dissolved, each with room for the next state.
            .keep_large_component(|cavity: &Cavity| cavity.grid().count() * 8)
            .keep_large_component(|fluid: &FluidSolver| fluid.grid().count() * 56)
            .keep_large_component(|surface: &PoolSurface| size_of_val(surface.texels.as_slice()))
            .keep_component::<PoolState>()
            .keep_component::<WaterBudget>()
            .keep_component::<SuctionIrrigator>()
            .keep_component::<SuctionState>();
        backend::build(app);
        bleeding::build(app);
        app.add_systems(
            FixedUpdate,
            (columns::measure_columns, step::flow).chain().in_set(FlowPools).in_set(SurgerySystems::Flow),
        );
        #[cfg(feature = "render")]
        app.add_plugins(render::PoolRenderPlugin);
    }
}
