//! What a pool has on the GPU.

use super::command::FlowStep;
use super::kernels::SURFACE_FORMAT;
use super::mask::PackedMask;
use super::pass::FlowFields;
use super::readings::{PoolReadings, ReadingsSender};
use super::uniform::{FlowSource, FlowUniform};
use crate::pool::StirNoise;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Partial sums that `sums.wgsl` gathers.
const GATHERED: u64 = 1024;
/// Invocations of a kernel per tile that write amounts.
const AMOUNTS_PER_TILE: u64 = 128;

/// Readings on their way back. There are several, so that none is waited for.
struct ReadBack {
    buffer: Buffer,
    is_free: Arc<AtomicBool>,
    /// What was copied this frame, and will be mapped after its commands were submitted.
    copied: Option<PoolReadings>,
}

/// Buffers that depend on the mask.
pub(super) struct MaskBuffers {
    pub mask: Arc<PackedMask>,
    pub words: Buffer,
    pub sides: Buffer,
    pub tiles: Buffer,
}

pub(super) struct FlowState {
    pub size: UVec2,
    /// Numbers of a field.
    places: u64,
    /// None before the first step.
    pub mask: Option<MaskBuffers>,
    /// Fields of two numbers per place, of which `velocity` and `dissolved` name the present ones; the others are room.
    pairs: Vec<Buffer>,
    pub velocity: usize,
    pub dissolved: usize,
    /// Fields of one number: the pressure, and room for its next rounds and the divergence.
    pub scalars: [Buffer; 3],
    /// The pressure's place among them.
    pub pressure: usize,
    pub amounts: Buffer,
    pub gathered: Buffer,
    /// What the last step left to do to what is dissolved, as factors.
    pub scale: Buffer,
    pub readings: Buffer,
    noise: Option<StirNoise>,
    pub noise_texels: Option<Buffer>,
    pub surface: Texture,
    pub surface_view: TextureView,
    pub uniforms: DynamicUniformBuffer<FlowUniform>,
    pub sources: BufferVec<FlowSource>,
    pub reached: RawBufferVec<u32>,
    read_back: [ReadBack; 3],
}

fn storage(device: &RenderDevice, label: &str, bytes: u64) -> Buffer {
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
    device.create_buffer(&BufferDescriptor { label: Some(label), size: bytes, usage, mapped_at_creation: false })
}

fn filled(device: &RenderDevice, label: &str, contents: &[u8]) -> Buffer {
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
    device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), contents, usage })
}

impl FlowState {
    /// Fluid at rest in a grid like a mask's.
    pub fn new(device: &RenderDevice, mask: &PackedMask) -> Self {
        let places = mask.places();
        let tiles = u64::from(mask.tiles_along.element_product());
        let surface = device.create_texture(&TextureDescriptor {
            label: Some("pool_surface"),
            size: Extent3d { width: mask.size.x, height: mask.size.y, ..default() },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: SURFACE_FORMAT,
            usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let read_back = || ReadBack {
            buffer: device.create_buffer(&BufferDescriptor {
                label: Some("pool_read_back"),
                size: 16,
                usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
                mapped_at_creation: false,
            }),
            is_free: Arc::new(AtomicBool::new(true)),
            copied: None,
        };
        Self {
            size: mask.size,
            places,
            mask: None,
            pairs: (0..2).map(|_| storage(device, "pool_pairs", places * 8)).collect(),
            velocity: 0,
            dissolved: 1,
            scalars: [(); 3].map(|()| storage(device, "pool_scalars", places * 4)),
            pressure: 0,
            amounts: storage(device, "pool_amounts", tiles * AMOUNTS_PER_TILE * 16),
            gathered: storage(device, "pool_gathered", GATHERED * 16),
            scale: filled(device, "pool_scale", bytemuck::bytes_of(&[1.0_f32; 2])),
            readings: storage(device, "pool_readings", 16),
            noise: None,
            noise_texels: None,
            surface_view: surface.create_view(&default()),
            surface,
            uniforms: DynamicUniformBuffer::default(),
            sources: BufferVec::new(BufferUsages::STORAGE),
            reached: RawBufferVec::new(BufferUsages::STORAGE),
            read_back: [(); 3].map(|()| read_back()),
        }
    }

    /// The present fields.
    pub fn fields(&self, stride: u32) -> FlowFields {
        FlowFields {
            velocity: self.pairs[self.velocity].clone(),
            dissolved: self.pairs[self.dissolved].clone(),
            scale: self.scale.clone(),
            pressure: self.scalars[self.pressure].clone(),
            stride,
        }
    }

    pub fn pair(&self, place: usize) -> BindingResource<'_> {
        self.pairs[place].as_entire_binding()
    }

    pub fn scalar(&self, place: usize) -> BindingResource<'_> {
        self.scalars[place].as_entire_binding()
    }

