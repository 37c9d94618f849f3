//! Slices that are aligned with a deformed volume (paper of 2001, section 4).

use super::march::{Pixel, draw_rays, sample};
use super::{MarchScene, ViewRays, VolumeImage};
use crate::volume::aligned::{PatchPolygons, SliceStack};
use glam::{Affine3A, Vec3};

/// A deformed volume as a stack of slices.
#[derive(Clone, Copy, Debug)]
pub struct AlignedField<'a> {
    /// The polygons of the lattice's patches.
    pub polygons: &'a PatchPolygons,
    /// Translations of the lattice's vertices, shares of the box.
    pub translations: &'a [Vec3],
    /// Shares of the box to voxel coordinates.
    pub voxel_from_box: Affine3A,
    /// The slices.
    pub stack: SliceStack,
}

/// Opacity from which on a ray is not followed: what the drawing that it is compared with hides between some slices.
const ENOUGH: f32 = 0.9995;

/// Draws every slice, the nearest first. A sample's opacity is that of the ray's way from slice to slice: `1 - (1 - a)^d`, with the
/// table's opacity `a` of a step and the way `d` in steps. The gradients are those of the volume at rest.
pub fn composite_aligned(rays: &ViewRays, scene: &MarchScene, field: &AlignedField) -> VolumeImage {
    let box_from_voxel = field.voxel_from_box.inverse();
    let AlignedField { polygons, translations, stack, .. } = field;
    let last = scene.field.size().as_vec3() - 0.5;
    draw_rays(rays, scene, |ray, scene_m, counts| {
        counts.rays += 1;
        let mut pixel = Pixel { end_depth_m: scene_m, ..Pixel::default() };
        let origin = box_from_voxel.transform_point3(ray.origin);
        let along = box_from_voxel.transform_vector3(ray.along);
        let steps = (stack.spacing / (along[stack.axis].abs() * scene.step_m)).min(20.0);
        for n in 0..stack.count {
            let depth_m = (stack.position(n) - origin[stack.axis]) / along[stack.axis];
            if depth_m.is_nan() || depth_m < scene.near_m || depth_m > scene_m {
                continue;
            }
            let shown = ray.at(depth_m);
            if scene.clip_planes.iter().any(|plane| plane.dot(shown.extend(1.0)) < 0.0) {
                continue;
            }
            let mut place = origin + along * depth_m;
            place[stack.axis] = stack.position(n);
            let Some(rest) = polygons.rest_in_triangles(stack.axis, place, translations) else { continue };
            let rest = field.voxel_from_box.transform_point3(rest);
            if rest.cmplt(Vec3::splat(-0.5)).any() || rest.cmpgt(last).any() {
                continue;
            }
            counts.samples += 1;
            let Some(sample) = sample(scene, rest) else { continue };
            counts.visible_samples += 1;
            let weight = (1.0 - pixel.colour.w) * (1.0 - (1.0 - sample.opacity).powf(steps));
            pixel.colour += (sample.colour * weight).extend(weight);
            pixel.gradient += sample.gradient * weight;
            pixel.weighted_depth_m += depth_m * weight;
            if pixel.colour.w > ENOUGH {
                break;
            }
        }
        pixel
    })
}
