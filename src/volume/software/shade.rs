//! Light on a volume's picture (paper of 2009, section 5.4).

use super::{NormalImage, ViewRays, VolumeImage, smooth};
use crate::volume::{MAX_SMOOTHING_PASSES, SmoothedNormals, WetShading};
use bevy::reflect::Reflect;
use glam::{UVec2, Vec3, Vec4};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Light that arrives at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct IncidentLight {
    /// Unit vector to the light, in the world.
    pub to_light: Vec3,
    /// Illuminance of a surface that faces it, by linear colour, lux.
    pub illuminance_lux: Vec3,
    /// Share of it that surfaces in any direction get, for light that walls throw back.
    pub ambient_fraction: f32,
}

/// Lights a picture. Returns radiance (linear, premultiplied, candela per square metre) and opacity for each pixel.
///
/// Diffuse light falls on the picture's colours; a film of water reflects by Blinn's lobe and Schlick's approximation of Fresnel's
/// law. Which of them go by smoothed normals is up to the [`WetShading`]; where no light falls on the volume, its own colours are
/// returned. `ambient` is the radiance that a white surface has without
/// lights; `lights` adds the lights that reach a place of the world (metres) to a list.
pub fn shade(
    image: &VolumeImage,
    rays: &ViewRays,
    wet: &WetShading,
    ambient: Vec3,
    lights: impl Fn(Vec3, &mut Vec<IncidentLight>) + Sync,
) -> Vec<[f32; 4]> {
    let own = NormalImage::new(image, rays);
    let film = match wet.smoothed {
        SmoothedNormals::None => own.clone(),
        SmoothedNormals::Reflections | SmoothedNormals::All => {
            smooth(&own, wet.passes.min(MAX_SMOOTHING_PASSES), wet.edge_voxels)
        }
    };
    let diffuse_normals = if wet.smoothed == SmoothedNormals::All { &film } else { &own };
    let width = image.size_px.x.max(1) as usize;
    let mut lit = image.colour.clone();
    lit.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let mut arriving = Vec::new();
        for (x, texel) in row.iter_mut().enumerate() {
            let place = y * width + x;
            let (Some(normal), Some(film)) = (diffuse_normals.normal(place), film.normal(place)) else {
                *texel = [0.0; 4];
                continue;
            };
            if !wet.is_shaded {
                continue;
            }
            let ray = rays.ray(UVec2::new(x as u32, y as u32));
            let at = rays.world_from_voxel().transform_point3(ray.at(image.depth_m[place]));
            let to_viewer = rays.to_viewer(ray);
            arriving.clear();
            lights(at, &mut arriving);
            let (mut diffuse, mut shine) = (ambient * PI, Vec3::ZERO);
            for light in &arriving {
                diffuse += light.illuminance_lux * (normal.dot(light.to_light).max(0.0) + light.ambient_fraction);
                shine += light.illuminance_lux * reflected(film, light.to_light, to_viewer, wet.shine_exponent);
            }
            let colour = Vec4::from_array(*texel);
            let radiance = (colour.truncate() * diffuse + shine * (wet.shine * colour.w)) / PI;
            *texel = radiance.extend(colour.w).to_array();
        }
    });
    lit
}

/// Reflectance of water for light that meets it at a right angle.
const WATER: f32 = 0.02;

/// What a film of water reflects to the viewer, times pi and the cosine of the incident light.
fn reflected(normal: Vec3, to_light: Vec3, to_viewer: Vec3, exponent: f32) -> f32 {
    let halfway = (to_light + to_viewer).normalize_or_zero();
    // The factor keeps the reflected light the same for all exponents.
    let lobe = normal.dot(halfway).max(0.0).powf(exponent) * (exponent + 2.0) / 8.0;
    let fresnel = WATER + (1.0 - WATER) * (1.0 - to_viewer.dot(halfway).max(0.0)).powi(5);
    normal.dot(to_light).max(0.0) * lobe * fresnel
}
