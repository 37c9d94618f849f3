//! What each view keeps of each volume, and what of it must be drawn anew.

use super::aligned::{AlignedBodies, AlignedKey, AlignedPipelines, AlignedView, HIDDEN_FORMAT};
use super::extract::{ExtractedVolume, ExtractedVolumes};
use super::patches::Patches;
use super::pipelines::{VolumePipelines, WalkVariant};
use super::scene::SceneChanges;
use super::uniform::{Rays, VolumeUniform, depth_projection, near_m};
use crate::organ::render::{OrganPipelineKey, OrganSides};
use crate::render::{OrganLights, SceneLights, Uploads, strongest_lights, viewport_of};
use crate::view::ScopeMaskUniform;
use crate::volume::{CtVolume, SmoothedNormals, VolumeLook, VolumeMethod};
use bevy::camera::MainPassResolutionOverride;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::math::DMat4;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, RenderVisibleEntities};
use std::collections::BTreeMap;

/// Formats of the buffers of a volume in a view.
pub(super) const COLOUR_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
/// Unit normal in the world and relative depth.
pub(super) const RELIEF_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
/// Mean depth and depth of the end of the ray, metres.
pub(super) const DEPTH_FORMAT: TextureFormat = TextureFormat::Rg32Float;

/// Depth up to which rays pass over nothing, metres.
pub(super) const START_FORMAT: TextureFormat = TextureFormat::R32Float;
/// Pixels along the side of the squares whose rays have one such depth. Twin in `shaders/volume/walk.wgsl`.
pub(super) const SQUARE_PX: u32 = 8;

/// Sums over blended depths: in single precision where the adapter can blend it.
pub(super) fn depth_sum_format(device: &RenderDevice) -> TextureFormat {
    if device.features().contains(WgpuFeatures::FLOAT32_BLENDABLE) {
        TextureFormat::R32Float
    } else {
        TextureFormat::R16Float
    }
}

/// Everything that the walk through a volume depends on, but for what was cut and where the scene changed.
#[derive(Clone, PartialEq)]
struct WalkKey {
    clip_from_view: Mat4,
    world_from_view: Mat4,
    world_from_voxel: Mat4,
    viewport: URect,
    method: VolumeMethod,
    variant: WalkVariant,
    step_voxels: f32,
    clip_planes: Vec<Vec4>,
    /// State of the lattice that deforms it.
    lattice: Option<u64>,
    mask: Option<ScopeMaskUniform>,
}

/// Everything that shading depends on beyond that.
#[derive(PartialEq)]
struct ShadeKey {
    lights: OrganLights,
    exposure: f32,
    look: VolumeLook,
}

/// The buffers of a volume in a view.
pub(super) struct VolumeView {
    pub buffers: Buffers,
    walk_key: Option<WalkKey>,
    shade_key: Option<ShadeKey>,
    /// Offset of its [`VolumeUniform`].
    pub offset: u32,
    /// Slices or rays, and which kind of them.
    pub method: VolumeMethod,
    pub variant: WalkVariant,
    pub viewport: URect,
    /// Passes of smoothing.
    pub passes: u32,
    /// Where the volume can be seen, pixels of the viewport.
    pub seen: URect,
    /// Pixels to walk again; `is_all` if the buffers are cleared first.
    pub walk: Patches,
    pub is_all: bool,
    /// Pixels to shade again.
    pub shade: URect,
    /// Corners of the slices: position in the world, and number of the slice.
    pub slices: Option<(Buffer, u32)>,
    /// Slices that are aligned with a lattice, and their pipeline.
    pub aligned: Option<(AlignedKey, Option<AlignedView>)>,
    pub depth_m: f32,
}

/// Textures of a volume in a view.
pub(super) struct Buffers {
    size: UVec2,
    pub colour: TextureView,
    pub relief: TextureView,
    pub ping: TextureView,
    pub pong: TextureView,
    pub smoothed: TextureView,
    pub depth: TextureView,
    pub lit: TextureView,
    /// Depths where rays start; rays only.
    pub starts: Option<TextureView>,
    /// Sums of gradients and depths; slices only.
    pub sums: Option<(TextureView, TextureView)>,
    /// Depths before which aligned slices are drawn.
    pub hidden: Option<TextureView>,
}

