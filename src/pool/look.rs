//! How a pool looks (paper of 2009, sections 5.1 to 5.3).

use bevy::ecs::VariantDefaults;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Which share of the light a surface reflects, by the angle to its normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum FresnelModel {
    /// `(1 - cos)^2` (paper of 2009, equation 5): nothing where one looks straight down.
    Paper,
    /// Schlick 1994, from what the refractive index reflects straight down.
    #[default]
    Schlick,
}

/// How a pool is drawn. Numbers out of range are clamped where they are used; for those that are not finite the default's are
/// taken.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
#[serde(default)]
pub struct PoolLook {
    /// Waves are drawn so many times as high as the pressure lifts the surface, 0 to 100.
    pub wave_height: f32,
    /// Highest and lowest that waves are drawn, metres, 0 to 0.1.
    pub greatest_wave_m: f32,
    /// Light that water absorbs, red, green and blue, per metre.
    pub water_absorption_per_m: Vec3,
    /// The same of blood without water.
    pub blood_absorption_per_m: Vec3,
    /// Light that blood without water scatters, per metre.
    pub blood_scattering_per_m: f32,
    /// Light that a paste of bone dust without water scatters, per metre.
    pub dust_scattering_per_m: f32,
    /// Colour of the light that blood scatters, linear red, green and blue; in deep blood most of it is absorbed again.
    pub blood_colour: Vec3,
    /// Colour of the light that bone dust scatters.
    pub dust_colour: Vec3,
    /// Refractive index of water, 1 to 3.
    pub water_index: f32,
    /// Refractive index of blood, 1 to 3; in between it depends linearly on the share of blood.
    pub blood_index: f32,
    /// Whether the pool's ground is seen refracted.
    pub refracts: bool,
    /// What the surface reflects.
    pub fresnel: FresnelModel,
    /// Reflectivity that the meniscus adds where 0 to 5 of a pixel and its four neighbours lie above the fluid (paper of 2009,
    /// algorithm 3), 0 to 1; in between interpolated.
    pub meniscus: [f32; 6],
    /// Width of the meniscus, metres, 0 to 0.1; at least a pixel where it is not 0.
    pub meniscus_width_m: f32,
    /// How many times as bright as a white sheet is what it mirrors, 0 to 1000: it is so curved that a lamp is always among it.
    pub meniscus_light: f32,
    /// What is higher than this over the surface makes no meniscus, metres: tools that hang over the pool.
    pub meniscus_reach_m: f32,
    /// Brightness of what the surface reflects, 0 to 100.
    pub environment_strength: f32,
    /// Brightness of the room in the built-in surroundings, as a share of what a white sheet beside the pool would have, 0 to 10.
    pub room: f32,
    /// Radius of the discs as which Bevy's point and spot lights are reflected, metres, 0.0001 to 1.
    pub lamp_radius_m: f32,
    /// Size of the foam's bubbles, metres, 1e-5 to 0.01.
    pub bubble_m: f32,
}

impl Default for PoolLook {
    fn default() -> Self {
        Self {
            wave_height: 3.0,
            greatest_wave_m: 1e-3,
            water_absorption_per_m: Vec3::new(3.0, 1.0, 1.5),
            // Oxygenated blood: nearly all green and blue is gone after a few tenths of a millimetre, red after some.
            blood_absorption_per_m: Vec3::new(250.0, 5200.0, 4300.0),
            blood_scattering_per_m: 500.0,
            dust_scattering_per_m: 2500.0,
            blood_colour: Vec3::new(0.33, 0.07, 0.055),
            dust_colour: Vec3::new(0.72, 0.66, 0.55),
            water_index: 1.33,
            blood_index: 1.39,
            refracts: true,
            fresnel: FresnelModel::Schlick,
            meniscus: [0.0, 0.08, 0.05, 0.02, 0.01, 0.0],
            meniscus_width_m: 2.5e-4,
            meniscus_light: 5.0,
            meniscus_reach_m: 2e-3,
            environment_strength: 1.0,
            room: 0.4,
            lamp_radius_m: 0.03,
            bubble_m: 3e-4,
        }
    }
}

impl PoolLook {
    /// The same with all numbers in range.
    pub fn sane(&self) -> Self {
        let otherwise = Self::default();
        let colour = |of: Vec3, high: f32, otherwise: Vec3| {
            Vec3::from_array(std::array::from_fn(|channel| within(of[channel], 0.0, high, otherwise[channel])))
        };
        const DENSEST_PER_M: f32 = 1e6;
        Self {
            wave_height: within(self.wave_height, 0.0, 100.0, otherwise.wave_height),
            greatest_wave_m: within(self.greatest_wave_m, 0.0, 0.1, otherwise.greatest_wave_m),
            water_absorption_per_m: colour(
                self.water_absorption_per_m,
                DENSEST_PER_M,
                otherwise.water_absorption_per_m,
            ),
            blood_absorption_per_m: colour(
                self.blood_absorption_per_m,
                DENSEST_PER_M,
                otherwise.blood_absorption_per_m,
            ),
            blood_scattering_per_m: within(
                self.blood_scattering_per_m,
                0.0,
                DENSEST_PER_M,
                otherwise.blood_scattering_per_m,
            ),
            dust_scattering_per_m: within(
                self.dust_scattering_per_m,
                0.0,
                DENSEST_PER_M,
                otherwise.dust_scattering_per_m,
            ),
            blood_colour: colour(self.blood_colour, 1.0, otherwise.blood_colour),
            dust_colour: colour(self.dust_colour, 1.0, otherwise.dust_colour),
            water_index: within(self.water_index, 1.0, 3.0, otherwise.water_index),
            blood_index: within(self.blood_index, 1.0, 3.0, otherwise.blood_index),
            refracts: self.refracts,
            fresnel: self.fresnel,
            meniscus: std::array::from_fn(|count| within(self.meniscus[count], 0.0, 1.0, otherwise.meniscus[count])),
            meniscus_width_m: within(self.meniscus_width_m, 0.0, 0.1, otherwise.meniscus_width_m),
            meniscus_light: within(self.meniscus_light, 0.0, 1e3, otherwise.meniscus_light),
            meniscus_reach_m: within(self.meniscus_reach_m, 1e-6, 10.0, otherwise.meniscus_reach_m),
            environment_strength: within(self.environment_strength, 0.0, 100.0, otherwise.environment_strength),
            room: within(self.room, 0.0, 10.0, otherwise.room),
            lamp_radius_m: within(self.lamp_radius_m, 1e-4, 1.0, otherwise.lamp_radius_m),
            bubble_m: within(self.bubble_m, 1e-5, 0.01, otherwise.bubble_m),
        }
    }
}

fn within(value: f32, low: f32, high: f32, otherwise: f32) -> f32 {
    if value.is_finite() { value.clamp(low, high) } else { otherwise }
}
