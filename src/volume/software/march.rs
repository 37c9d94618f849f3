//! Ray casting: front to back, over empty space, until nothing shines through.

use super::{ENOUGH_OPACITY, RenderField, ViewRays, VoxelRay};
use crate::volume::VoxelLattice;
use crate::volume::blocks::{BLOCK_SIDE, BlockDistances};
use crate::volume::transfer::TransferTable;
use bevy::reflect::Reflect;
use glam::{UVec2, Vec3, Vec4};
use rayon::prelude::*;
use std::ops::AddAssign;

/// What is drawn, and what bounds it.
#[derive(Clone, Copy, Debug)]
pub struct MarchScene<'a> {
    /// The voxels.
    pub field: &'a RenderField,
    /// What deforms them, if anything does.
    pub lattice: Option<&'a VoxelLattice>,
    /// Straight colour (linear) and opacity of one step for the values from 0 to 1.
    pub table: &'a [[f32; 4]],
    /// Where nothing shows, of the same voxels and table; without it every sample is taken.
    pub distances: Option<&'a BlockDistances>,
    /// Distance of the sample planes along the view, metres; positive.
    pub step_m: f32,
    /// View depth before which nothing is drawn, metres.
    pub near_m: f32,
    /// Half spaces of voxel coordinates, `normal . v + offset >= 0` inside; what is outside of any is not drawn.
    pub clip_planes: &'a [Vec4],
    /// View depth of the opaque scene for each pixel, row by row from the top, metres; infinite where there is nothing.
    pub scene_depth_m: Option<&'a [f32]>,
}

/// A volume's picture before it is lit. One entry per pixel, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct VolumeImage {
    /// Pixels.
    pub size_px: UVec2,
    /// Colour (linear, premultiplied) and opacity.
    pub colour: Vec<[f32; 4]>,
    /// Unit normal in the world, facing the viewer: that of the mean gradient by weight. 0 where nothing is drawn.
    pub normal: Vec<[f32; 3]>,
    /// Mean view depth by weight, metres; 0 where nothing is drawn.
    pub depth_m: Vec<f32>,
    /// View depth where the ray ended: where enough opacity was gathered, the volume was left or the scene was met, metres. For
    /// rays past the volume that of the scene.
    pub end_depth_m: Vec<f32>,
    /// The work that was done.
    pub counts: MarchCounts,
}

/// Work of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub struct MarchCounts {
    /// Rays with a part inside the volume.
    pub rays: u64,
    /// Pixels that show something.
    pub covered: u64,
    /// Jumps over empty blocks.
    pub skips: u64,
    /// Looks at a block's distance, those before a jump among them.
    pub lookups: u64,
    /// Interpolated values.
    pub samples: u64,
    /// Samples with an opacity above 0.
    pub visible_samples: u64,
}

impl AddAssign for MarchCounts {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.covered += other.covered;
        self.skips += other.skips;
        self.lookups += other.lookups;
        self.samples += other.samples;
        self.visible_samples += other.visible_samples;
    }
}

/// One pixel's result.
#[derive(Clone, Copy, Default)]
pub(super) struct Pixel {
    pub colour: Vec4,
    /// Sum of the gradients by weight.
    pub gradient: Vec3,
    /// Sum of the depths by weight.
    pub weighted_depth_m: f32,
    pub end_depth_m: f32,
}

/// Casts a ray through every pixel.
pub fn march(rays: &ViewRays, scene: &MarchScene) -> VolumeImage {
    draw(rays, scene, |ray, planes, end_m, counts| march_ray(ray, planes, end_m, scene, counts))
}

/// Works all pixels out. The function gets a ray, its first and last plane and the depth where it ends.
pub(super) fn draw(
    rays: &ViewRays,
    scene: &MarchScene,
    pixel_of: impl Fn(VoxelRay, (i32, i32), f32, &mut MarchCounts) -> Pixel + Sync,
) -> VolumeImage {
    draw_rays(rays, scene, |ray, scene_m, counts| match drawn_range(ray, scene, scene_m) {
        Some((planes, end_m)) => {
            counts.rays += 1;
            pixel_of(ray, planes, end_m, counts)
        }
        None => Pixel { end_depth_m: scene_m, ..Pixel::default() },
    })
}