impl Buffers {
    fn new(device: &RenderDevice, size: UVec2, method: VolumeMethod) -> Self {
        let sized = |size: UVec2, format| {
            device
                .create_texture(&TextureDescriptor {
                    label: Some("volume_view"),
                    size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: TextureDimension::D2,
                    format,
                    usage: TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT,
                    view_formats: &[],
                })
                .create_view(&default())
        };
        let texture = |format| sized(size, format);
        Self {
            size,
            colour: texture(COLOUR_FORMAT),
            relief: texture(RELIEF_FORMAT),
            ping: texture(RELIEF_FORMAT),
            pong: texture(RELIEF_FORMAT),
            smoothed: texture(RELIEF_FORMAT),
            depth: texture(DEPTH_FORMAT),
            lit: texture(COLOUR_FORMAT),
            starts: (method == VolumeMethod::Rays)
                .then(|| sized(size.map(|side| side.div_ceil(SQUARE_PX)), START_FORMAT)),
            sums: match method {
                VolumeMethod::Rays => None,
                VolumeMethod::Slices => Some((texture(COLOUR_FORMAT), texture(depth_sum_format(device)))),
                // Blended under one another by an opacity of their own.
                VolumeMethod::PatchSlices => Some((texture(COLOUR_FORMAT), texture(COLOUR_FORMAT))),
            },
            hidden: (method == VolumeMethod::PatchSlices).then(|| texture(HIDDEN_FORMAT)),
        }
    }
}

/// Buffers of all volumes in all views, kept between frames; views are entities of the render world.
#[derive(Resource, Default)]
pub(super) struct VolumeViews {
    views: BTreeMap<Entity, BTreeMap<MainEntity, VolumeView>>,
    pub uniforms: DynamicUniformBuffer<VolumeUniform>,
}

impl VolumeViews {
    /// The volumes of a view, far ones first.
    pub fn of_view(&self, view: Entity) -> Vec<(MainEntity, &VolumeView)> {
        let own = self.views.get(&view).into_iter().flatten();
        let mut volumes: Vec<_> = own.map(|(entity, volume)| (*entity, volume)).collect();
        volumes.sort_by(|(_, a), (_, b)| b.depth_m.total_cmp(&a.depth_m));
        volumes
    }
}

type View = (
    Entity,
    &'static ExtractedView,
    &'static ExtractedCamera,
    &'static RenderVisibleEntities,
    &'static Msaa,
    Option<&'static Tonemapping>,
    Option<&'static ScopeMaskUniform>,
    Option<&'static MainPassResolutionOverride>,
);

