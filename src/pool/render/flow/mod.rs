//! The flow of a pool on the GPU: compute kernels that do what [`FluidSolver`](crate::pool::FluidSolver) does, to within rounding.
//!
//! - A [`Pool`](crate::pool::Pool) with [`GpuFlow`] is moved by the GPU: see [`PoolBackend`](crate::pool::PoolBackend). Its [`FluidSolver`](crate::pool::FluidSolver) stays as the holder of grid,
//!   mask and noise, and is not stepped.
//! - [`GpuFlow::push`] queues a step. The render world takes none, one or several of them per frame, in their order, before the
//!   cameras are drawn; while pipelines are being made they wait.
//! - Passes sample [`FlowSurface`]. What the model wants to know comes back some frames later as [`PoolReadings`].
//! - The fluid begins at rest with nothing dissolved, also after the grid became another. A new mask keeps what is in cells that
//!   stay wet.
//!
//! `shaders/pool/flow.wgsl` says how fields lie in memory. Kernels do not wait for one another within a dispatch, and sums are
//! made in one order, so that the same device gives the same bits.

mod chain;
mod command;
mod extract;
mod kernels;
mod mask;
mod pass;
mod readings;
mod state;
mod uniform;

pub use command::{GpuFlow, MAX_WAITING_STEPS};
pub use pass::{FlowFields, FlowSurface, FlowSurfaces};
pub use readings::PoolReadings;
pub use uniform::{FlowSource, FlowUniform};

use bevy::core_pipeline::schedule::camera_driver;
use bevy::prelude::*;
use bevy::render::render_resource::{DownlevelFlags, TextureFormat, TextureUsages};
use bevy::render::renderer::{RenderAdapter, RenderDevice, RenderGraph, RenderGraphSystems};
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

/// In `PrepareResources`: rooms for the fields of pools.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct PrepareFlow;

/// In `PreUpdate`: pools whose device cannot move them go back to the processor.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(in crate::pool) struct RefuseFlow;

/// Whether the render world has what the kernels need.
#[derive(Resource)]
struct FlowSupport(Result<(), String>);

pub(super) fn build(app: &mut App) {
    app.register_type::<GpuFlow>().register_type::<PoolReadings>().add_systems(PreUpdate, refuse.in_set(RefuseFlow));
    let sender = readings::build(app);
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .insert_resource(sender)
        .init_resource::<extract::FlowQueues>()
        .init_gpu_resource::<pass::FlowPools>()
        .init_gpu_resource::<FlowSurfaces>()
        .add_systems(RenderStartup, kernels::init_pipelines)
        .add_systems(ExtractSchedule, extract::extract_steps)
        .add_systems(
            Render,
            (
                pass::prepare_pools.in_set(PrepareFlow).in_set(RenderSystems::PrepareResources),
                pass::map_readings.in_set(RenderSystems::Cleanup),
            ),
        )
        // Once for all cameras.
        .add_systems(RenderGraph, pass::run_steps.in_set(RenderGraphSystems::Render).before(camera_driver));
}

/// When the device is there.
pub(super) fn finish(app: &mut App) {
    let world = app.world();
    let found = match (world.get_resource::<RenderDevice>(), world.get_resource::<RenderAdapter>()) {
        (Some(device), Some(adapter)) => check(device, adapter),
        _ => Err("there is no graphics device".into()),
    };
    app.insert_resource(FlowSupport(found));
}

/// What of a device the kernels need that WebGL and old cards lack; the reason why it will not do.
fn check(device: &RenderDevice, adapter: &RenderAdapter) -> Result<(), String> {
    let limits = device.limits();
    if !adapter.get_downlevel_capabilities().flags.contains(DownlevelFlags::COMPUTE_SHADERS) {
        return Err("the graphics device has no compute shaders".into());
    }
    if limits.max_storage_buffers_per_shader_stage < 8 || limits.max_compute_invocations_per_workgroup < 128 {
        return Err("the graphics device has too small limits for compute shaders".into());
    }
    let usages = adapter.get_texture_format_features(TextureFormat::Rgba16Float).allowed_usages;
    if !usages.contains(TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING) {
        return Err("the graphics device cannot write textures of 16-bit numbers".into());
    }
    Ok(())
}

/// Without such a device pools stay on the processor.
fn refuse(
    added: Query<Entity, Added<GpuFlow>>,
    support: Res<FlowSupport>,
    mut commands: Commands,
    mut has_warned: Local<bool>,
) {
    let Err(reason) = &support.0 else { return };
    for pool in &added {
        if !*has_warned {
            *has_warned = true;
            tracing::warn!("pools are moved by the processor: {reason}");
        }
        commands.entity(pool).remove::<GpuFlow>();
    }
}