/// Works all pixels out. The function gets a ray and the depth of the scene behind it.
pub(super) fn draw_rays(
    rays: &ViewRays,
    scene: &MarchScene,
    pixel_of: impl Fn(VoxelRay, f32, &mut MarchCounts) -> Pixel + Sync,
) -> VolumeImage {
    let size_px = rays.size_px();
    let width = size_px.x as usize;
    let count = width * size_px.y as usize;
    let mut colour = vec![[0.0; 4]; count];
    let mut normal = vec![[0.0; 3]; count];
    let mut depth_m = vec![0.0; count];
    let mut end_depth_m = vec![0.0; count];
    let mut counts_of_rows = vec![MarchCounts::default(); size_px.y as usize];
    if count > 0 {
        let rows = (colour.par_chunks_mut(width), normal.par_chunks_mut(width)).into_par_iter().zip((
            depth_m.par_chunks_mut(width),
            end_depth_m.par_chunks_mut(width),
            counts_of_rows.par_iter_mut(),
        ));
        rows.enumerate().for_each(|(y, ((colour, normal), (depth_m, end_depth_m, counts)))| {
            for x in 0..width {
                let ray = rays.ray(UVec2::new(x as u32, y as u32));
                let scene_m = scene.scene_depth_m.and_then(|depths| depths.get(y * width + x)).copied();
                let scene_m = scene_m.unwrap_or(f32::INFINITY);
                let pixel = pixel_of(ray, scene_m, counts);
                colour[x] = pixel.colour.to_array();
                end_depth_m[x] = pixel.end_depth_m;
                if pixel.colour.w > 0.0 {
                    depth_m[x] = pixel.weighted_depth_m / pixel.colour.w;
                    // Gradients are those at rest; the field turns them on their way to the picture.
                    let gradient = match scene.lattice {
                        Some(lattice) => lattice.shown_gradient(pixel.gradient, ray.at(depth_m[x])),
                        None => pixel.gradient,
                    };
                    normal[x] = rays.normal_of(ray, gradient).to_array();
                    counts.covered += 1;
                }
            }
        });
    }
    let mut counts = MarchCounts::default();
    counts_of_rows.into_iter().for_each(|row| counts += row);
    VolumeImage { size_px, colour, normal, depth_m, end_depth_m, counts }
}

/// First and last sample plane of a ray, and the depth where it leaves what is drawn; `None` if it meets nothing of it.
fn drawn_range(ray: VoxelRay, scene: &MarchScene, scene_m: f32) -> Option<((i32, i32), f32)> {
    let (mut from, mut to) = (scene.near_m, scene_m);
    // Inside where `start + slope * depth >= 0`.
    let mut bound = |start: f32, slope: f32| {
        let meets = -start / slope;
        if slope > 0.0 {
            from = from.max(meets);
        } else if slope < 0.0 {
            to = to.min(meets);
        } else if start < 0.0 {
            to = f32::NEG_INFINITY;
        }
    };
    let (mut low, mut high) = (Vec3::splat(-0.5), scene.field.size().as_vec3() - 0.5);
    if let Some(lattice) = scene.lattice {
        let (least, most) = lattice.translation_bounds();
        (low, high) = (low - most, high - least);
    }
    for axis in 0..3 {
        bound(ray.origin[axis] - low[axis], ray.along[axis]);
        bound(high[axis] - ray.origin[axis], -ray.along[axis]);
    }
    for plane in scene.clip_planes {
        bound(plane.truncate().dot(ray.origin) + plane.w, plane.truncate().dot(ray.along));
    }
    let planes = ((from / scene.step_m).ceil() as i32, (to / scene.step_m).floor() as i32);
    (from <= to && planes.0 <= planes.1 && scene.step_m > 0.0).then_some((planes, to))
}

