//! What a lamp sees on its shadow map, and how much of its light arrives: the CPU twin of `tool_shadows.wgsl`.

use bevy::math::{Affine3A, DMat4, Vec3A};
use bevy::prelude::*;
use std::f32::consts::TAU;

/// Look-ups into the shadow map per pixel.
pub const SHADOW_TAPS: u32 = 12;

/// Least radius of the look-ups in texels: below it single texels would show.
const LEAST_RADIUS_PX: f32 = 1.0;

/// A lamp's shadow map as a camera: where points lie on it, and how the look-ups around them are spread.
///
/// The map is square, looks along the lamp's -Z, and stores depth as Bevy does: reversed and without a far end, near
/// distance over distance. 0 is empty. [`ToolShadows::to_lens`](super::ToolShadows::to_lens) makes one.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct ShadowLens {
    /// The lamp's space, metres, to the world: a rotation and a translation.
    pub world_from_lamp: Affine3A,
    /// Tangent of the half angle from the axis to the middle of each side.
    pub tan_half_angle: f32,
    /// Nearest distance from the lamp along its axis at which tools cast, metres.
    pub near_m: f32,
    /// Width and height of the map in texels.
    pub resolution_px: u32,
    /// Radius of the disk that look-ups are spread over, on the surface that receives, metres.
    pub softness_m: f32,
    /// Share of the light that a full shadow takes, 0 to 1.
    pub strength: f32,
}

/// Where a point lies on a shadow map.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct ShadowMapPlace {
    /// Texels from the left and upper border.
    pub texel: Vec2,
    /// Depth as the map stores it: greater is nearer.
    pub depth: f32,
}

impl ShadowLens {
    /// World to clip space of the map.
    pub fn clip_from_world(&self) -> Mat4 {
        let scale = 1.0 / self.tan_half_angle;
        let clip_from_lamp = Mat4::from_cols(
            Vec4::X * scale,
            Vec4::Y * scale,
            Vec4::new(0.0, 0.0, 0.0, -1.0),
            Vec4::new(0.0, 0.0, self.near_m, 0.0),
        );
        clip_from_lamp * Mat4::from(self.world_from_lamp.inverse())
    }

    /// Clip space of a view to that of the map. In double precision: narrow views far from the origin leave few bits.
    pub fn clip_from_view_clip(&self, clip_from_world: Mat4) -> Mat4 {
        (self.clip_from_world().as_dmat4() * DMat4::inverse(&clip_from_world.as_dmat4())).as_mat4()
    }

    /// Where a point of the world lies on the map; `None` behind the lamp.
    pub fn place(&self, point_world_m: Vec3) -> Option<ShadowMapPlace> {
        let clip = self.clip_from_world() * point_world_m.extend(1.0);
        let ndc = clip.truncate() / clip.w;
        let texel = (ndc.truncate() * Vec2::new(0.5, -0.5) + 0.5) * self.resolution_px as f32;
        (clip.w > 0.0).then_some(ShadowMapPlace { texel, depth: ndc.z })
    }

    /// The point of the world at a place of the map, as far along the axis as `distance_m`.
    pub fn point_world_m(&self, texel: Vec2, distance_m: f32) -> Vec3 {
        self.world_from_lamp.transform_point3(Vec3::from(self.ray(texel) * distance_m))
    }

    /// Direction in the world from the lamp through a place of the map; its length along the axis is 1.
    pub fn direction_world(&self, texel: Vec2) -> Vec3 {
        self.world_from_lamp.transform_vector3a(self.ray(texel)).into()
    }

    fn ray(&self, texel: Vec2) -> Vec3A {
        let ndc = (texel / self.resolution_px as f32 - 0.5) * Vec2::new(2.0, -2.0);
        (ndc * self.tan_half_angle).extend(-1.0).into()
    }

    /// Radius of the look-ups, in texels, for a surface at a depth of the map.
    pub fn radius_px(&self, depth: f32) -> f32 {
        let (least, greatest) = self.radius_bounds_px();
        (self.radius_at_near_px() * depth).clamp(least, greatest)
    }

    pub(super) fn radius_at_near_px(&self) -> f32 {
        self.softness_m * self.resolution_px as f32 / (2.0 * self.tan_half_angle * self.near_m)
    }

    /// Beyond an eighth of the map twelve look-ups are noise and no blur.
    pub(super) fn radius_bounds_px(&self) -> (f32, f32) {
        (LEAST_RADIUS_PX, (self.resolution_px as f32 / 8.0).max(LEAST_RADIUS_PX))
    }

