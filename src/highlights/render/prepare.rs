//! Pipeline, tables and bind groups of the highlight passes.
//!
//! What a reflection looks like depends on where it is seen from, so each view has a table of its own, with rows for
//! each organ that it sees.

use super::cull::Seen;
use super::extract::{ExtractedHighlights, ExtractedOrganHighlights, HighlightSurroundings};
use crate::highlights::profile::{
    DistanceSlices, PROFILE_REACH, PROFILE_TEXELS, RAMP_TEXELS, profile_domain, radial_ramp, write_profile,
};
use crate::highlights::{HighlightCover, Highlights};
use crate::organ::Organ;
use crate::organ::render::{
    ExtractedOrgans, GpuOrganModel, OrganGloss, OrganLayer, OrganLayouts, OrganPart, layer_shader,
};
use crate::render::{LightUniform, MAX_SCOPE_LIGHTS, SceneLights, Uploads, strongest_lights};
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    binding_types::{sampler, texture_2d, uniform_buffer},
    *,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, RenderVisibleEntities};
use bevy::utils::once;
use std::collections::BTreeMap;
use tracing::warn;

/// Steepest rim of a drop and strongest grain, as the shader has them: what can be seen at all depends on them.
const STEEPEST_FILM: f32 = 0.4;
const STRONGEST_GRAIN: f32 = 2.0;
/// Tables grow by this many rows, so that a scope which comes nearer does not ask for a new one in each frame.
const ROW_STEP: u32 = 16;
/// Radiance per lux that is too little to be seen over the skin, which throws back some hundred times as much.
const UNSEEN: f32 = 4e-4;

/// Where the table of a ring light lies, as the shader reads it (`shaders/highlights/highlights.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct HighlightRing {
    /// Binary logarithm of the nearest distance in metres.
    pub log2_nearest_m: f32,
    /// Rows per doubling of the distance.
    pub slices_per_octave: f32,
    /// Rows of the dry roughness; as many of the wet follow.
    pub slice_count: f32,
    /// The first of them.
    pub first_row: f32,
}

/// An organ's highlights in a view, as the shader reads them (`shaders/highlights/highlights.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct HighlightsUniform {
    /// The organ's ring lights, in the order of its light list.
    pub rings: [HighlightRing; MAX_SCOPE_LIGHTS],
    /// Multiplies the radiance.
    pub strength: f32,
    /// Share that is mirrored at right angles.
    pub reflectance: f32,
    /// Standard deviation of the normal on dry tissue, radians.
    pub dry_roughness: f32,
    /// The same on wet tissue.
    pub wet_roughness: f32,
    /// How far wet places stand above dry ones, metres.
    pub film_relief_m: f32,
    /// Standard deviation of the grain's tilt, radians.
    pub grain_tilt: f32,
    /// One over the size of the grain, per metre.
    pub grain_frequency_per_m: f32,
    /// Whether the organ has a gloss map.
    pub has_gloss: u32,
    /// Whether wet places shine.
    pub is_over: u32,
}

/// Names the layer.
pub(super) struct HighlightsLayer;

/// The texture that never changes, and the sampler of all.
#[derive(Resource)]
pub(super) struct HighlightRamp {
    texture: TextureView,
    sampler: Sampler,
}

pub(super) fn init_pipeline(
    mut commands: Commands,
    layouts: Res<OrganLayouts>,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let layout = BindGroupLayoutDescriptor::new(
        "highlights_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                uniform_buffer::<HighlightsUniform>(false),
                texture_2d(TextureSampleType::Float { filterable: true }),
                texture_2d(TextureSampleType::Float { filterable: true }),
                sampler(SamplerBindingType::Filtering),
                texture_2d(TextureSampleType::Float { filterable: true }),
                sampler(SamplerBindingType::Filtering),
            ),
        ),
    );
    let keep = BlendComponent { src_factor: BlendFactor::Zero, dst_factor: BlendFactor::One, ..default() };
    let add = BlendComponent { src_factor: BlendFactor::One, dst_factor: BlendFactor::One, ..default() };
    let shader = layer_shader(&assets, "highlights/highlights.wgsl");
    let blend = Some(BlendState { color: add, alpha: keep });
    commands.insert_resource(OrganLayer::<HighlightsLayer>::new("highlights", &layouts, vec![layout], shader, blend));
    let ramp = device.create_texture_with_data(
        &queue,
        &half_texture("highlight_ramp", RAMP_TEXELS as u32, RAMP_TEXELS as u32),
        TextureDataOrder::LayerMajor,
        bytemuck::cast_slice(&radial_ramp()),
    );
    let sampler = device.create_sampler(&SamplerDescriptor {
        label: Some("highlights_sampler"),
        mag_filter: FilterMode::Linear,
        min_filter: FilterMode::Linear,
        ..default()
    });
    commands.insert_resource(HighlightRamp { texture: ramp.create_view(&default()), sampler });
}