pub(super) fn prepare_views(
    mut kept: ResMut<VolumeViews>,
    extracted: Res<ExtractedVolumes>,
    changes: Res<SceneChanges>,
    scene: Option<Res<SceneLights>>,
    views: Query<View>,
    mut pipelines: ResMut<VolumePipelines>,
    mut aligned_pipelines: ResMut<AlignedPipelines>,
    bodies: Res<AlignedBodies>,
    uploaded: Option<Res<Uploads>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let mut before = std::mem::take(&mut kept.views);
    let count = |sent: Option<&Buffer>| {
        if let (Some(sent), Some(uploaded)) = (sent, &uploaded) {
            uploaded.add(sent.size());
        }
    };
    // What waits for its pipeline enters the scene in the frame in which this is ready, whenever that is.
    let is_waiting = cache.waiting_pipelines().next().is_some();
    let changes = SceneChanges { everywhere: changes.everywhere || is_waiting, ..(*changes).clone() };
    kept.uniforms.clear();
    for (entity, view, camera, visible, msaa, tonemapping, mask, resolution) in &views {
        let Some(viewport) = viewport_of(camera, resolution) else { continue };
        let visible = visible.get::<CtVolume>().map_or(&[][..], |visible| &visible.entities_cpu_culling);
        let seen = Seen::new(view, viewport);
        let mut drawn = Vec::new();
        // Pixels in which a volume may change the depth that the rays of others end at.
        let mut touched: Vec<(MainEntity, URect)> = Vec::new();
        for &(_, volume) in visible {
            let Some(volume) = extracted.get(volume) else { continue };
            let lights = scene
                .as_ref()
                .map(|scene| strongest_lights(scene, volume.centre_world_m, &volume.layers))
                .unwrap_or_default();
            let variant = WalkVariant {
                multisampled: msaa.samples() > 1,
                own_colours: volume.own_colours,
                deformed: volume.lattice.is_some(),
                // Slices gather gradients in any case: light that goes on or off does not draw them anew.
                lit: volume.look.wet.is_shaded || volume.look.method == VolumeMethod::Slices,
            };
            let uniform = uniform_of(volume, view, viewport, lights);
            let walk_key = WalkKey {
                clip_from_view: view.clip_from_view,
                world_from_view: view.world_from_view.to_matrix(),
                world_from_voxel: volume.world_from_voxel,
                viewport,
                method: volume.look.method,
                variant,
                step_voxels: volume.look.step_voxels,
                clip_planes: volume.clip_planes.clone(),
                lattice: volume.lattice.as_ref().map(|lattice| lattice.revision),
                mask: mask.copied(),
            };
            let was = before.get_mut(&entity).and_then(|own| own.remove(&volume.entity));
            // Gradients that are there already stay when the light goes out.
            let lit_key = WalkKey { variant: WalkVariant { lit: true, ..variant }, ..walk_key.clone() };
            let was_lit = was.as_ref().is_some_and(|was| was.walk_key.as_ref() == Some(&lit_key));
            let walk_key = if was_lit { lit_key } else { walk_key };
            let variant = walk_key.variant;
            let shade_key = ShadeKey { lights, exposure: camera.exposure, look: volume.look.clone() };
            let mut now = was
                .filter(|was| was.buffers.size == viewport.size() && was.method == volume.look.method)
                .unwrap_or_else(|| VolumeView::new(Buffers::new(&device, viewport.size(), volume.look.method)));
            touched.push((volume.entity, now.decide_walk(volume, &changes, &seen, walk_key)));
            let target = OrganPipelineKey::of_view(view, camera, msaa, tonemapping, OrganSides::default());
            let mut is_ready = pipelines.are_ready(&cache, volume.look.method, variant, target);
            now.aligned = None;
            if volume.look.method == VolumeMethod::PatchSlices {
                let clipped = !volume.clip_planes.is_empty();
                let key = AlignedKey::Slices { own_colours: variant.own_colours, clipped, normals: variant.lit };
                is_ready &= aligned_pipelines.are_ready(&cache, key, variant.multisampled);
                now.aligned = Some((key, None));
            }
            now.offset = kept.uniforms.push(&uniform);
            now.depth_m = -view.world_from_view.affine().inverse().transform_point3(volume.centre_world_m).z;
            drawn.push((volume, now, shade_key, is_ready, uniform));
        }
        // Those that left uncover what is behind them.
        touched.extend(before.remove(&entity).unwrap_or_default().into_iter().map(|(volume, was)| (volume, was.seen)));
        for (volume, mut now, shade_key, is_ready, uniform) in drawn {
            for (_, pixels) in touched.iter().filter(|(other, _)| *other != volume.entity) {
                now.walk.add(pixels.intersect(now.seen));
            }
            now.decide_shade(volume, &seen, shade_key);
            // What could not be drawn yet is drawn in a later frame.
            if !is_ready {
                (now.walk_key, now.shade_key) = (None, None);
            }
            if volume.look.method == VolumeMethod::Slices && !now.walk.is_empty() {
                now.slices = super::slices::buffer(&device, volume, view, &uniform);
                count(now.slices.as_ref().map(|(corners, _)| corners));
            }
            if let (Some((_, stack)), Some(body)) = (&mut now.aligned, bodies.get(volume.entity))
                && !now.walk.is_empty()
            {
                *stack = AlignedView::new(&device, body, volume, view, &uniform, now.seen);
                count(stack.as_ref().map(|stack| &stack.polygons));
            }
            kept.views.entry(entity).or_default().insert(volume.entity, now);
        }
    }
    kept.uniforms.write_buffer(&device, &queue);
}

/// Finds what of a view things in the world take up.
struct Seen {
    clip_from_world: Mat4,
    size: UVec2,
}

impl Seen {
    fn new(view: &ExtractedView, viewport: URect) -> Self {
        let clip_from_world = view.clip_from_view * view.world_from_view.to_matrix().inverse();
        Self { clip_from_world, size: viewport.size() }
    }

    fn all(&self) -> URect {
        URect { min: UVec2::ZERO, max: self.size }
    }

