//! Volumes drawn on the CPU, held against closed forms; the GPU's passes are held against this.

mod agreement;
mod bounds;
mod deformed;
mod march;
mod wet;

use bevy::math::{Affine3A, DVec3, Mat4, UVec2, UVec3, Vec3};
use bevy_surgery::volume::software::{MarchScene, RenderField, ViewRays, VolumeImage};
use bevy_surgery::volume::transfer::TABLE_ENTRIES;
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};

/// Distance of the sample planes, metres: a voxel.
const STEP_M: f32 = 1e-3;

/// A volume of a function of the voxel coordinates with values from 0 to 1, both of which it takes.
fn volume_of(size: UVec3, spacing_mm: DVec3, value: impl Fn(Vec3) -> f32) -> Volume {
    let rows = (0..size.z).flat_map(|z| (0..size.y).map(move |y| (y, z)));
    let voxels = rows.flat_map(|(y, z)| (0..size.x).map(move |x| UVec3::new(x, y, z)));
    let values: Vec<f32> = voxels.map(|voxel| value(voxel.as_vec3()).clamp(0.0, 1.0)).collect();
    let volume =
        Volume::new(VolumeGrid::upright(size, spacing_mm), Voxels::F32(values), 1.0, 0.0).expect("a good volume");
    assert_eq!(volume.range(), [0.0, 1.0]);
    volume
}

/// Middle of the ball in its 64^3 voxels.
const MIDDLE: Vec3 = Vec3::splat(31.5);
/// Its radius, voxels.
const RADIUS: f32 = 20.0;

/// A ball with a soft edge; its value is a half at [`RADIUS`].
fn ball() -> Volume {
    volume_of(UVec3::splat(64), DVec3::ONE, |voxel| 0.5 + (RADIUS - voxel.distance(MIDDLE)) / 8.0)
}

/// White with one opacity per step for values above a half.
fn solid_table(opacity: f32) -> Vec<[f32; 4]> {
    (0..TABLE_ENTRIES).map(|entry| [1.0, 1.0, 1.0, if entry >= TABLE_ENTRIES / 2 { opacity } else { 0.0 }]).collect()
}

fn perspective(size_px: UVec2, width_over_depth: f32) -> Mat4 {
    let aspect = size_px.x as f32 / size_px.y as f32;
    let fov = 2.0 * (0.5 * width_over_depth / aspect).atan();
    Mat4::perspective_infinite_reverse_rh(fov, aspect, 0.01)
}

fn rays_from(volume: &Volume, size_px: UVec2, clip_from_view: Mat4, eye: Vec3, target: Vec3) -> ViewRays {
    let up = if (target - eye).normalize().y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
    let world_from_view = Affine3A::look_at_rh(eye, target, up).inverse();
    let volume_from_voxel = volume.grid().volume_from_voxel();
    ViewRays::new(size_px, clip_from_view, world_from_view, Affine3A::IDENTITY, volume_from_voxel).expect("a camera")
}

fn scene<'a>(field: &'a RenderField, table: &'a [[f32; 4]]) -> MarchScene<'a> {
    MarchScene {
        field,
        lattice: None,
        table,
        distances: None,
        step_m: STEP_M,
        near_m: 0.0,
        clip_planes: &[],
        scene_depth_m: None,
    }
}

/// Pixels of a picture with their places in memory.
fn pixels(size_px: UVec2) -> impl Iterator<Item = (usize, UVec2)> {
    (0..(size_px.x * size_px.y) as usize)
        .map(move |place| (place, UVec2::new(place as u32 % size_px.x, place as u32 / size_px.x)))
}

/// View depths between which a pixel's ray is in the ball.
fn chord_m(rays: &ViewRays, pixel: UVec2) -> Option<[f32; 2]> {
    let ray = rays.ray(pixel);
    let (from, along) = (ray.origin.as_dvec3() - MIDDLE.as_dvec3(), ray.along.as_dvec3());
    let (a, half_b, c) = (along.length_squared(), from.dot(along), from.length_squared() - f64::from(RADIUS * RADIUS));
    let root = (half_b * half_b - a * c).sqrt();
    (!root.is_nan()).then(|| [-1.0, 1.0].map(|sign| ((-half_b + sign * root) / a) as f32))
}

fn opacity(image: &VolumeImage, place: usize) -> f32 {
    image.colour[place][3]
}