fn half_texture(label: &'static str, width: u32, height: u32) -> TextureDescriptor<'static> {
    TextureDescriptor {
        label: Some(label),
        size: Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: TextureFormat::R16Float,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    }
}

/// What a block of rows is made of: the same inputs give the same rows.
#[derive(Clone, Copy, PartialEq)]
struct RowBlock {
    ring_radius_m: f32,
    roughness_rad: f32,
    slices: DistanceSlices,
}

struct OrganInView {
    uniform: UniformBuffer<HighlightsUniform>,
    cover: HighlightCover,
    bind_group: Option<BindGroup>,
    /// The triangles that may show something.
    indices: RawBufferVec<u32>,
}

/// The highlights of a view.
#[derive(Default)]
struct HighlightView {
    table: Option<Texture>,
    /// What the table holds now.
    rows: Vec<RowBlock>,
    organs: BTreeMap<MainEntity, OrganInView>,
}

/// Tables and bind groups by view (an entity of the render world), kept between frames.
#[derive(Resource, Default)]
pub(super) struct HighlightViews(BTreeMap<Entity, HighlightView>);

impl HighlightViews {
    /// What is drawn of an organ in a view, in one of the two passes.
    pub fn part(&self, view: Entity, organ: MainEntity, cover: HighlightCover) -> Option<OrganPart<'_>> {
        let organ = self.0.get(&view)?.organs.get(&organ).filter(|organ| organ.cover == cover)?;
        let count = organ.indices.len() as u32;
        let indices = Some((organ.indices.buffer()?, count));
        (count > 0).then_some(OrganPart { group: organ.bind_group.as_ref()?, indices })
    }
}

/// Whether a light is a view's own: it sits around the eye.
fn is_at_eye(light: &LightUniform, eye_world_m: Vec3) -> bool {
    light.kind == LightUniform::RING && light.position_world_m.distance(eye_world_m) < 1e-3
}

/// Lays the rows of an organ out behind those that are there.
fn lay_out(
    rows: &mut Vec<RowBlock>,
    row_count: &mut u32,
    organ: &ExtractedOrganHighlights,
    lights: &[LightUniform],
    eye_world_m: Vec3,
) -> [HighlightRing; MAX_SCOPE_LIGHTS] {
    let mut rings = [HighlightRing::default(); MAX_SCOPE_LIGHTS];
    let rings_of_organ = lights.iter().take_while(|light| light.kind == LightUniform::RING);
    for (light, ring) in rings_of_organ.zip(&mut rings) {
        let (mut nearest_m, farthest_m) = organ.distances_m(light.position_world_m);
        if !is_at_eye(light, eye_world_m) {
            // The cosine between eye and halfway vector shortens the distance of a light that is elsewhere.
            nearest_m *= 0.5;
        }
        let slices = DistanceSlices::covering(nearest_m, farthest_m);
        *ring = HighlightRing {
            log2_nearest_m: slices.nearest_m.log2(),
            slices_per_octave: slices.per_octave(),
            slice_count: slices.count as f32,
            first_row: *row_count as f32,
        };
        for roughness_rad in [organ.highlights.dry_roughness, organ.highlights.wet_roughness] {
            rows.push(RowBlock { ring_radius_m: light.ring_radius_m, roughness_rad, slices });
            *row_count += slices.count;
        }
    }
    rings
}

/// Tilt beyond which a roughness shows nothing of a point-shaped light, radians.
fn reach_rad(roughness_rad: f32, brightness: f32) -> f32 {
    let peak = brightness / (4.0 * std::f32::consts::TAU * roughness_rad * roughness_rad);
    roughness_rad * (2.0 * (peak / UNSEEN).max(1.0).ln()).sqrt().min(PROFILE_REACH)
}

