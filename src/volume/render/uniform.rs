//! A volume in a view, as the shaders read it (`shaders/volume/volume.wgsl`).

use crate::render::OrganLights;
use bevy::math::{DMat4, DVec3, DVec4};
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;

/// A volume in a view, with its lights. Twin in `shaders/volume/volume.wgsl`.
#[derive(Clone, Copy, Debug, Default, ShaderType)]
pub struct VolumeUniform {
    /// Voxel coordinates to the world, metres.
    pub world_from_voxel: Mat4,
    /// Inverse transpose of it, times [`Self::spacing_m`].
    pub world_from_voxel_normal: Mat4,
    /// Voxel coordinates of a pixel's ray at depth 0: constant, per unit of clip space along x, along y.
    pub origin: [Vec4; 3],
    /// Voxels per metre of depth along a pixel's ray, in the same three parts.
    pub along: [Vec4; 3],
    /// Half spaces of voxel coordinates, `normal . v + offset >= 0` inside.
    pub clip_planes: [Vec4; 6],
    /// Least voxel coordinates of what can be seen.
    pub low: Vec3,
    /// Distance of the sample planes along the view, metres.
    pub step_m: f32,
    /// Greatest voxel coordinates of what can be seen.
    pub high: Vec3,
    /// View depth before which nothing is drawn, metres.
    pub near_m: f32,
    /// Voxels along each axis.
    pub size: Vec3,
    /// How many of `clip_planes` are in use.
    pub clip_plane_count: u32,
    /// Corner and size of the viewport in its target, pixels.
    pub viewport: Vec4,
    /// Clip-space z is `(x * -depth + y) / (z * -depth + w)`.
    pub depth_projection: Vec4,
    /// View depth of the volume's middle, metres.
    pub middle_m: f32,
    /// Shortest edge of a voxel in the world, metres.
    pub spacing_m: f32,
    /// Difference in depth from which on normals are not smoothed together, voxels.
    pub edge_voxels: f32,
    /// Strength of the reflections.
    pub shine: f32,
    /// Their Blinn-Phong exponent.
    pub shine_exponent: f32,
    /// Share of the smoothed normals in those of diffuse light.
    pub diffuse_smoothing: f32,
    /// 1 where light falls on the volume, 0 where it shows its own colours.
    pub is_shaded: f32,
    /// The lights that reach it.
    pub lights: OrganLights,
}

/// The rays of a view's pixels through a space: a ray is `origin + along * depth` with the depth in metres along the view's
/// axis, and both are linear in the pixel's place in clip space: constant, times x, times y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rays {
    pub origin: [Vec4; 3],
    pub along: [Vec4; 3],
}

impl Rays {
    /// Rays of a perspective (also an asymmetric one) or orthographic projection. `space_from_view` leads from the view's space
    /// (metres, looking along -Z) to that of the rays.
    pub fn new(clip_from_view: Mat4, space_from_view: DMat4) -> Self {
        let p = clip_from_view.as_dmat4();
        let point = |x: f64, y: f64, z: f64| (space_from_view * DVec4::new(x, y, z, 1.0)).as_vec4().with_w(0.0);
        let direction = |v: DVec3| (space_from_view * v.extend(0.0)).as_vec4();
        if p.w_axis.w == 0.0 {
            // clip.x = p00 x + p02 z with w = -z, so x = (ndc.x + p02) / p00 * depth.
            let across = DVec3::new(p.z_axis.x / p.x_axis.x, p.z_axis.y / p.y_axis.y, -1.0);
            let x = DVec3::new(1.0 / p.x_axis.x, 0.0, 0.0);
            let y = DVec3::new(0.0, 1.0 / p.y_axis.y, 0.0);
            Self {
                origin: [point(0.0, 0.0, 0.0), Vec4::ZERO, Vec4::ZERO],
                along: [direction(across), direction(x), direction(y)],
            }
        } else {
            // clip.x = p00 x + p03 with w = 1.
            let corner = point(-p.w_axis.x / p.x_axis.x, -p.w_axis.y / p.y_axis.y, 0.0);
            let x = direction(DVec3::new(1.0 / p.x_axis.x, 0.0, 0.0));
            let y = direction(DVec3::new(0.0, 1.0 / p.y_axis.y, 0.0));
            Self { origin: [corner, x, y], along: [direction(DVec3::NEG_Z), Vec4::ZERO, Vec4::ZERO] }
        }
    }
}

/// The part of a projection that depth goes through: clip-space z is `(x * -depth + y) / (z * -depth + w)`.
pub(super) fn depth_projection(clip_from_view: Mat4) -> Vec4 {
    let [z, w] = [clip_from_view.z_axis, clip_from_view.w_axis];
    Vec4::new(z.z, w.z, z.w, w.w)
}

/// Depth of the near plane, metres; Bevy's depth is reversed, so it is where clip-space z is 1.
pub(super) fn near_m(projection: Vec4) -> f32 {
    (projection.y - projection.w) / (projection.x - projection.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::camera::{CameraProjection, OrthographicProjection, PerspectiveProjection};

    fn check(clip_from_view: Mat4, near: f32) {
        let rays = Rays::new(clip_from_view, DMat4::IDENTITY);
        let projection = depth_projection(clip_from_view);
        for ndc in [Vec2::ZERO, Vec2::new(0.7, -0.4), Vec2::new(-1.0, 1.0)] {
            for depth in [0.1_f32, 0.35, 4.0] {
                let at = |parts: [Vec4; 3]| (parts[0] + parts[1] * ndc.x + parts[2] * ndc.y).truncate();
                let place = at(rays.origin) + at(rays.along) * depth;
                assert!((place.z + depth).abs() < 1e-5, "{place} at depth {depth}");
                let clip = clip_from_view * place.extend(1.0);
                assert!((clip.truncate().truncate() / clip.w - ndc).length() < 1e-5, "{clip} is not at {ndc}");
                let z = clip.z / clip.w;
                let back = (projection.y - z * projection.w) / (projection.x - z * projection.z);
                assert!((back - depth).abs() < 1e-3 * depth, "depth {depth} comes back as {back}");
            }
        }
        assert!((near_m(projection) - near).abs() < 1e-5);
    }

    #[test]
    fn rays_and_depths_undo_projections() {
        let lens = PerspectiveProjection { fov: 0.7, aspect_ratio: 1.5, near: 0.02, ..default() };
        check(lens.get_clip_from_view(), 0.02);
        let mut asymmetric = lens.get_clip_from_view();
        asymmetric.z_axis.x = 0.3;
        asymmetric.z_axis.y = -0.1;
        check(asymmetric, 0.02);
        let mut flat = OrthographicProjection { near: -0.5, far: 10.0, ..OrthographicProjection::default_3d() };
        flat.update(3.0, 2.0);
        check(flat.get_clip_from_view(), -0.5);
    }
}
