//! The highlight at a point, on the CPU: the twin of `shaders/highlights/highlights.wgsl`, without its tables.

use super::Highlights;
use super::profile::{LEAST_RING_RADIUS_M, RingProfile, flat_scale, ring_tilt_rad};
use crate::render::LightUniform;
use bevy::prelude::*;
use std::f32::consts::PI;

/// Radiance in candela per square metre that an organ's surface mirrors from one light to the eye.
///
/// `normal_world` is the unit normal on the eye's side, film and grain included. `gloss` is the gloss map's value, 0 to
/// 1; [`HighlightCover::UnderDrops`](super::HighlightCover::UnderDrops) takes values beyond the neutral one for that.
pub fn highlight_radiance(
    highlights: &Highlights,
    light: &LightUniform,
    eye_world_m: Vec3,
    point_world_m: Vec3,
    normal_world: Vec3,
    gloss: f32,
) -> Vec3 {
    let highlights = highlights.clamped();
    let (wetness, shine) = wetness_and_shine(&highlights, gloss);
    let to_eye = (eye_world_m - point_world_m).normalize_or_zero();
    let path = light.position_world_m - point_world_m;
    let to_light = match light.kind {
        LightUniform::DIRECTIONAL => -light.direction_world,
        _ => path.normalize_or_zero(),
    };
    let halfway = (to_light + to_eye).normalize_or_zero();
    let (facing, lit) = (to_eye.dot(halfway), normal_world.dot(to_light));
    if facing <= 1e-3 || lit <= 0.0 {
        return Vec3::ZERO;
    }
    let cosine = normal_world.dot(halfway);
    let flat = (normal_world - cosine * halfway) * flat_scale(cosine);
    let lobe = |roughness_rad: f32| match light.kind {
        LightUniform::RING => {
            let ring_radius_m = light.ring_radius_m.max(LEAST_RING_RADIUS_M);
            let ring_tilt_rad = ring_tilt_rad(ring_radius_m, path.length() * facing);
            let blur = 2.0 * (roughness_rad / ring_tilt_rad) * (roughness_rad / ring_tilt_rad);
            let along_axis = light.direction_world.dot(halfway);
            let axis_flat = light.direction_world - along_axis * halfway;
            let squared = (along_axis * along_axis + blur).max(1e-4);
            let stretch = (1.0 + axis_flat.length_squared() / squared).sqrt();
            let stretched = flat + axis_flat * flat.dot(light.direction_world) / (squared * (stretch + 1.0));
            stretch * RingProfile { ring_tilt_rad, roughness_rad }.density(stretched.length())
        }
        _ => {
            let tilt = flat.length() / roughness_rad;
            (-0.5 * tilt * tilt).exp() / (2.0 * PI * roughness_rad * roughness_rad)
        }
    };
    let density = lobe(highlights.dry_roughness) * (1.0 - wetness) + lobe(highlights.wet_roughness) * wetness;
    let grazing = 1.0 - facing.min(1.0);
    let fresnel = highlights.reflectance + (1.0 - highlights.reflectance) * grazing.powi(5);
    let mirrored = highlights.strength * shine * fresnel * lit * density / (4.0 * facing * facing);
    light.illuminance_lux(point_world_m) * mirrored
}

/// How wet a gloss is, and how much of the reflection a dull place keeps; both 0 to 1.
fn wetness_and_shine(highlights: &Highlights, gloss: f32) -> (f32, f32) {
    const NEUTRAL: f32 = crate::organ::surface::NEUTRAL_GLOSS as f32 / 255.0;
    let wetness = ((gloss - NEUTRAL) / (1.0 - NEUTRAL)).clamp(0.0, 1.0);
    let is_over = highlights.cover == super::HighlightCover::OverDrops;
    (if is_over { wetness } else { 0.0 }, (gloss / NEUTRAL).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::highlights::HighlightCover;

    fn lamp(colour: f32) -> LightUniform {
        LightUniform {
            colour: Vec3::splat(colour),
            kind: LightUniform::RING,
            position_world_m: Vec3::new(0.0, 0.0, 0.2),
            direction_world: Vec3::NEG_Z,
            ring_radius_m: 0.004,
            cone_offset: 1.0,
            ..default()
        }
    }

    fn at_the_origin(highlights: &Highlights, light: &LightUniform, tilt_rad: f32, gloss: f32) -> f32 {
        let normal = Vec3::new(tilt_rad.sin(), 0.0, tilt_rad.cos());
        highlight_radiance(highlights, light, Vec3::new(0.0, 0.0, 0.2), Vec3::ZERO, normal, gloss).x
    }

    #[test]
    fn a_mirror_shows_the_lamp_times_the_reflectance() {
        // All that is mirrored, over all tilts: reflectance / 4 of the illuminance.
        let highlights = Highlights { dry_roughness: 0.02, ..default() };
        let light = lamp(100.0);
        let step = 0.000_1;
        let sum: f32 = (0..3000)
            .map(|k| {
                let tilt = (k as f32 + 0.5) * step;
                2.0 * PI * tilt * step * at_the_origin(&highlights, &light, tilt, 0.5)
            })
            .sum();
        let wanted = 0.02 / 4.0 * light.illuminance_lux(Vec3::ZERO).x;
        assert!((sum / wanted - 1.0).abs() < 0.01, "{sum} instead of {wanted}");
    }

    #[test]
    fn wet_is_sharp_and_burnt_is_dull() {
        let highlights = Highlights { dry_roughness: 0.1, wet_roughness: 0.004, ..default() };
        let light = lamp(100.0);
        let ring_tilt = ring_tilt_rad(0.004, 0.2);
        let [wet, skin, singed, burnt] = [1.0, 128.0 / 255.0, 64.0 / 255.0, 0.0].map(|gloss| {
            (at_the_origin(&highlights, &light, ring_tilt, gloss), at_the_origin(&highlights, &light, 0.05, gloss))
        });
        assert!(wet.0 > 5.0 * skin.0 && wet.1 < 0.01 * skin.1, "wet {wet:?}, skin {skin:?}");
        assert!((singed.0 / skin.0 - 0.5).abs() < 1e-3 && burnt == (0.0, 0.0));
        let under = Highlights { cover: HighlightCover::UnderDrops, ..highlights };
        assert_eq!(at_the_origin(&under, &light, ring_tilt, 1.0), skin.0);
    }

    #[test]
    fn nothing_makes_it_other_than_finite() {
        let odd = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e-30, 1e30];
        for value in odd {
            let highlights = Highlights {
                strength: value,
                dry_roughness: value,
                wet_roughness: value,
                reflectance: value,
                ..default()
            };
            for gloss in [0.0, 0.5, 1.0] {
                assert!(at_the_origin(&highlights, &lamp(100.0), 0.01, gloss).is_finite(), "{value}");
            }
        }
        let here = lamp(1.0).position_world_m;
        assert!(highlight_radiance(&default(), &lamp(1.0), here, here, Vec3::Z, 0.5).is_finite());
    }
}
