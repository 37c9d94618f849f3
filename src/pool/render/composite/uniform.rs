//! A pool in a view, as the shaders read it (`shaders/pool/pool.wgsl`).

use super::extract::{ExtractedPool, ExtractedSurroundings};
use crate::pool::{FresnelModel, MAX_FOAM};
use crate::render::{OrganLights, finite_within};
use bevy::math::{Affine3A, DMat4, DVec3};
use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;

/// A pool in a view. Twin in `shaders/pool/pool.wgsl`, which says what the numbers are that [`PoolLook`](crate::pool::PoolLook)
/// does not have.
#[derive(Clone, Copy, Debug, Default, ShaderType)]
pub struct PoolUniform {
    /// Pool space to clip space.
    pub clip_from_pool: Mat4,
    /// Pool space to pixels of the target and depth.
    pub target_from_pool: Mat4,
    /// Inverse of it.
    pub pool_from_target: Mat4,
    /// Its third row.
    pub height_row: Vec4,
    /// Its fourth row.
    pub unit_row: Vec4,
    /// Directions in the pool's space to those of the cube map.
    pub environment_from_pool: Mat4,
    /// Place of the eye and 1, or the direction to it and 0.
    pub eye_pool: Vec4,
    /// Least and greatest pixels of the target that may be read.
    pub readable_px: Vec4,
    /// Cells along the sides.
    pub grid_size: Vec2,
    /// Side of a cell, metres.
    pub cell_m: f32,
    /// Height of the calm surface, metres.
    pub level_m: f32,
    /// Pixels per metre where the clip-space w is 1.
    pub pixels_per_metre: f32,
    /// Metres of waves per millimetre in the texels.
    pub metres_per_height: f32,
    /// Highest waves, metres.
    pub greatest_wave_m: f32,
    /// Width of the meniscus, metres.
    pub meniscus_width_m: f32,
    /// What water absorbs, per metre.
    pub water_absorption_per_m: Vec3,
    /// What blood scatters, per metre.
    pub blood_scattering_per_m: f32,
    /// What blood absorbs, per metre.
    pub blood_absorption_per_m: Vec3,
    /// What dust scatters, per metre.
    pub dust_scattering_per_m: f32,
    /// Colour of deep blood.
    pub blood_colour: Vec3,
    /// Refractive index of water.
    pub water_index: f32,
    /// Colour of a paste of dust.
    pub dust_colour: Vec3,
    /// Refractive index of blood.
    pub blood_index: f32,
    /// The table, six numbers.
    pub meniscus: [Vec4; 2],
    /// Brightness of what the meniscus mirrors.
    pub meniscus_light: f32,
    /// Height over the surface beyond which nothing makes a meniscus, metres.
    pub meniscus_reach_m: f32,
    /// 1 with refraction, else 0.
    pub refracts: f32,
    /// 1 for the paper's Fresnel term, 0 for Schlick's.
    pub is_paper_fresnel: f32,
    /// Factor of what the surface mirrors.
    pub environment_strength: f32,
    /// Brightness of the room.
    pub room: f32,
    /// Radius of lamps, metres.
    pub lamp_radius_m: f32,
    /// Size of bubbles, metres.
    pub bubble_m: f32,
    /// Place, one over the square of the radius, amount.
    pub foam: [Vec4; MAX_FOAM],
    /// How many of them there are.
    pub foam_count: u32,
    /// The lights that reach it, in the pool's space.
    pub lights: OrganLights,
}

/// A view onto pools.
pub(super) struct PoolView {
    pub clip_from_view: Mat4,
    pub world_from_view: Mat4,
    /// Where it lies in its target, pixels.
    pub viewport: URect,
}

impl PoolView {
    fn clip_from_pool(&self, world_from_pool: Affine3A) -> DMat4 {
        let view_from_world = self.world_from_view.as_dmat4().inverse();
        self.clip_from_view.as_dmat4() * view_from_world * Mat4::from(world_from_pool).as_dmat4()
    }

    /// The eye's place in the pool's space and 1, or the direction to it and 0.
    fn eye_pool(&self, world_from_pool: Affine3A) -> Vec4 {
        let is_parallel = self.clip_from_view.w_axis.w == 1.0;
        let eye_world = if is_parallel { self.world_from_view.z_axis } else { self.world_from_view.w_axis };
        Mat4::from(world_from_pool).inverse() * eye_world
    }

    /// Whether the surface can be seen from above.
    pub fn is_above(&self, pool: &ExtractedPool) -> bool {
        let eye = self.eye_pool(pool.world_from_pool);
        eye.is_finite() && eye.z > pool.level_m * eye.w
    }

