//! Steps on their way to the GPU.

use super::mask::PackedMask;
use super::readings::PoolReadings;
use super::uniform::{FlowSource, FlowUniform};
use crate::pool::source::{FLOW_REACH, FluidAction, FluidSource, SOURCE_REACH};
use crate::pool::{Advection, FluidSolver, Hiding, SolverSettings, StirNoise};
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;
use std::collections::VecDeque;
use std::sync::Arc;

/// So many steps wait at most; of more the oldest are left out.
pub const MAX_WAITING_STEPS: usize = 240;

/// Asks for a pool's flow on the GPU, and holds the steps that are on their way there.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(Component, Default, Clone, Debug)]
#[require(PoolReadings)]
pub struct GpuFlow {
    /// How strongly waves are pulled down, metres per second squared: the height of the surface follows from it.
    pub gravity_m_s2: f32,
    /// Which cells count as hidden in the readings.
    pub hiding: Hiding,
    #[reflect(ignore)]
    steps: StepQueue,
    /// Number of the last step.
    #[reflect(ignore)]
    last: u64,
    #[reflect(ignore)]
    mask: Option<(u64, Arc<PackedMask>)>,
}

impl Default for GpuFlow {
    fn default() -> Self {
        Self {
            gravity_m_s2: 9.81,
            hiding: Hiding { from: 0.5, dust: 0.0 },
            steps: StepQueue::default(),
            last: 0,
            mask: None,
        }
    }
}

impl GpuFlow {
    /// Queues a step of so many seconds for the fluid of a solver, of which grid, mask and noise count; see
    /// [`FluidSolver::step_with`]. Returns the step's number, which [`PoolReadings::step`] tells later; 0 for steps that are not
    /// above 0, with which nothing happens.
    pub fn push(&mut self, fluid: &FluidSolver, step_s: f32, settings: &SolverSettings, action: &FluidAction) -> u64 {
        if !(step_s > 0.0 && step_s.is_finite()) {
            return 0;
        }
        let revision = fluid.mask_revision();
        let mask = match &self.mask {
            Some((of, mask)) if *of == revision => mask.clone(),
            _ => {
                let mask = Arc::new(PackedMask::new(fluid.grid().size(), |cell| fluid.is_wet(cell)));
                self.mask = Some((revision, mask.clone()));
                mask
            }
        };
        self.last += 1;
        self.steps.push(FlowStep::new(self, mask, fluid, step_s, settings, action));
        self.last
    }

    /// Steps that the render world has not taken yet.
    pub fn waiting(&self) -> usize {
        self.steps.0.len()
    }

    pub(super) fn take(&mut self) -> StepQueue {
        std::mem::take(&mut self.steps)
    }
}

/// Steps in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct StepQueue(pub VecDeque<FlowStep>);

impl StepQueue {
    pub fn push(&mut self, step: FlowStep) {
        if self.0.len() == MAX_WAITING_STEPS {
            static WARNS: std::sync::Once = std::sync::Once::new();
            WARNS.call_once(|| {
                tracing::warn!("more than {MAX_WAITING_STEPS} steps of a pool wait for the GPU: it misses some")
            });
            self.0.pop_front();
        }
        self.0.push_back(step);
    }
}

/// Sources of a kind, and the tiles that they reach.
#[derive(Clone, Debug, Default)]
pub(super) struct Acting {
    pub sources: Vec<FlowSource>,
    pub tiles: Vec<u32>,
}

/// What a step needs.
#[derive(Clone, Debug)]
pub(super) struct FlowStep {
    /// Counts from 1.
    pub number: u64,
    pub mask: Arc<PackedMask>,
    pub noise: StirNoise,
    pub cell_m: f32,
    pub step_s: f32,
    pub settings: SolverSettings,
    pub keep: [f32; 2],
    /// Before the pressure.
    pub pushing: Acting,
    /// After it.
    pub acting: Acting,
    pub mm_per_pressure: f32,
    pub hiding: Hiding,
}

impl FlowStep {
    fn new(
        flow: &GpuFlow,
        mask: Arc<PackedMask>,
        fluid: &FluidSolver,
        step_s: f32,
        settings: &SolverSettings,
        action: &FluidAction,
    ) -> Self {
        let grid = fluid.grid();
        let (mut pushing, mut acting) = (Acting::default(), Acting::default());
        let (mut push_reach, mut act_reach) = (Vec::new(), Vec::new());
        let reach = |source: &FluidSource, radii: f32| {
            let reach_m = Vec2::splat(source.radius_m * radii);
            // Sides and rounding.
            let (low_m, high_m) = (source.place_m - reach_m, source.place_m + reach_m);
            Rect::from_corners(grid.cell_from_pool(low_m) - 2.0, grid.cell_from_pool(high_m) + 2.0)
        };
        for source in action.good_sources() {
            if source.push_m_s != Vec2::ZERO || source.stir_m_s != 0.0 {
                pushing.sources.push(FlowSource::new(source, 0.0));
                push_reach.push(reach(source, SOURCE_REACH));
            }
            let dissolves = source.clear > 0.0 || source.amount != [0.0; 2];
            let weight_sum = if dissolves { fluid.weight_sum(source) } else { 0.0 };
            if source.flow_m2_s != 0.0 || weight_sum > 0.0 {
                acting.sources.push(FlowSource::new(source, weight_sum));
                act_reach.push(reach(source, if source.flow_m2_s != 0.0 { FLOW_REACH } else { SOURCE_REACH }));
            }
        }
        pushing.tiles = mask.tiles_within(&push_reach);
        acting.tiles = mask.tiles_within(&act_reach);
        // See `FluidSolver::height_m`.
        let share = if settings.advection == Advection::MacCormack { 0.5 } else { 1.0 };
        let height = 1000.0 * grid.cell_m() / (share * step_s * flow.gravity_m_s2);
        Self {
            number: flow.last,
            mask,
            noise: fluid.noise().clone(),
            cell_m: grid.cell_m(),
            step_s,
            settings: *settings,
            keep: action.keep(),
            pushing,
            acting,
            mm_per_pressure: if flow.gravity_m_s2 > 0.0 && height.is_finite() { height } else { 0.0 },
            hiding: flow.hiding,
        }
    }

    pub fn has_viscosity(&self) -> bool {
        is_positive(self.settings.viscosity_m2_s)
    }

    pub fn has_diffusion(&self) -> bool {
        is_positive(self.settings.diffusion_m2_s)
    }

    /// What of it alone travels to the GPU.
    pub fn bytes(&self) -> u64 {
        let acting = |acting: &Acting| {
            acting.sources.len() as u64 * FlowSource::min_size().get() + acting.tiles.len() as u64 * 4
        };
        FlowUniform::min_size().get() + acting(&self.pushing) + acting(&self.acting)
    }

    /// Fields of two numbers that it needs besides velocity and what is dissolved.
    pub fn rooms(&self) -> usize {
        match self.settings.advection {
            Advection::MacCormack => 3,
            Advection::SemiLagrangian if self.has_viscosity() || self.has_diffusion() => 2,
            Advection::SemiLagrangian => 1,
        }
    }
}

fn is_positive(number: f32) -> bool {
    number > 0.0 && number.is_finite()
}