    /// Pixels that a box of some space may cover, with one to spare.
    fn of_box(&self, world_from_space: Mat4, low: Vec3, high: Vec3) -> URect {
        if low.cmpgt(high).any() {
            return URect::EMPTY;
        }
        let clip_from_space = self.clip_from_world * world_from_space;
        let corners: [Vec4; 8] = std::array::from_fn(|corner| {
            let side = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            clip_from_space * Vec4::new(side(0), side(1), side(2), 1.0)
        });
        if !corners.iter().all(|corner| corner.is_finite()) {
            return self.all();
        }
        // What lies behind the eye is cut off a little before it.
        const BEFORE: f32 = 1e-4;
        let (mut least, mut most) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        let mut cover = |clip: Vec4| {
            let ndc = Vec2::new(clip.x, -clip.y) / clip.w;
            (least, most) = (least.min(ndc), most.max(ndc));
        };
        for (place, corner) in corners.iter().enumerate() {
            if corner.w >= BEFORE {
                cover(*corner);
            }
            for axis in 0..3 {
                let other = corners[place | 1 << axis];
                if (corner.w < BEFORE) != (other.w < BEFORE) {
                    cover(corner.lerp(other, (BEFORE - corner.w) / (other.w - corner.w)));
                }
            }
        }
        if least.cmpgt(most).any() {
            return URect::EMPTY;
        }
        let size = self.size.as_vec2();
        let pixel = |ndc: Vec2| (ndc * 0.5 + 0.5) * size;
        let min = (pixel(least) - 1.0).floor().clamp(Vec2::ZERO, size).as_uvec2();
        let max = (pixel(most) + 1.0).ceil().clamp(Vec2::ZERO, size).as_uvec2();
        URect { min, max: max.max(min) }
    }
}

/// A rectangle with some pixels more on all sides, within a size.
pub(super) fn grown(of: URect, by: u32, within: URect) -> URect {
    if of.is_empty() {
        return of;
    }
    URect { min: of.min.saturating_sub(UVec2::splat(by)), max: of.max + by }.intersect(within)
}

fn united(a: URect, b: URect) -> URect {
    if a.is_empty() {
        b
    } else if b.is_empty() {
        a
    } else {
        a.union(b)
    }
}

impl VolumeView {
    fn new(buffers: Buffers) -> Self {
        Self {
            buffers,
            walk_key: None,
            shade_key: None,
            offset: 0,
            method: default(),
            variant: WalkVariant::default(),
            viewport: URect::EMPTY,
            passes: 0,
            seen: URect::EMPTY,
            walk: Patches::default(),
            is_all: false,
            shade: URect::EMPTY,
            slices: None,
            aligned: None,
            depth_m: 0.0,
        }
    }

    /// Decides which rays are walked anew (paper of 2009, section 4.2: only what changed). Returns the pixels in which this may
    /// change the depth of the volume.
    fn decide_walk(
        &mut self,
        volume: &ExtractedVolume,
        changes: &SceneChanges,
        view: &Seen,
        walk_key: WalkKey,
    ) -> URect {
        let (low, high) = volume.bounds;
        let was_seen = std::mem::replace(&mut self.seen, view.of_box(volume.world_from_voxel, low, high));
        self.is_all = volume.is_all_new || self.walk_key.as_ref() != Some(&walk_key);
        let mut walk = Patches::default();
        if self.is_all {
            walk.add(self.seen);
        } else {
            for &(low, high) in &volume.cut {
                walk.add(view.of_box(volume.world_from_voxel, low, high));
            }
            if changes.everywhere {
                walk.add(self.seen);
            }
            for &(world_from_mesh, low, high) in &changes.boxes {
                // A long tool that lies askew takes little of the rectangle around it.
                for (low, high) in slices_of(world_from_mesh, low, high) {
                    walk.add(view.of_box(world_from_mesh, low, high).intersect(self.seen));
                }
            }
            // What was cut or restored may lie beyond what is seen now.
            walk.clip(view.all());
        }
        let bounds = walk.bounds();
        self.walk = walk;
        (self.method, self.variant, self.viewport) = (walk_key.method, walk_key.variant, walk_key.viewport);
        self.walk_key = Some(walk_key);
        if self.is_all { united(was_seen, bounds) } else { bounds }
    }

    /// Decides which pixels are smoothed and shaded anew, once it is known which are walked.
    fn decide_shade(&mut self, volume: &ExtractedVolume, view: &Seen, shade_key: ShadeKey) {
        let wet = &volume.look.wet;
        let passes = if wet.smoothed == SmoothedNormals::None { 0 } else { wet.passes };
        let shades_all = self.is_all || self.shade_key.as_ref() != Some(&shade_key);
        self.shade = if shades_all { view.all() } else { grown(self.walk.bounds(), passes, view.all()) };
        (self.passes, self.shade_key) = (passes, Some(shade_key));
    }

