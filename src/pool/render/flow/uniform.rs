//! What the kernels are told about a step; `shaders/pool/flow.wgsl` and `act.wgsl` say what the members mean.

use super::command::FlowStep;
use crate::pool::FluidSource;
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;

/// A step, as the kernels read it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct FlowUniform {
    /// Columns and rows.
    pub size: UVec2,
    /// Numbers from row to row.
    pub stride: u32,
    /// Tiles without walls within reach.
    pub deep_tiles: u32,
    /// All tiles with fluid.
    pub tiles: u32,
    /// Sources that push and stir.
    pub first_pushing: u32,
    /// How many.
    pub pushing: u32,
    /// First tile of those that they reach.
    pub push_tile: u32,
    /// Sources with flow, and those that dissolve or clear something.
    pub first_acting: u32,
    /// How many.
    pub acting: u32,
    /// First tile of those that they reach.
    pub act_tile: u32,
    /// Shares of blood and dust that are kept.
    pub keep: Vec2,
    /// Side of a cell, metres.
    pub cell_m: f32,
    /// Cells that a velocity of 1 goes in a step.
    pub cells_per_velocity: f32,
    /// Squares of the length over which viscosity blurs, square cells.
    pub viscosity: f32,
    /// The same for diffusion.
    pub diffusion: f32,
    /// Texels along a side of the noise.
    pub noise_side: u32,
    /// Length after which the noise repeats, metres.
    pub noise_period_m: f32,
    /// Height of the surface, millimetres, for a pressure of 1.
    pub mm_per_pressure: f32,
    /// Share of blood that hides what is below.
    pub hidden_from: f32,
    /// How much the same share of dust hides.
    pub dust_hides: f32,
}

impl FlowUniform {
    /// Of a step whose sources and lists begin at places in the frame's buffers: pushing, acting.
    pub(super) fn new(step: &FlowStep, first_source: [u32; 2], first_tile: [u32; 2]) -> Self {
        let blur = |m2_s: f32| m2_s * step.step_s / (step.cell_m * step.cell_m);
        Self {
            size: step.mask.size,
            stride: step.mask.stride,
            deep_tiles: step.mask.deep_tiles,
            tiles: step.mask.tiles.len() as u32,
            first_pushing: first_source[0],
            pushing: step.pushing.sources.len() as u32,
            push_tile: first_tile[0],
            first_acting: first_source[1],
            acting: step.acting.sources.len() as u32,
            act_tile: first_tile[1],
            keep: step.keep.into(),
            cell_m: step.cell_m,
            cells_per_velocity: step.step_s / step.cell_m,
            viscosity: if step.has_viscosity() { blur(step.settings.viscosity_m2_s) } else { 0.0 },
            diffusion: if step.has_diffusion() { blur(step.settings.diffusion_m2_s) } else { 0.0 },
            noise_side: step.noise.side(),
            noise_period_m: step.noise.period_m(),
            mm_per_pressure: step.mm_per_pressure,
            hidden_from: step.hiding.from,
            dust_hides: step.hiding.dust,
        }
    }
}

/// A source, as the kernels read it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct FlowSource {
    /// Its middle in the pool's plane, metres.
    pub place_m: Vec2,
    /// Velocity that it adds in its middle.
    pub push_m_s: Vec2,
    /// Added to places before the noise is looked up.
    pub stir_offset_m: Vec2,
    /// Blood and dust where its weight is 1, as shares of a cell.
    pub share: Vec2,
    /// Standard deviation of its weights.
    pub radius_m: f32,
    /// Velocity where the noise is 1.
    pub stir_m_s: f32,
    /// What flows in or out.
    pub flow_m2_s: f32,
    /// Share of what is dissolved that it takes in its middle.
    pub clear: f32,
}

impl FlowSource {
    /// With the sum of its weights over the wet cells; it dissolves and clears nothing where there are none.
    pub(super) fn new(source: &FluidSource, weight_sum: f32) -> Self {
        let is_felt = weight_sum > 0.0;
        Self {
            place_m: source.place_m,
            push_m_s: source.push_m_s,
            stir_offset_m: source.stir_offset_m,
            share: if is_felt { Vec2::from(source.amount) / weight_sum } else { Vec2::ZERO },
            radius_m: source.radius_m,
            stir_m_s: source.stir_m_s,
            flow_m2_s: source.flow_m2_s,
            clear: if is_felt { source.clear } else { 0.0 },
        }
    }
}
