//! Slices across the view: where planes of equal depth cut the box of what can be seen.

use super::extract::ExtractedVolume;
use super::uniform::VolumeUniform;
use bevy::prelude::*;
use bevy::render::render_resource::{Buffer, BufferInitDescriptor, BufferUsages};
use bevy::render::renderer::RenderDevice;
use bevy::render::view::ExtractedView;

/// Most slices of a volume.
const MAX_SLICES: i32 = 8192;

/// How far slices reach beyond the box, whose end the shader finds to the bit.
const BEYOND_VOXELS: f32 = 0.1;

/// Corners of the slices as triangles, far slices first: position in the world, and the slice's number.
pub(super) fn buffer(
    device: &RenderDevice,
    volume: &ExtractedVolume,
    view: &ExtractedView,
    uniform: &VolumeUniform,
) -> Option<(Buffer, u32)> {
    let world_from_view = view.world_from_view.affine();
    let view_from_voxel = Mat4::from(world_from_view.inverse()) * volume.world_from_voxel;
    let (low, high) = volume.bounds;
    let corners =
        box_corners((low - BEYOND_VOXELS, high + BEYOND_VOXELS)).map(|corner| view_from_voxel.transform_point3(corner));
    let mut vertices: Vec<Vec4> = Vec::new();
    for (k, polygon) in slice_polygons(&corners, uniform.step_m, uniform.near_m) {
        for pair in polygon.windows(2).skip(1) {
            for corner in [polygon[0], pair[0], pair[1]] {
                vertices.push(world_from_view.transform_point3(corner).extend(k as f32));
            }
        }
    }
    if vertices.is_empty() {
        return None;
    }
    let contents = bytemuck::cast_slice(&vertices);
    let descriptor = BufferInitDescriptor { label: Some("volume_slices"), usage: BufferUsages::VERTEX, contents };
    Some((device.create_buffer_with_data(&descriptor), vertices.len() as u32))
}

/// Corner `n` of a box has the high side along axis `a` where bit `a` of `n` is set.
fn box_corners((low, high): (Vec3, Vec3)) -> [Vec3; 8] {
    std::array::from_fn(|n| {
        let side = |axis: usize| if n >> axis & 1 == 0 { low[axis] } else { high[axis] };
        Vec3::new(side(0), side(1), side(2))
    })
}

/// The convex polygons in which planes of equal depth cut a box, far ones first, with the planes' numbers. Corners in view
/// space, as [`box_corners`] orders them.
fn slice_polygons(corners: &[Vec3; 8], step_m: f32, near_m: f32) -> Vec<(i32, Vec<Vec3>)> {
    let depths = corners.map(|corner| -corner.z);
    let nearest = depths.iter().copied().fold(f32::INFINITY, f32::min).max(near_m);
    let farthest = depths.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let (first, last) = ((nearest / step_m).ceil() as i32, (farthest / step_m).floor() as i32);
    let mut polygons = Vec::new();
    for k in (first..=last.min(first.saturating_add(MAX_SLICES))).rev() {
        let depth = k as f32 * step_m;
        let mut cuts: Vec<Vec3> = Vec::with_capacity(6);
        for a in 0..8_usize {
            for axis in 0..3 {
                let b = a | 1 << axis;
                if b == a || (depths[a] < depth) == (depths[b] < depth) {
                    continue;
                }
                let t = (depth - depths[a]) / (depths[b] - depths[a]);
                cuts.push(corners[a].lerp(corners[b], t));
            }
        }
        if cuts.len() < 3 {
            continue;
        }
        // Round its middle, so that the corners follow one another.
        let middle = cuts.iter().sum::<Vec3>() / cuts.len() as f32;
        let angle = |cut: &Vec3| (cut.y - middle.y).atan2(cut.x - middle.x);
        cuts.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        polygons.push((k, cuts));
    }
    polygons
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_fill_a_turned_box() {
        let turned =
            Mat4::from_translation(Vec3::new(0.1, -0.2, -3.0)) * Mat4::from_euler(EulerRot::XYZ, 0.4, 0.7, 0.2);
        let half = Vec3::new(0.5, 0.3, 0.8);
        let corners = box_corners((-half, half)).map(|corner| turned.transform_point3(corner));
        let step = 0.01;
        let polygons = slice_polygons(&corners, step, 0.1);
        assert!(polygons.windows(2).all(|pair| pair[0].0 > pair[1].0), "far ones first");
        let area = |polygon: &[Vec3]| -> f32 {
            polygon[1..].windows(2).map(|p| (p[0] - polygon[0]).cross(p[1] - polygon[0]).z * 0.5).sum()
        };
        let volume: f32 = polygons.iter().map(|(_, polygon)| area(polygon) * step).sum();
        let exact = 8.0 * half.element_product();
        assert!((volume / exact - 1.0).abs() < 1e-3, "{volume} instead of {exact}");
    }

    #[test]
    fn nothing_is_cut_before_the_near_plane() {
        let corners = box_corners((Vec3::splat(-1.0), Vec3::splat(1.0)));
        let polygons = slice_polygons(&corners, 0.1, 0.25);
        assert_eq!(polygons.last().map(|(k, _)| *k), Some(3));
    }
}