    /// Fields of two numbers that hold nothing of use, at least so many.
    pub fn ensure_room(&mut self, device: &RenderDevice, count: usize) {
        while self.pairs.len() < count + 2 {
            self.pairs.push(storage(device, "pool_pairs", self.places * 8));
        }
    }

    /// Those of them that are neither of two.
    pub fn room(&self, velocity: usize, dissolved: usize) -> Vec<usize> {
        (0..self.pairs.len()).filter(|place| *place != velocity && *place != dissolved).collect()
    }

    /// Whether a step has another mask than the last one; then the old one's walls must be settled.
    pub fn set_mask(&mut self, device: &RenderDevice, step: &FlowStep) -> bool {
        if self.mask.as_ref().is_some_and(|own| Arc::ptr_eq(&own.mask, &step.mask)) {
            return false;
        }
        let mask = &step.mask;
        // No buffer may be empty.
        let tiles = if mask.tiles.is_empty() { &[0][..] } else { &mask.tiles };
        self.mask = Some(MaskBuffers {
            words: filled(device, "pool_mask", bytemuck::cast_slice(&mask.words)),
            sides: filled(device, "pool_sides", bytemuck::cast_slice(&mask.sides)),
            tiles: filled(device, "pool_tiles", bytemuck::cast_slice(tiles)),
            mask: mask.clone(),
        });
        true
    }

    /// What is not written in a step must be 0.
    pub fn clear_room(&self, encoder: &mut CommandEncoder) {
        for place in self.room(self.velocity, self.dissolved) {
            encoder.clear_buffer(&self.pairs[place], 0, None);
        }
        for (place, buffer) in self.scalars.iter().enumerate() {
            if place != self.pressure {
                encoder.clear_buffer(buffer, 0, None);
            }
        }
    }

    pub fn set_noise(&mut self, device: &RenderDevice, noise: &StirNoise) {
        if self.noise.as_ref() != Some(noise) {
            self.noise_texels = Some(filled(device, "pool_noise", bytemuck::cast_slice(noise.texels())));
            self.noise = Some(noise.clone());
        }
    }

    /// Uploads what steps need; returns where each one's uniform lies.
    pub fn upload<'a>(
        &mut self,
        device: &RenderDevice,
        queue: &RenderQueue,
        steps: impl Iterator<Item = &'a FlowStep>,
    ) -> Vec<u32> {
        self.uniforms.clear();
        self.sources.clear();
        self.reached.clear();
        // No buffer may be empty.
        self.sources.push(FlowSource::default());
        self.reached.push(0);
        let offsets = steps
            .map(|step| {
                let (mut first_source, mut first_tile) = ([0; 2], [0; 2]);
                for (kind, acting) in [&step.pushing, &step.acting].into_iter().enumerate() {
                    (first_source[kind], first_tile[kind]) = (self.sources.len() as u32, self.reached.len() as u32);
                    for source in &acting.sources {
                        self.sources.push(*source);
                    }
                    self.reached.extend(acting.tiles.iter().copied());
                }
                self.uniforms.push(&FlowUniform::new(step, first_source, first_tile))
            })
            .collect();
        self.uniforms.write_buffer(device, queue);
        self.sources.write_buffer(device, queue);
        self.reached.write_buffer(device, queue);
        offsets
    }

    /// Copies the readings where they can be mapped; not if all such places are still on their way.
    pub fn copy_readings(&mut self, encoder: &mut CommandEncoder, readings: PoolReadings) {
        let free = self.read_back.iter_mut().find(|slot| slot.is_free.load(Ordering::Acquire) && slot.copied.is_none());
        if let Some(slot) = free {
            encoder.copy_buffer_to_buffer(&self.readings, 0, &slot.buffer, 0, 16);
            slot.copied = Some(readings);
        }
    }

    /// Asks for what was copied in this frame, whose commands were submitted.
    pub fn map_readings(&mut self, entity: Entity, sender: &ReadingsSender) {
        for slot in &mut self.read_back {
            let Some(mut readings) = slot.copied.take() else { continue };
            slot.is_free.store(false, Ordering::Release);
            let (buffer, is_free, sender) = (slot.buffer.clone(), slot.is_free.clone(), sender.clone());
            slot.buffer.slice(..).map_async(MapMode::Read, move |result| {
                if result.is_ok() {
                    let bytes = buffer.slice(..).get_mapped_range();
                    let numbers: [f32; 4] = bytemuck::pod_read_unaligned(&bytes);
                    drop(bytes);
                    buffer.unmap();
                    let [blood, dust, hidden, fastest_m_s] = numbers;
                    let hidden_share = hidden / readings.wet_cells.max(1) as f32;
                    readings = PoolReadings { blood, dust, hidden_share, fastest_m_s, ..readings };
                    // Nobody listens any more when the app ends.
                    let _ = sender.0.send((entity, readings));
                }
                is_free.store(true, Ordering::Release);
            });
        }
    }
}
