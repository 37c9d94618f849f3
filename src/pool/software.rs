//! The optics of a pool on the processor, as plain functions: what the pixels on the GPU are held against (paper of 2009,
//! sections 5.1 to 5.3).

use super::{FresnelModel, PoolLook};
use glam::Vec3;

/// What is dissolved where light goes through, as shares.
#[derive(Clone, Copy, Debug, Default, PartialEq, bevy::reflect::Reflect)]
pub struct PoolMixture {
    /// Share of blood.
    pub blood: f32,
    /// Share of bone dust.
    pub dust: f32,
}

/// Refractive index of a mixture (section 5.3).
pub fn refractive_index(look: &PoolLook, mixture: PoolMixture) -> f32 {
    look.water_index + (look.blood_index - look.water_index) * mixture.blood
}

/// Share of the light that is reflected (equation 5, or Schlick 1994), by the cosine of the angle to the normal and the refractive
/// index.
pub fn fresnel(model: FresnelModel, cosine: f32, index: f32) -> f32 {
    let rest = 1.0 - cosine.clamp(0.0, 1.0);
    match model {
        FresnelModel::Paper => rest * rest,
        FresnelModel::Schlick => {
            let straight = ((index - 1.0) / (index + 1.0)).powi(2);
            straight + (1.0 - straight) * rest.powi(5)
        }
    }
}

/// What the meniscus adds to it where so many of five places are above the fluid (algorithm 3), interpolated.
pub fn meniscus(table: &[f32; 6], count: f32) -> f32 {
    let count = count.clamp(0.0, 5.0);
    let low = (count.floor() as usize).min(4);
    table[low] + (table[low + 1] - table[low]) * (count - low as f32)
}

/// Direction of a ray from air in the fluid (equation 7); both vectors have length 1, and the incident one goes against the normal.
pub fn refracted(incident: Vec3, normal: Vec3, index: f32) -> Vec3 {
    incident.refract(normal, 1.0 / index)
}

/// The optical displacement (equation 8): from where a ray enters the fluid to where the refracted ray ends, when the fluid is so
/// deep along the incident ray.
pub fn optical_displacement_m(refracted: Vec3, incident: Vec3, depth_m: f32) -> Vec3 {
    refracted * (depth_m / refracted.dot(incident))
}

/// Share of the light that gets through so many metres.
pub fn transmittance(look: &PoolLook, mixture: PoolMixture, path_m: f32) -> Vec3 {
    let scattering = scattering_per_m(look, mixture).element_sum();
    let absorption = look.water_absorption_per_m + look.blood_absorption_per_m * mixture.blood;
    ((absorption + scattering) * -path_m).exp()
}

/// Share of the light on the surface that comes back out of the fluid itself, when the ray goes through so many metres of it: what
/// each layer scatters, less what is absorbed on the way down to it and up again.
pub fn in_scattered(look: &PoolLook, mixture: PoolMixture, path_m: f32) -> Vec3 {
    let scattering = scattering_per_m(look, mixture);
    let source = look.blood_colour * scattering.x + look.dust_colour * scattering.y;
    let absorption = look.water_absorption_per_m + look.blood_absorption_per_m * mixture.blood;
    let lost = (2.0 * absorption + scattering.element_sum()).max(Vec3::splat(1e-6));
    source / lost * (1.0 - (lost * -path_m).exp())
}

/// Of blood (x) and dust (y).
fn scattering_per_m(look: &PoolLook, mixture: PoolMixture) -> glam::Vec2 {
    glam::Vec2::new(look.blood_scattering_per_m * mixture.blood, look.dust_scattering_per_m * mixture.dust)
}

/// A pixel of the pool: what is seen through it, what it scatters and what it reflects (equations 1 to 6, with absorption along the
/// way in the place of the constant opacity). Everything is radiance, and the light on the surface is given as that of a white
/// sheet. The light that shows the ground comes from above through so many metres more.
pub fn composite(
    look: &PoolLook,
    mixture: PoolMixture,
    ground: Vec3,
    white: Vec3,
    environment: Vec3,
    reflectivity: f32,
    [path_m, light_path_m]: [f32; 2],
) -> Vec3 {
    let water =
        ground * transmittance(look, mixture, path_m + light_path_m) + white * in_scattered(look, mixture, path_m);
    water * (1.0 - reflectivity) + environment * reflectivity
}
