//! Who moves a pool's fluid: the processor or the GPU.

#[cfg(feature = "render")]
use super::render::flow::{GpuFlow, PoolReadings};
use super::{Dissolved, FluidAction, FluidSolver, Hiding, SolverSettings};
use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Where a pool's fluid is moved. Both do the same to within rounding; only the processor does it with the same bits on every
/// machine, and what is read back from the GPU (blood, what is hidden) comes some frames late.
///
/// A pool that changes over begins at rest with clear water.
#[derive(
    Component, Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults,
)]
#[reflect(Component, Default, Clone)]
pub enum PoolBackend {
    /// On the GPU where there is one, on the processor where the GPU is software or nothing is drawn.
    #[default]
    Auto,
    /// On the processor.
    Cpu,
    /// On the GPU, software or not; on the processor where there is none that can.
    Gpu,
}

/// What of a pool is on the GPU.
#[cfg(feature = "render")]
pub(super) type OnGpu = Option<(&'static mut GpuFlow, &'static PoolReadings)>;
#[cfg(not(feature = "render"))]
pub(super) type OnGpu = ();

#[cfg(feature = "render")]
type OnGpuItem<'a, 'w> = &'a mut Option<(Mut<'w, GpuFlow>, &'w PoolReadings)>;
#[cfg(not(feature = "render"))]
type OnGpuItem<'a, 'w> = &'a mut ();

/// What is known of a pool's fluid after a step.
pub(super) struct Known {
    /// Blood, in cells full of it.
    pub blood: f64,
    /// Cells that are hidden, where the GPU has counted them.
    pub hidden_cells: Option<f32>,
    /// Whether the processor has the fluid.
    pub is_on_processor: bool,
}

/// Moves a pool by a step.
pub(super) fn advance(
    fluid: &mut FluidSolver,
    on_gpu: OnGpuItem,
    step_s: f32,
    settings: &SolverSettings,
    action: &FluidAction,
    hiding: Hiding,
    gravity_m_s2: f32,
) -> Known {
    #[cfg(feature = "render")]
    if let Some((flow, readings)) = on_gpu {
        (flow.gravity_m_s2, flow.hiding) = (gravity_m_s2, hiding);
        flow.push(fluid, step_s, settings, action);
        let hidden_cells = Some(readings.hidden_share * readings.wet_cells as f32);
        return Known { blood: f64::from(readings.blood), hidden_cells, is_on_processor: false };
    }
    let _ = (on_gpu, hiding, gravity_m_s2);
    fluid.step_with(step_s, settings, action);
    Known { blood: fluid.total(Dissolved::Blood), hidden_cells: None, is_on_processor: true }
}

#[cfg(feature = "render")]
mod choice {
    use super::*;
    use crate::pool::Pool;
    use bevy::render::renderer::RenderAdapterInfo;
    use wgpu::DeviceType;

    /// Puts pools on the GPU and takes them off.
    pub(super) fn choose(
        mut commands: Commands,
        pools: Query<(Entity, &PoolBackend, Has<GpuFlow>), (With<Pool>, Changed<PoolBackend>)>,
        adapter: Option<Res<RenderAdapterInfo>>,
    ) {
        let Some(adapter) = adapter else { return };
        for (entity, backend, is_on_gpu) in &pools {
            let wants = match backend {
                PoolBackend::Auto => adapter.device_type != DeviceType::Cpu,
                PoolBackend::Cpu => false,
                PoolBackend::Gpu => true,
            };
            if wants && !is_on_gpu {
                commands.entity(entity).insert(GpuFlow::default());
            } else if !wants && is_on_gpu {
                commands.entity(entity).remove::<GpuFlow>();
            }
        }
    }
}

pub(super) fn build(app: &mut App) {
    app.register_type::<PoolBackend>();
    // Chosen before it is looked whether the device can do it.
    #[cfg(feature = "render")]
    app.add_systems(PreUpdate, choice::choose.before(super::render::flow::RefuseFlow));
}