    /// Pixels that pass `k` of smoothing covers, so that the last one is right where it is shaded.
    pub fn smoothed_by(&self, k: u32) -> URect {
        let all = URect { min: UVec2::ZERO, max: self.viewport.size() };
        grown(self.shade, self.passes - 1 - k, all).intersect(grown(self.seen, self.passes, all))
    }
}

/// A box cut across its longest side into parts that are about as long as they are wide, or into some.
fn slices_of(world_from_mesh: Mat4, low: Vec3, high: Vec3) -> impl Iterator<Item = (Vec3, Vec3)> {
    const MOST: f32 = 12.0;
    let sides_m: [f32; 3] =
        std::array::from_fn(|axis| world_from_mesh.col(axis).truncate().length() * (high[axis] - low[axis]));
    let axis = (0..3).fold(0, |longest, axis| if sides_m[axis] > sides_m[longest] { axis } else { longest });
    let wide_m = (0..3).filter(|other| *other != axis).fold(0.0, |wide: f32, other| wide.max(sides_m[other]));
    // Also 1 for what is not a number.
    let count = (sides_m[axis] / wide_m.max(1e-9)).round().clamp(1.0, MOST).max(1.0);
    (0..count as u32).map(move |k| {
        let at = |k: u32| low[axis] + (high[axis] - low[axis]) * (k as f32 / count);
        let (mut from, mut to) = (low, high);
        (from[axis], to[axis]) = (at(k), at(k + 1));
        (from, to)
    })
}

/// Greatest number of a sample plane. Single precision does not tell all whole numbers beyond apart, and a ray that counts them
/// would not get on.
const MAX_PLANE: f32 = 4_194_304.0;

fn uniform_of(volume: &ExtractedVolume, view: &ExtractedView, viewport: URect, lights: OrganLights) -> VolumeUniform {
    let world_from_view = view.world_from_view.to_matrix().as_dmat4();
    let world_from_voxel = volume.world_from_voxel;
    let voxel_from_view: DMat4 = world_from_voxel.as_dmat4().inverse() * world_from_view;
    let rays = Rays::new(view.clip_from_view, voxel_from_view);
    let projection = depth_projection(view.clip_from_view);
    let edges = [world_from_voxel.x_axis, world_from_voxel.y_axis, world_from_voxel.z_axis];
    let spacing_m = edges.iter().map(|edge| edge.truncate().length()).fold(f32::INFINITY, f32::min);
    let middle = world_from_voxel.transform_point3((volume.size.as_vec3() - 1.0) * 0.5);
    let middle_m = -(world_from_view.inverse().transform_point3(middle.as_dvec3())).z as f32;
    let half_m = edges.iter().zip(volume.size.to_array()).map(|(edge, count)| edge.truncate().length() * count as f32);
    let farthest_m = middle_m.abs() + half_m.sum::<f32>();
    let mut clip_planes = [Vec4::ZERO; 6];
    clip_planes[..volume.clip_planes.len()].copy_from_slice(&volume.clip_planes);
    let wet = &volume.look.wet;
    VolumeUniform {
        world_from_voxel,
        // Times a length, so that its numbers are near 1 at any scale.
        world_from_voxel_normal: (world_from_voxel.as_dmat4().inverse().transpose() * f64::from(spacing_m)).as_mat4(),
        origin: rays.origin,
        along: rays.along,
        clip_planes,
        low: volume.bounds.0,
        step_m: (volume.look.step_voxels * spacing_m).max(farthest_m / MAX_PLANE),
        high: volume.bounds.1,
        near_m: near_m(projection),
        size: volume.size.as_vec3(),
        clip_plane_count: volume.clip_planes.len() as u32,
        viewport: Vec4::new(
            viewport.min.x as f32,
            viewport.min.y as f32,
            viewport.width() as f32,
            viewport.height() as f32,
        ),
        depth_projection: projection,
        middle_m,
        spacing_m,
        edge_voxels: wet.edge_voxels,
        shine: wet.shine,
        shine_exponent: wet.shine_exponent,
        diffuse_smoothing: f32::from(u8::from(wet.smoothed == SmoothedNormals::All)),
        is_shaded: f32::from(u8::from(wet.is_shaded)),
        lights,
    }
}