/// Tilt beyond which nothing of a point-shaped light is seen on an organ, radians.
fn reach_of_organ_rad(highlights: &Highlights, has_gloss: bool, is_lit_from_aside: bool) -> f32 {
    let shows_drops = has_gloss && highlights.cover == HighlightCover::OverDrops;
    let film = if highlights.film_relief_m > 0.0 { STEEPEST_FILM } else { 0.0 };
    // Light from aside is mirrored more strongly.
    let reflectance = highlights.reflectance + if is_lit_from_aside { 0.2 } else { 0.0 };
    let brightness = highlights.strength * reflectance;
    let dry = reach_rad(highlights.dry_roughness, brightness) + STRONGEST_GRAIN * highlights.grain_tilt;
    let wet = if shows_drops { reach_rad(highlights.wet_roughness, brightness) + film } else { 0.0 };
    dry.max(wet)
}

fn uniform(highlights: &Highlights, has_gloss: bool, rings: [HighlightRing; MAX_SCOPE_LIGHTS]) -> HighlightsUniform {
    HighlightsUniform {
        rings,
        strength: highlights.strength,
        reflectance: highlights.reflectance,
        dry_roughness: highlights.dry_roughness,
        wet_roughness: highlights.wet_roughness,
        film_relief_m: highlights.film_relief_m,
        grain_tilt: highlights.grain_tilt,
        grain_frequency_per_m: 1.0 / highlights.grain_size_m,
        has_gloss: has_gloss.into(),
        is_over: (highlights.cover == HighlightCover::OverDrops).into(),
    }
}

/// Computes and uploads the rows of a view.
fn write_table(table: &Texture, rows: &[RowBlock], row_count: u32, queue: &RenderQueue) -> u64 {
    let mut texels = Vec::with_capacity(row_count as usize * PROFILE_TEXELS);
    let mut row = [0; PROFILE_TEXELS];
    for block in rows {
        let domain = profile_domain(block.ring_radius_m, block.slices.farthest_m, block.roughness_rad);
        for slice in 0..block.slices.count {
            let distance_m = block.slices.distance_m(slice);
            write_profile(&mut row, domain, block.ring_radius_m, distance_m, block.roughness_rad);
            texels.extend_from_slice(&row);
        }
    }
    let bytes: &[u8] = bytemuck::cast_slice(&texels);
    let width = PROFILE_TEXELS as u32;
    queue.write_texture(
        table.as_image_copy(),
        bytes,
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(2 * width), rows_per_image: None },
        Extent3d { width, height: row_count, depth_or_array_layers: 1 },
    );
    bytes.len() as u64
}

