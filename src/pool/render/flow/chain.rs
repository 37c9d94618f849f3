//! The kernels of a step in their order; `FluidSolver::step_with` does the same.

use super::command::FlowStep;
use super::kernels::{Kernel, ReadyKernels};
use super::state::{FlowState, MaskBuffers};
use crate::pool::Advection;
use bevy::render::render_resource::*;
use bevy::render::renderer::RenderDevice;

/// Workgroups that `sums.wgsl` gathers with.
const GATHERING: u32 = 16;

/// A compute pass on the fields of a pool.
pub(super) struct Chain<'a, 'e> {
    device: &'a RenderDevice,
    kernels: &'a ReadyKernels<'a>,
    pass: ComputePass<'e>,
    deep: u32,
    tiles: u32,
}

impl<'a, 'e> Chain<'a, 'e> {
    /// Begins a pass for the step whose uniform lies at an offset. Nothing without what every step uploads.
    pub fn begin(
        device: &'a RenderDevice,
        kernels: &'a ReadyKernels<'a>,
        encoder: &'e mut CommandEncoder,
        state: &FlowState,
        uniform: u32,
    ) -> Option<Self> {
        let (mask, uniforms) = (state.mask.as_ref()?, state.uniforms.binding()?);
        let entries =
            BindGroupEntries::sequential((uniforms, mask.tiles.as_entire_binding(), mask.words.as_entire_binding()));
        let common = device.create_bind_group("pool_flow", &kernels.common, &entries);
        let mut pass =
            encoder.begin_compute_pass(&ComputePassDescriptor { label: Some("pool_flow"), timestamp_writes: None });
        pass.set_bind_group(0, &common, &[uniform]);
        Some(Self { device, kernels, pass, deep: mask.mask.deep_tiles, tiles: mask.mask.tiles.len() as u32 })
    }

    fn group(&self, kernel: Kernel, resources: &[BindingResource]) -> BindGroup {
        let entries = ReadyKernels::entries(kernel, resources);
        self.device.create_bind_group("pool_kernel", &self.kernels.layout(kernel), &entries)
    }

    fn dispatch(&mut self, kernel: Kernel, group: &BindGroup, x: u32, y: u32) {
        if x > 0 {
            self.pass.set_pipeline(self.kernels.get(kernel).0);
            self.pass.set_bind_group(1, group, &[]);
            self.pass.dispatch_workgroups(x, y, 1);
        }
    }

    fn run_on(&mut self, kernel: Kernel, count: u32, resources: &[BindingResource]) {
        let group = self.group(kernel, resources);
        self.dispatch(kernel, &group, count, 1);
    }

    /// On all tiles with fluid.
    fn run(&mut self, kernel: Kernel, resources: &[BindingResource]) {
        let group = self.group(kernel, resources);
        let (tiles, deep_tiles) = (self.tiles, self.deep);
        let Some(deep) = self.kernels.get(kernel).1 else { return self.dispatch(kernel, &group, tiles, 1) };
        if deep_tiles > 0 {
            self.pass.set_pipeline(deep);
            self.pass.set_bind_group(1, &group, &[]);
            self.pass.dispatch_workgroups(deep_tiles, 1, 1);
        }
        self.dispatch(kernel, &group, tiles - deep_tiles, 1);
    }

    /// After a new mask.
    pub fn settle(&mut self, state: &FlowState, mask: &MaskBuffers) {
        let [velocity, dissolved] = [state.pair(state.velocity), state.pair(state.dissolved)];
        let surface = BindingResource::TextureView(&state.surface_view);
        let group = self.group(Kernel::Settle, &[velocity, dissolved, state.scalar(state.pressure), surface]);
        self.dispatch(Kernel::Settle, &group, mask.mask.tiles_along.x, mask.mask.tiles_along.y);
    }

    /// A step; afterwards the state says which fields are the present ones.
    pub fn step(&mut self, state: &mut FlowState, step: &FlowStep) {
        state.velocity = self.carry_velocity(state, step);
        if !step.pushing.sources.is_empty() {
            self.act_on_velocity(state, step.pushing.tiles.len() as u32);
        }
        state.pressure = self.project(state, step.settings.pressure_iterations.clamp(1, 500));
        if !step.acting.sources.is_empty() {
            self.act_on_all(state, step.acting.tiles.len() as u32);
        }
        state.dissolved = self.carry_dissolved(state, step);
        let [amounts, gathered] = [&state.amounts, &state.gathered].map(|buffer| buffer.as_entire_binding());
        self.run_on(Kernel::Gather, GATHERING, &[amounts, gathered.clone()]);
        self.run_on(Kernel::FinishScale, 1, &[gathered, state.scale.as_entire_binding()]);
    }