    /// The pixels of the target that the surface may cover, and those beside them that may be seen refracted.
    pub fn pixels(&self, pool: &ExtractedPool) -> URect {
        /// Refracted rays seldom end farther outside.
        const BESIDE_PX: f32 = 24.0;
        let clip_from_pool = self.clip_from_pool(pool.world_from_pool).as_mat4();
        let (mut least, mut most) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
        for corner in 0..8 {
            let x = if corner & 1 == 0 { pool.wet_m.min.x } else { pool.wet_m.max.x };
            let y = if corner & 2 == 0 { pool.wet_m.min.y } else { pool.wet_m.max.y };
            let wave_m = if corner & 4 == 0 { -pool.look.greatest_wave_m } else { pool.look.greatest_wave_m };
            let clip = clip_from_pool * Vec4::new(x, y, pool.level_m + wave_m, 1.0);
            // Towards or behind the eye: anywhere.
            if clip.w < 1e-6 {
                return self.viewport;
            }
            let ndc = Vec2::new(clip.x, -clip.y) / clip.w;
            (least, most) = (least.min(ndc), most.max(ndc));
        }
        let (corner, size) = (self.viewport.min.as_vec2(), self.viewport.size().as_vec2());
        let pixel = |ndc: Vec2| (ndc * 0.5 + 0.5) * size;
        let seen = Rect::from_corners(pixel(least), pixel(most)).intersect(Rect::from_corners(Vec2::ZERO, size));
        if seen.is_empty() {
            return URect::EMPTY;
        }
        let within = |place: Vec2| (place.clamp(Vec2::ZERO, size) + corner).as_uvec2();
        URect { min: within(seen.min.floor() - BESIDE_PX), max: within(seen.max.ceil() + BESIDE_PX) }
    }

    /// The uniform of a pool in this view; `None` where its numbers are not finite.
    pub fn uniform(
        &self,
        pool: &ExtractedPool,
        lights: OrganLights,
        surroundings: Option<&ExtractedSurroundings>,
        readable: URect,
    ) -> Option<PoolUniform> {
        let clip_from_pool = self.clip_from_pool(pool.world_from_pool);
        let (corner, size) = (self.viewport.min.as_dvec2(), self.viewport.size().as_dvec2());
        let half = DVec3::new(0.5 * size.x, -0.5 * size.y, 1.0);
        let middle = (corner + 0.5 * size).extend(0.0);
        let target_from_pool = DMat4::from_translation(middle) * DMat4::from_scale(half) * clip_from_pool;
        let pool_from_target = target_from_pool.inverse();
        let look = &pool.look;
        let world_from_pool = Mat4::from(pool.world_from_pool);
        let mut environment_from_pool = Mat4::IDENTITY;
        let mut environment_strength = look.environment_strength;
        if let Some(around) = surroundings {
            let mirror = Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0));
            environment_from_pool = mirror * Mat4::from_quat(around.rotation.inverse()) * world_from_pool;
            environment_strength *= finite_within(around.intensity, 0.0, 1e9, 0.0);
        }
        let has_meniscus = look.meniscus_width_m > 0.0;
        let table = if has_meniscus { look.meniscus } else { [0.0; 6] };
        let mut foam = [Vec4::ZERO; MAX_FOAM];
        for (slot, patch) in foam.iter_mut().zip(&pool.foam) {
            let per_square = 1.0 / (patch.radius_m * patch.radius_m).max(1e-12);
            *slot = patch.place_m.extend(per_square).extend(patch.amount.clamp(0.0, 1.0));
        }
        let uniform = PoolUniform {
            clip_from_pool: clip_from_pool.as_mat4(),
            target_from_pool: target_from_pool.as_mat4(),
            pool_from_target: pool_from_target.as_mat4(),
            height_row: pool_from_target.row(2).as_vec4(),
            unit_row: pool_from_target.row(3).as_vec4(),
            environment_from_pool,
            eye_pool: self.eye_pool(pool.world_from_pool),
            readable_px: readable.min.as_vec2().extend(readable.max.x as f32).extend(readable.max.y as f32),
            grid_size: pool.grid.size().as_vec2(),
            cell_m: pool.grid.cell_m(),
            level_m: pool.level_m,
            pixels_per_metre: 0.5 * self.viewport.height() as f32 * self.clip_from_view.y_axis.y,
            metres_per_height: 1e-3 * look.wave_height,
            greatest_wave_m: look.greatest_wave_m,
            meniscus_width_m: look.meniscus_width_m.max(1e-9),
            water_absorption_per_m: look.water_absorption_per_m,
            blood_scattering_per_m: look.blood_scattering_per_m,
            blood_absorption_per_m: look.blood_absorption_per_m,
            dust_scattering_per_m: look.dust_scattering_per_m,
            blood_colour: look.blood_colour,
            water_index: look.water_index,
            dust_colour: look.dust_colour,
            blood_index: look.blood_index,
            meniscus: [Vec4::new(table[0], table[1], table[2], table[3]), Vec4::new(table[4], table[5], 0.0, 0.0)],
            meniscus_light: look.meniscus_light,
            meniscus_reach_m: look.meniscus_reach_m,
            refracts: f32::from(u8::from(look.refracts)),
            is_paper_fresnel: f32::from(u8::from(look.fresnel == FresnelModel::Paper)),
            environment_strength,
            room: look.room,
            lamp_radius_m: look.lamp_radius_m,
            bubble_m: look.bubble_m,
            foam,
            foam_count: pool.foam.len() as u32,
            lights: lights_in(lights, pool.world_from_pool.inverse()),
        };
        let is_finite = uniform.pool_from_target.is_finite() && uniform.target_from_pool.is_finite();
        is_finite.then_some(uniform)
    }
}

/// Lights with their places and directions in the pool's space.
fn lights_in(mut lights: OrganLights, pool_from_world: Affine3A) -> OrganLights {
    for light in &mut lights.lights {
        light.position_world_m = pool_from_world.transform_point3(light.position_world_m);
        light.direction_world = pool_from_world.transform_vector3(light.direction_world);
    }
    lights
}