    /// Share of the look-ups around a point that find a caster in front of it, 0 to 1.
    ///
    /// `map` holds the depths row by row from the top; `turn` in 0 to 1 rotates the look-ups, see [`shadow_noise`].
    /// The outermost texels must be empty, as they are on the GPU: beyond the map is light.
    pub fn occlusion(&self, map: &[f32], point_world_m: Vec3, turn: f32) -> f32 {
        let Some(place) = self.place(point_world_m) else { return 0.0 };
        let radius_px = self.radius_px(place.depth);
        let golden = Vec2::new(-0.737_368_9, 0.675_490_3);
        let mut direction = Vec2::from_angle(TAU * turn);
        let last = self.resolution_px as i32 - 1;
        let mut blocked = 0;
        for tap in 0..SHADOW_TAPS {
            let offset = direction * (radius_px * ((tap as f32 + 0.5) / SHADOW_TAPS as f32).sqrt());
            let texel = (place.texel + offset).floor().as_ivec2().clamp(IVec2::ZERO, IVec2::splat(last));
            let stored = map.get((texel.y * (last + 1) + texel.x) as usize).copied().unwrap_or(0.0);
            blocked += u32::from(stored > place.depth);
            direction = golden.rotate(direction);
        }
        blocked as f32 / SHADOW_TAPS as f32
    }

    /// What is left of the light at a point under a share of occlusion.
    pub fn light_left(&self, occlusion: f32) -> f32 {
        1.0 - self.strength * occlusion
    }
}

/// By which part of a turn the look-ups of a pixel are rotated: interleaved gradient noise (Jimenez 2014), so that
/// neighbours differ and the eye averages them.
pub fn shadow_noise(pixel: UVec2) -> f32 {
    let inner = pixel.as_vec2().dot(Vec2::new(0.067_110_56, 0.005_837_15)).fract();
    (52.982_918 * inner).fract()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    fn lens() -> ShadowLens {
        let world_from_lamp = Transform::from_xyz(0.1, 0.2, 0.3).looking_at(Vec3::new(0.02, -0.01, 0.0), Vec3::Y);
        ShadowLens {
            world_from_lamp: world_from_lamp.compute_affine(),
            tan_half_angle: 0.25,
            near_m: 0.01,
            resolution_px: 512,
            softness_m: 0.002,
            strength: 0.6,
        }
    }

    #[test]
    fn places_and_points_are_inverse() {
        let lens = lens();
        for (x, y, distance_m) in [(256.0, 256.0, 0.3), (10.0, 500.0, 0.05), (400.5, 33.25, 2.0)] {
            let texel = Vec2::new(x, y);
            let place = lens.place(lens.point_world_m(texel, distance_m)).expect("before the lamp");
            assert!(place.texel.distance(texel) < 0.01, "{place:?}");
            assert!((place.depth * distance_m / lens.near_m - 1.0).abs() < 1e-4, "{place:?}");
        }
        let behind = lens.point_world_m(Vec2::splat(256.0), -0.1);
        assert_eq!(lens.place(behind), None);
    }

    #[test]
    fn look_ups_reach_the_softness_on_the_surface() {
        let lens = lens();
        for distance_m in [0.1_f32, 0.3, 0.7] {
            let texel_m = 2.0 * lens.tan_half_angle * distance_m / lens.resolution_px as f32;
            let radius_m = lens.radius_px(lens.near_m / distance_m) * texel_m;
            assert!((radius_m - 0.002).abs() < 1e-6, "{radius_m} at {distance_m}");
        }
    }

    /// Behind a straight edge the mean over all turns is the part of a disk beyond a chord.
    #[test]
    fn a_straight_edge_fades_as_a_disk_does() {
        let lens = lens();
        let size = lens.resolution_px as usize;
        // The left half is covered by something at 10 cm.
        let map: Vec<f32> = (0..size * size).map(|i| if i % size < size / 2 { 0.1 } else { 0.0 }).collect();
        let distance_m = 0.3;
        let radius_px = lens.radius_px(lens.near_m / distance_m);
        for share in [-1.2_f32, -0.8, -0.4, 0.0, 0.3, 0.6, 0.9, 1.2] {
            let point = lens.point_world_m(Vec2::new(256.0 + share * radius_px, 250.3), distance_m);
            let turns = 360;
            let mean = (0..turns).map(|turn| lens.occlusion(&map, point, turn as f32 / turns as f32)).sum::<f32>()
                / turns as f32;
            let clamped = share.clamp(-1.0, 1.0);
            let wanted = 0.5 - (clamped * (1.0 - clamped * clamped).sqrt() + clamped.asin()) / PI;
            assert!((mean - wanted).abs() < 0.03, "{mean} instead of {wanted} at {share}");
        }
    }

    #[test]
    fn noise_fills_its_range_in_every_neighbourhood() {
        for corner in [UVec2::ZERO, UVec2::new(311, 77)] {
            let mut values: Vec<f32> = (0..9).map(|i| shadow_noise(corner + UVec2::new(i % 3, i / 3))).collect();
            values.sort_by(f32::total_cmp);
            assert!(values[0] >= 0.0 && values[8] < 1.0);
            for (i, value) in values.iter().enumerate() {
                assert!((value - (i as f32 + 0.5) / 9.0).abs() < 0.12, "{values:?}");
            }
        }
    }
}
