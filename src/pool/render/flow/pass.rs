//! Steps of a frame on the GPU, and what others see of the result.

use super::chain::Chain;
use super::command::{FlowStep, StepQueue};
use super::extract::FlowQueues;
use super::kernels::FlowPipelines;
use super::readings::{PoolReadings, ReadingsSender};
use super::state::FlowState;
use crate::render::Uploads;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// What passes sample of a pool.
#[derive(Clone, Debug)]
pub struct FlowSurface {
    /// `Rgba16Float`, a texel per cell, rows of the pool in order: height of the surface above its mean in millimetres, shares
    /// of blood and dust, 1 where there is fluid. All 0 elsewhere.
    pub texture: Texture,
    /// All of it.
    pub view: TextureView,
    /// Columns and rows.
    pub size: UVec2,
    /// Number of the last step that it shows; 0 before the first one.
    pub step: u64,
    /// What it was made of.
    pub fields: FlowFields,
}

/// The fields of a pool in full precision, for passes that want more than its surface. `shaders/pool/flow.wgsl` says where
/// numbers lie in them. Buffers change their roles from step to step: take them anew in each frame.
#[derive(Clone, Debug)]
pub struct FlowFields {
    /// Velocity through the left and the lower side of each cell, metres per second.
    pub velocity: Buffer,
    /// Blood and dust, to be multiplied by `scale`.
    pub dissolved: Buffer,
    /// Two factors.
    pub scale: Buffer,
    /// One number per cell.
    pub pressure: Buffer,
    /// Numbers from row to row.
    pub stride: u32,
}

/// The surfaces of all pools that the GPU moves, by main entity (render world). Those of this frame are drawn before its cameras.
#[derive(Resource, Default)]
pub struct FlowSurfaces(pub BTreeMap<MainEntity, FlowSurface>);

/// Fields of all pools.
#[derive(Resource, Default)]
pub(super) struct FlowPools(BTreeMap<MainEntity, FlowState>);

/// Makes room for new pools and drops that of old ones.
pub(super) fn prepare_pools(
    mut pools: ResMut<FlowPools>,
    mut surfaces: ResMut<FlowSurfaces>,
    mut queues: ResMut<FlowQueues>,
    device: Res<RenderDevice>,
) {
    pools.0.retain(|entity, _| queues.0.contains_key(entity));
    for (entity, StepQueue(steps)) in &mut queues.0 {
        // What was to happen before the component was exchanged, or in a grid that is gone.
        let first = steps.iter().rposition(|step| step.number == 1);
        steps.drain(..first.unwrap_or(0));
        let Some(newest) = steps.back() else { continue };
        let (mask, size) = (newest.mask.clone(), newest.mask.size);
        steps.retain(|step| step.mask.size == size);
        if first.is_some() || pools.0.get(entity).is_none_or(|state| state.size != size) {
            let state = FlowState::new(&device, &mask);
            let (texture, view) = (state.surface.clone(), state.surface_view.clone());
            let fields = state.fields(mask.stride);
            surfaces.0.insert(*entity, FlowSurface { texture, view, size, step: 0, fields });
            pools.0.insert(*entity, state);
        }
    }
    surfaces.0.retain(|entity, _| pools.0.contains_key(entity));
}

pub(super) fn run_steps(
    mut pools: ResMut<FlowPools>,
    mut surfaces: ResMut<FlowSurfaces>,
    mut queues: ResMut<FlowQueues>,
    pipelines: Option<Res<FlowPipelines>>,
    cache: Res<PipelineCache>,
    uploaded: Option<Res<Uploads>>,
    queue: Res<RenderQueue>,
    mut context: RenderContext,
) {
    if queues.0.values().all(|queue| queue.0.is_empty()) {
        return;
    }
    // Never half a chain: until all are there, steps wait.
    let Some(kernels) = pipelines.as_ref().and_then(|pipelines| pipelines.ready(&cache)) else { return };
    let device = context.render_device().clone();
    let recorder = context.diagnostic_recorder();
    let recorder = recorder.as_deref();
    let encoder = context.command_encoder();
    let span = recorder.time_span(encoder, "pool_flow");
    for (entity, steps) in &mut queues.0 {
        let Some(state) = pools.0.get_mut(entity) else { continue };
        let steps = std::mem::take(&mut steps.0);
        let offsets = state.upload(&device, &queue, steps.iter());
        let mut bytes = steps.iter().map(FlowStep::bytes).sum::<u64>();
        for (step, offset) in steps.iter().zip(&offsets) {
            state.ensure_room(&device, step.rooms());
            state.set_noise(&device, &step.noise);
            let has_new_mask = state.set_mask(&device, step);
            if has_new_mask {
                state.clear_room(encoder);
                bytes += step.mask.bytes();
            }
            let Some(mut chain) = Chain::begin(&device, &kernels, encoder, state, *offset) else { continue };
            if let Some(mask) = state.mask.as_ref().filter(|_| has_new_mask) {
                chain.settle(state, mask);
            }
            chain.step(state, step);
        }
        let (Some(last), Some(offset)) = (steps.back(), offsets.last()) else { continue };
        if let Some(mut chain) = Chain::begin(&device, &kernels, encoder, state, *offset) {
            chain.publish(state);
        }
        if let Some(uploaded) = &uploaded {
            uploaded.add(bytes);
        }
        state.copy_readings(encoder, readings_of(last));
        if let Some(surface) = surfaces.0.get_mut(entity) {
            (surface.step, surface.fields) = (last.number, state.fields(last.mask.stride));
        }
    }
    span.end(encoder);
}

/// What is known before anything comes back.
fn readings_of(step: &FlowStep) -> PoolReadings {
    PoolReadings { step: step.number, wet_cells: step.mask.wet_cells, ..default() }
}

/// After the frame's commands were submitted.
pub(super) fn map_readings(mut pools: ResMut<FlowPools>, sender: Res<ReadingsSender>) {
    for (entity, state) in &mut pools.0 {
        state.map_readings(**entity, &sender);
    }
}