fn march_ray(
    ray: VoxelRay,
    (first, last): (i32, i32),
    end_m: f32,
    scene: &MarchScene,
    counts: &mut MarchCounts,
) -> Pixel {
    let mut pixel = Pixel { end_depth_m: end_m, ..Pixel::default() };
    let mut plane = first;
    // Planes up to this one are in a block that may show.
    let mut known = i32::MIN;
    while plane <= last {
        let depth_m = plane as f32 * scene.step_m;
        let at = scene.rest_at(ray.at(depth_m));
        if plane > known {
            counts.lookups += 1;
            let (is_empty, next) = look_ahead(ray, at, plane, scene);
            if is_empty {
                counts.skips += 1;
                plane = next;
                continue;
            }
            known = next - 1;
        }
        plane += 1;
        counts.samples += 1;
        let Some(sample) = sample(scene, at) else { continue };
        counts.visible_samples += 1;
        let weight = (1.0 - pixel.colour.w) * sample.opacity;
        pixel.colour += (sample.colour * weight).extend(weight);
        pixel.gradient += sample.gradient * weight;
        pixel.weighted_depth_m += depth_m * weight;
        if pixel.colour.w > ENOUGH_OPACITY {
            pixel.end_depth_m = depth_m;
            break;
        }
    }
    pixel
}

/// Whether the block of matter that rests at a place shows nothing, and the next plane that needs another look: the first one at
/// which matter beyond the empty blocks around it may be shown, or beyond the block itself.
fn look_ahead(ray: VoxelRay, at: Vec3, plane: i32, scene: &MarchScene) -> (bool, i32) {
    let Some(distances) = scene.distances else { return (false, i32::MAX) };
    let at = (at + 0.5) / BLOCK_SIDE as f32;
    let block = at.floor();
    let inside = block.clamp(Vec3::ZERO, distances.blocks().as_vec3() - 1.0);
    // Beyond the grid it is as far to what shows something as it is to the grid, or as from the grid's nearest block.
    let distance = f32::from(distances.distance(inside.as_uvec3())).max((block - inside).abs().max_element());
    let reach = (distance - 1.0).max(0.0);
    let step = ray.along * (scene.step_m / BLOCK_SIDE as f32);
    let (slow, fast) = scene.lattice.map_or((step, step), |lattice| lattice.speeds(step));
    let forth = (block + reach + 1.0 - at) / fast.max(Vec3::splat(1e-9));
    let back = (block - reach - at) / slow.min(Vec3::splat(-1e-9));
    let steps = forth.min(back).min_element();
    // Rounding may lead to a plane too early, which only costs another look, or to one that is too late by far less than half a
    // voxel, where still nothing shows, as a block's range has the voxels beside it.
    (distance > 0.0, plane.saturating_add(next_plane(steps).max(1)))
}

/// The first whole number that is not below a number; quicker than `ceil` on processors without an instruction for it.
#[inline]
fn next_plane(planes: f32) -> i32 {
    let whole = planes as i32;
    whole.saturating_add(i32::from((whole as f32) < planes))
}

impl MarchScene<'_> {
    /// Where the matter rests that is shown at a place; both in voxel coordinates.
    #[inline]
    pub(super) fn rest_at(&self, shown_voxel: Vec3) -> Vec3 {
        self.lattice.map_or(shown_voxel, |lattice| lattice.rest_from_shown(shown_voxel))
    }
}

/// What a ray or a slice takes from a place.
pub(super) struct Sample {
    pub colour: Vec3,
    pub opacity: f32,
    pub gradient: Vec3,
}

/// The sample at a place at rest; `None` without opacity.
#[inline]
pub(super) fn sample(scene: &MarchScene, at: Vec3) -> Option<Sample> {
    let field = scene.field;
    // A lattice may lead beyond the grid, where nothing is.
    if scene.lattice.is_some() && (at.cmplt(Vec3::splat(-0.5)).any() || at.cmpgt(field.size().as_vec3() - 0.5).any()) {
        return None;
    }
    let corners = field.corners(at);
    let &[r, g, b, opacity] = scene.table.get(TransferTable::index(field.value_at(&corners)))?;
    if opacity <= 0.0 {
        return None;
    }
    let opacity = opacity * field.remaining_at(&corners);
    (opacity > 0.0).then(|| Sample {
        colour: field.colour_at(&corners).unwrap_or(Vec3::new(r, g, b)),
        opacity,
        gradient: field.gradient_at(&corners),
    })
}