    /// Returns the place of the carried velocity.
    fn carry_velocity(&mut self, state: &FlowState, step: &FlowStep) -> usize {
        let (old, room) = (state.velocity, state.room(state.velocity, state.dissolved));
        let next = room[0];
        let velocity = || state.pair(old);
        if step.settings.advection == Advection::MacCormack {
            let [reflected, once] = [room[1], room[2]];
            let Some(mask) = &state.mask else { return old };
            let sides = mask.sides.as_entire_binding();
            self.run(Kernel::Reflect, &[sides, state.scalar(state.pressure), velocity(), state.pair(reflected)]);
            self.run(Kernel::CarryVelocity, &[velocity(), state.pair(reflected), state.pair(once)]);
            let resources = [velocity(), state.pair(reflected), state.pair(next), state.pair(once)];
            self.run(Kernel::CorrectVelocity, &resources);
        } else {
            self.run(Kernel::CarryVelocity, &[velocity(), velocity(), state.pair(next)]);
        }
        match step.has_viscosity() {
            true => self.blur(Kernel::BlurVelocity, state, step, next, [old, room[1]]),
            false => next,
        }
    }

    /// Blurs a field with rooms for its rounds; returns the place of the result.
    fn blur(&mut self, kernel: Kernel, state: &FlowState, step: &FlowStep, field: usize, rooms: [usize; 2]) -> usize {
        let mut now = field;
        for round in 0..step.settings.diffusion_iterations.clamp(1, 100) as usize {
            let next = rooms[round % 2];
            self.run(kernel, &[state.pair(field), state.pair(now), state.pair(next)]);
            now = next;
        }
        now
    }

    fn act_on_velocity(&mut self, state: &FlowState, tiles: u32) {
        let (Some(sources), Some(reached), Some(noise)) =
            (state.sources.binding(), state.reached.binding(), &state.noise_texels)
        else {
            return;
        };
        let noise = noise.as_entire_binding();
        self.run_on(Kernel::Push, tiles, &[sources, noise, state.pair(state.velocity), reached]);
    }

    fn act_on_all(&mut self, state: &FlowState, tiles: u32) {
        let (Some(sources), Some(reached)) = (state.sources.binding(), state.reached.binding()) else { return };
        let [velocity, dissolved] = [state.pair(state.velocity), state.pair(state.dissolved)];
        self.run_on(Kernel::Act, tiles, &[sources, velocity, dissolved, state.scale.as_entire_binding(), reached]);
    }

    /// Returns the place of the new pressure.
    fn project(&mut self, state: &FlowState, rounds: u32) -> usize {
        let Some(mask) = &state.mask else { return state.pressure };
        let sides = || mask.sides.as_entire_binding();
        let [own, other, divergence] = [0, 1, 2].map(|k| (state.pressure + k) % 3);
        let velocity = || state.pair(state.velocity);
        let first = [sides(), state.scalar(own), state.scalar(other), velocity(), state.scalar(divergence)];
        self.run(Kernel::FirstRound, &first);
        let round = |from, into| [sides(), state.scalar(from), state.scalar(into), state.scalar(divergence)];
        let groups = [(other, own), (own, other)].map(|(from, into)| self.group(Kernel::Round, &round(from, into)));
        for round in 1..rounds as usize {
            self.dispatch(Kernel::Round, &groups[(round - 1) % 2], self.tiles, 1);
        }
        let [last, before] = if rounds % 2 == 1 { [other, own] } else { [own, other] };
        // The mean goes where the divergence was, which is of no more use.
        let mean = state.scalar(divergence);
        self.run(Kernel::Subtract, &[sides(), state.scalar(last), mean, velocity(), state.scalar(before)]);
        divergence
    }

    /// Returns the place of what was carried.
    fn carry_dissolved(&mut self, state: &FlowState, step: &FlowStep) -> usize {
        let (old, room) = (state.dissolved, state.room(state.velocity, state.dissolved));
        let next = room[0];
        let (velocity, source) = (|| state.pair(state.velocity), || state.pair(state.dissolved));
        let (scale, amounts) = (|| state.scale.as_entire_binding(), || state.amounts.as_entire_binding());
        if step.settings.advection == Advection::MacCormack {
            let once = || state.pair(room[1]);
            self.run(Kernel::CarryDissolved, &[velocity(), source(), once(), scale(), amounts()]);
            let resources = [velocity(), source(), state.pair(next), once(), scale(), amounts()];
            self.run(Kernel::CorrectDissolved, &resources);
        } else {
            self.run(Kernel::CarryDissolved, &[velocity(), source(), state.pair(next), scale(), amounts()]);
        }
        if !step.has_diffusion() {
            return next;
        }
        let blurred = self.blur(Kernel::BlurDissolved, state, step, next, [old, room[1]]);
        self.run(Kernel::CountAgain, &[state.pair(blurred), amounts()]);
        blurred
    }

    /// The texture that others see, and readings.
    pub fn publish(&mut self, state: &FlowState) {
        let resources = [
            state.pair(state.velocity),
            state.pair(state.dissolved),
            state.scalar(state.pressure),
            state.scale.as_entire_binding(),
            state.amounts.as_entire_binding(),
            BindingResource::TextureView(&state.surface_view),
        ];
        self.run(Kernel::Publish, &resources);
        let [amounts, gathered] = [&state.amounts, &state.gathered].map(|buffer| buffer.as_entire_binding());
        self.run_on(Kernel::GatherReadings, GATHERING, &[amounts, gathered.clone()]);
        self.run_on(Kernel::FinishReadings, 1, &[gathered, state.readings.as_entire_binding()]);
    }
}