pub(super) fn prepare_views(
    mut prepared: ResMut<HighlightViews>,
    extracted: Res<ExtractedHighlights>,
    surroundings: Res<HighlightSurroundings>,
    organs: Res<ExtractedOrgans>,
    models: Res<RenderAssets<GpuOrganModel>>,
    scene: Option<Res<SceneLights>>,
    gloss: Res<OrganGloss>,
    layer: Res<OrganLayer<HighlightsLayer>>,
    ramp: Res<HighlightRamp>,
    views: Query<(Entity, &ExtractedView, &RenderVisibleEntities), With<ExtractedCamera>>,
    uploaded: Option<Res<Uploads>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    prepared.0.retain(|entity, _| views.contains(*entity));
    let Some(scene) = scene else { return };
    let layout = cache.get_bind_group_layout(&layer.own_groups[0]);
    for (view_entity, view, visible) in &views {
        let visible = visible.get::<Organ>().map(|class| class.entities_cpu_culling.as_slice()).unwrap_or_default();
        let eye_world_m = view.world_from_view.translation();
        let is_parallel = view.clip_from_view.w_axis.w == 1.0;
        // Organs by entity, so that the rows lie the same way in every frame.
        let mut seen: Vec<_> = visible
            .iter()
            .filter_map(|(_, entity)| {
                let shining = extracted.organs.binary_search_by_key(entity, |organ| organ.entity).ok()?;
                let organ = organs.organs.binary_search_by_key(entity, |organ| organ.entity).ok()?;
                Some((&extracted.organs[shining], &organs.organs[organ]))
            })
            .collect();
        seen.sort_by_key(|(organ, _)| organ.entity);
        if seen.is_empty() {
            prepared.0.remove(&view_entity);
            continue;
        }
        let prepared = prepared.0.entry(view_entity).or_default();
        prepared.organs.retain(|entity, _| seen.binary_search_by_key(entity, |(organ, _)| organ.entity).is_ok());
        let (mut rows, mut row_count) = (Vec::new(), 0);
        for (shining, organ) in &seen {
            let lights = strongest_lights(&scene, organ.centre_world_m, &organ.layers);
            let lights = &lights.lights[..lights.count as usize];
            let laid_out = (rows.len(), row_count);
            let rings = lay_out(&mut rows, &mut row_count, shining, lights, eye_world_m);
            if row_count > device.limits().max_texture_dimension_2d {
                once!(warn!("more organs with highlights in one view than a table has room for: the rest have none"));
                rows.truncate(laid_out.0);
                row_count = laid_out.1;
                prepared.organs.remove(&shining.entity);
                continue;
            }
            let is_aside = |light: &LightUniform| !is_at_eye(light, eye_world_m);
            let has_gloss = gloss.maps.contains_key(&shining.entity);
            let new = uniform(&shining.highlights, has_gloss, rings);
            let in_view = prepared.organs.entry(shining.entity).or_insert_with(|| OrganInView {
                uniform: UniformBuffer::default(),
                cover: shining.highlights.cover,
                bind_group: None,
                indices: {
                    let mut indices = RawBufferVec::new(BufferUsages::INDEX);
                    indices.set_label(Some("highlight_indices"));
                    indices
                },
            });
            let seen = Seen {
                world_from_organ: Affine3A::from_mat4(organ.world_from_organ),
                scale: shining.surroundings_scale,
                lights,
                reach_rad: reach_of_organ_rad(&shining.highlights, has_gloss, lights.iter().any(is_aside)),
                eye_world_m,
                to_parallel_eye: is_parallel.then(|| view.world_from_view.back().into()),
            };
            let around = surroundings.0.get(&shining.entity);
            if let Some((model, (_, around))) = models.get(organ.model).zip(around) {
                let triangles = seen.triangles(&model.model, around);
                if in_view.indices.values() != &triangles {
                    *in_view.indices.values_mut() = triangles;
                    in_view.indices.write_buffer(&device, &queue);
                    if let Some(uploaded) = &uploaded {
                        uploaded.add(size_of_val(in_view.indices.values().as_slice()) as u64);
                    }
                }
            }
            in_view.cover = shining.highlights.cover;
            if in_view.uniform.buffer().is_none() || *in_view.uniform.get() != new {
                in_view.uniform.set(new);
                in_view.uniform.write_buffer(&device, &queue);
                if let Some(uploaded) = &uploaded {
                    uploaded.add(HighlightsUniform::min_size().get());
                }
            }
        }
        let is_small = prepared.table.as_ref().is_none_or(|table| table.height() < row_count);
        if is_small {
            let height = row_count.max(1).next_multiple_of(ROW_STEP);
            let descriptor = half_texture("highlight_profiles", PROFILE_TEXELS as u32, height);
            prepared.table = Some(device.create_texture(&descriptor));
        }
        let Some(table) = &prepared.table else { continue };
        // A scope that stands still sends nothing.
        if row_count > 0 && (is_small || prepared.rows != rows) {
            let bytes = write_table(table, &rows, row_count, &queue);
            if let Some(uploaded) = &uploaded {
                uploaded.add_rectangles(1, bytes);
            }
        }
        prepared.rows = rows;
        let profiles = table.create_view(&default());
        for (entity, organ) in &mut prepared.organs {
            organ.bind_group = None;
            let Some(uniform) = organ.uniform.binding() else { continue };
            let entries = BindGroupEntries::sequential((
                uniform,
                &profiles,
                &ramp.texture,
                &ramp.sampler,
                gloss.of(*entity),
                &gloss.sampler,
            ));
            organ.bind_group = Some(device.create_bind_group("highlights", &layout, &entries));
        }
    }
}
