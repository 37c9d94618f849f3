//! The profile of a ring light's reflection (paper of 2002, sections 3.4 and 4.3).
//!
//! A point on the ring is mirrored to the eye where the surface normal lies halfway between the directions to both. With
//! the eye in the middle of a ring of radius `a`, seen from a point at distance `D`, that is a tilt `t0` of the normal
//! with `tan(2 t0) = a / D`, whatever the direction: a circle in the plane of tilts. A rough surface has normals that
//! deviate from the smooth one by a Gaussian in two dimensions with standard deviation `s`, so what is seen is the
//! circle convolved with that:
//!
//! `p(t) = exp(-(t^2 + t0^2) / (2 s^2)) I0(t t0 / s^2) / (2 pi s^2)`
//!
//! In ring radii, `t / t0`, the circle stays where it is at every distance, and only its width `s / t0` changes. So a
//! table holds `p` over `t / t0` for a few distances ([`DistanceSlices`]), and between two of them it is interpolated
//! without a second ring appearing.

use bevy::reflect::Reflect;
use std::f32::consts::PI;

/// Texels of a profile.
pub const PROFILE_TEXELS: usize = 256;
/// Width and height of the radial ramp in texels.
pub const RAMP_TEXELS: usize = 64;
/// How far a profile reaches beyond the ring, in standard deviations.
pub const PROFILE_REACH: f32 = 5.0;

/// Smallest ring that is told from a point, metres.
pub(super) const LEAST_RING_RADIUS_M: f32 = 1e-6;
/// Neighbouring slices differ in distance by no more than this: interpolating then errs by less than a hundredth.
const MAX_SLICE_RATIO: f32 = 1.2;
/// Nothing nearer than the farthest by more than this gets slices of its own.
const MAX_RANGE_RATIO: f32 = 16.0;
/// Distances that a table is made for, metres.
const DISTANCE_BOUNDS_M: (f32, f32) = (1e-4, 1e4);
/// Narrowest ring, in ring radii, that the texels of a profile still show.
const LEAST_WIDTH: f32 = 0.01;
/// The ramp's centre lies on a texel, so that the tip of the cone is not cut off: one texel less on its far side.
const RAMP_CENTRE: usize = RAMP_TEXELS / 2;

/// `exp(-z) I0(z)` for `z >= 0`, where `I0` is the modified Bessel function of order zero. Never overflows; the relative
/// error is below 3e-7 (Abramowitz and Stegun 1964, 9.8.1 and 9.8.2).
pub fn bessel_i0_scaled(z: f32) -> f32 {
    let polynomial = |coefficients: &[f32], t: f32| coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c);
    if z < 3.75 {
        let t = (z / 3.75) * (z / 3.75);
        let near = [1.0, 3.515_622_9, 3.089_942_4, 1.206_749_2, 0.265_973_2, 0.036_076_8, 0.004_581_3];
        return (-z).exp() * polynomial(&near, t);
    }
    let far = [
        0.398_942_3,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    polynomial(&far, 3.75 / z) / z.sqrt()
}

/// Tilt of the normal, radians, at which a ring of this radius around the eye is mirrored from this distance.
pub fn ring_tilt_rad(ring_radius_m: f32, distance_m: f32) -> f32 {
    0.5 * ring_radius_m.max(0.0).atan2(distance_m)
}

/// A ring seen in a rough surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct RingProfile {
    /// Tilt at which a smooth surface would mirror the ring, radians.
    pub ring_tilt_rad: f32,
    /// Standard deviation of the normal in each of the two directions, radians; above zero.
    pub roughness_rad: f32,
}

impl RingProfile {
    /// How much of the light is mirrored where the normal is tilted by `tilt_rad`, per square radian of tilts. Over all
    /// tilts it sums to one.
    pub fn density(self, tilt_rad: f32) -> f32 {
        self.relative_density(tilt_rad) / (2.0 * PI * self.roughness_rad * self.roughness_rad)
    }

    /// The density times `2 pi s^2`: between 0 and 1, and 1 for no ring and no tilt.
    fn relative_density(self, tilt_rad: f32) -> f32 {
        let (tilt, ring) = (tilt_rad / self.roughness_rad, self.ring_tilt_rad / self.roughness_rad);
        (-0.5 * (tilt - ring) * (tilt - ring)).exp() * bessel_i0_scaled(tilt * ring)
    }
}

/// Ring radii up to which a profile reaches at a distance. All rows of a table reach as far as that of the farthest, so
/// that one filtered look-up interpolates between them. The shader computes the same.
pub fn profile_domain(ring_radius_m: f32, distance_m: f32, roughness_rad: f32) -> f32 {
    1.0 + PROFILE_REACH * 2.0 * roughness_rad * distance_m / ring_radius_m.max(LEAST_RING_RADIUS_M)
}

/// The distances for which a table has profiles: evenly in their logarithm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct DistanceSlices {
    /// Distance of the first, metres.
    pub nearest_m: f32,
    /// Distance of the last, metres.
    pub farthest_m: f32,
    /// How many there are, 2 or more.
    pub count: u32,
}

impl DistanceSlices {
    /// As few slices as do for a range of distances, at most 17: where one end is more than 16 times as far as the
    /// other, the near end is cut off. A range that is empty, upside down or not finite gives two slices somewhere.
    pub fn covering(nearest_m: f32, farthest_m: f32) -> Self {
        let (low, high) = DISTANCE_BOUNDS_M;
        // `max` and `min` turn what is not a number into the bound.
        let farthest_m = farthest_m.max(low * MAX_SLICE_RATIO).min(high);
        let nearest_m = nearest_m.max(farthest_m / MAX_RANGE_RATIO).max(low).min(farthest_m / 1.01);
        let steps = (farthest_m / nearest_m).ln() / MAX_SLICE_RATIO.ln();
        // Rounding must not add a slice.
        Self { nearest_m, farthest_m, count: (steps - 1e-3).ceil().max(1.0) as u32 + 1 }
    }

    /// Slices per doubling of the distance.
    pub fn per_octave(self) -> f32 {
        (self.count.max(2) - 1) as f32 / (self.farthest_m / self.nearest_m).log2()
    }

    /// Distance of a slice, metres.
    pub fn distance_m(self, slice: u32) -> f32 {
        self.nearest_m * (slice as f32 / self.per_octave()).exp2()
    }
}

/// Writes one row of the table as 16-bit floats: `2 pi s^2 p` at the texels' centres, from the middle of the ring to
/// `domain` ring radii ([`profile_domain`]).
pub fn write_profile(
    row: &mut [u16; PROFILE_TEXELS],
    domain: f32,
    ring_radius_m: f32,
    distance_m: f32,
    roughness_rad: f32,
) {
    let ring_radius_m = ring_radius_m.max(LEAST_RING_RADIUS_M);
    let tilt = ring_tilt_rad(ring_radius_m, distance_m);
    let ring = RingProfile { ring_tilt_rad: tilt, roughness_rad: roughness_rad.max(LEAST_WIDTH * tilt) };
    // A ring that is drawn wider than it is keeps its light.
    let dimmed = (roughness_rad / ring.roughness_rad) * (roughness_rad / ring.roughness_rad);
    let step = domain / PROFILE_TEXELS as f32;
    for (place, texel) in row.iter_mut().enumerate() {
        let radius = (place as f32 + 0.5) * step;
        *texel = half_bits(dimmed * ring.relative_density(radius * tilt));
    }
}

/// The radial ramp as 16-bit floats, row by row: each texel holds its distance from the middle texel, so that one is
/// the rim of the circle that [`ramp_uv`] spans.
pub fn radial_ramp() -> Vec<u16> {
    let from_centre = |place: usize| (place as f32 - RAMP_CENTRE as f32) / ramp_scale();
    (0..RAMP_TEXELS * RAMP_TEXELS)
        .map(|texel| half_bits(from_centre(texel % RAMP_TEXELS).hypot(from_centre(texel / RAMP_TEXELS))))
        .collect()
}

/// Texels from the ramp's middle to its rim.
fn ramp_scale() -> f32 {
    (RAMP_TEXELS - 1 - RAMP_CENTRE) as f32
}

/// Texture coordinate of the ramp for a coordinate from -1 to 1. The shader computes the same.
pub fn ramp_uv(coordinate: f32) -> f32 {
    (coordinate * ramp_scale() + RAMP_CENTRE as f32 + 0.5) / RAMP_TEXELS as f32
}

/// Bits of the nearest 16-bit float, for numbers from 0 to 65504.
fn half_bits(value: f32) -> u16 {
    // The exponents of the two formats differ by 112 in their offset; what is left is to round 13 bits away, half to
    // even.
    let bits = (value * 2_f32.powi(-112)).to_bits();
    ((bits + 0x0fff + ((bits >> 13) & 1)) >> 13) as u16
}

/// Tilts from the halfway vector as a plane: Lambert's equal-area map, so that densities per square radian are densities
/// per steradian. `flat` of a normal at right angles to the halfway vector has length √2. Differs from the angle by less
/// than a hundredth up to half a radian.
#[cfg(feature = "render")]
pub(super) fn flat_scale(cosine: f32) -> f32 {
    (1.0 / (1.0 + cosine).max(1e-4)).sqrt() / std::f32::consts::FRAC_1_SQRT_2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of a 16-bit float.
    fn half(bits: u16) -> f32 {
        f32::from_bits(u32::from(bits) << 13) * 2_f32.powi(112)
    }

    /// `exp(-z) I0(z)` by its integral.
    fn bessel_by_integral(z: f64) -> f64 {
        let steps = 20_000;
        let at = |k: i32| (z * (std::f64::consts::PI * (f64::from(k) + 0.5) / f64::from(steps)).cos() - z).exp();
        (0..steps).map(at).sum::<f64>() / f64::from(steps)
    }

    #[test]
    fn the_bessel_function_is_right_everywhere() {
        for z in [0.0, 0.1, 1.0, 3.7, 3.75, 3.8, 10.0, 100.0, 1e4] {
            let (got, wanted) = (f64::from(bessel_i0_scaled(z)), bessel_by_integral(f64::from(z)));
            assert!((got / wanted - 1.0).abs() < 1e-6, "at {z}: {got} instead of {wanted}");
        }
        assert!(bessel_i0_scaled(1e30) > 0.0 && bessel_i0_scaled(f32::MAX).is_finite());
    }

    #[test]
    fn the_profile_sums_to_one() {
        for (ring_tilt_rad, roughness_rad) in [(0.0, 0.05), (0.02, 0.002), (0.02, 0.02), (0.02, 0.1), (0.2, 0.01)] {
            let profile = RingProfile { ring_tilt_rad, roughness_rad };
            let reach = f64::from(ring_tilt_rad + 8.0 * roughness_rad);
            let step = reach / 20_000.0;
            let sum: f64 = (0..20_000)
                .map(|k| {
                    let tilt = (f64::from(k) + 0.5) * step;
                    std::f64::consts::TAU * tilt * step * f64::from(profile.density(tilt as f32))
                })
                .sum();
            assert!((sum - 1.0).abs() < 1e-4, "{profile:?} sums to {sum}");
        }
    }

    #[test]
    fn without_a_ring_it_is_a_gaussian() {
        let profile = RingProfile { ring_tilt_rad: 0.0, roughness_rad: 0.03 };
        for tilt in [0.0, 0.01, 0.05, 0.1_f32] {
            let wanted = (-0.5 * (tilt / 0.03).powi(2)).exp() / (2.0 * PI * 0.03 * 0.03);
            assert!((profile.density(tilt) / wanted - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn without_roughness_it_is_a_line() {
        // Across a line of length 2 pi t0 the profile is a Gaussian that sums to one over that length.
        let profile = RingProfile { ring_tilt_rad: 0.05, roughness_rad: 0.0005 };
        for off in [-0.001, 0.0, 0.0007_f32] {
            let line = (-0.5 * (off / 0.0005).powi(2)).exp() / (0.0005 * (2.0 * PI).sqrt());
            let got = profile.density(0.05 + off) * 2.0 * PI * 0.05;
            assert!((got / line - 1.0).abs() < 0.02, "{got} instead of {line}");
        }
        assert_eq!(profile.density(0.0), 0.0);
    }

    #[test]
    fn the_ring_is_mirrored_at_the_exact_tilt() {
        // A normal with this tilt mirrors the ray from the eye to a point of the ring.
        for (radius_m, distance_m) in [(0.004_f32, 0.15_f32), (0.02, 0.03), (1.0, 0.5)] {
            let (sin, cos) = ring_tilt_rad(radius_m, distance_m).sin_cos();
            let mirrored = [2.0 * cos * sin, 2.0 * cos * cos - 1.0];
            let hits = mirrored[0] / mirrored[1] * distance_m;
            assert!((hits / radius_m - 1.0).abs() < 1e-5, "{hits} instead of {radius_m}");
        }
        assert_eq!(ring_tilt_rad(0.0, 0.1), 0.0);
    }

    #[test]
    fn halves_are_rounded_to_the_nearest() {
        for (value, bits) in [(0.0, 0), (1.0, 0x3c00), (0.5, 0x3800), (65504.0, 0x7bff), (2_f32.powi(-24), 1)] {
            assert_eq!(half_bits(value), bits, "{value}");
        }
        for k in 1..1000 {
            let value = k as f32 * 0.001;
            assert!((half(half_bits(value)) / value - 1.0).abs() <= 2_f32.powi(-11) * 1.001, "{value}");
        }
    }

    #[test]
    fn slices_cover_their_range() {
        for (near, far) in [(0.1, 0.3), (0.05, 0.051), (0.04, 0.64), (1.0, 15.0)] {
            let slices = DistanceSlices::covering(near, far);
            assert!((slices.distance_m(0) / near - 1.0).abs() < 1e-5);
            assert!((slices.distance_m(slices.count - 1) / far - 1.0).abs() < 1e-4);
            assert!(slices.count <= 17 && slices.distance_m(1) / near < MAX_SLICE_RATIO * 1.001, "{slices:?}");
        }
        assert_eq!(DistanceSlices::covering(0.1, 0.1199).count, 2);
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0, 1e-30, 1e30, 0.2];
        for (near, far) in odd.iter().flat_map(|near| odd.map(|far| (*near, far))) {
            let slices = DistanceSlices::covering(near, far);
            assert!((2..=17).contains(&slices.count) && slices.nearest_m > 0.0, "{near} to {far}: {slices:?}");
            assert!(slices.per_octave().is_finite() && slices.distance_m(slices.count).is_finite());
        }
    }

    /// What a linear filter makes of a row or of the ramp.
    fn filtered(texels: &[f32], at: f32) -> f32 {
        let place = (at * texels.len() as f32 - 0.5).clamp(0.0, (texels.len() - 1) as f32);
        let (low, share) = (place.floor() as usize, place.fract());
        texels[low] * (1.0 - share) + texels[(low + 1).min(texels.len() - 1)] * share
    }

    /// Looks a density up as the shader does.
    fn looked_up(slices: DistanceSlices, radius_m: f32, roughness_rad: f32, distance_m: f32, tilt_rad: f32) -> f32 {
        let slice =
            ((distance_m / slices.nearest_m).log2() * slices.per_octave()).clamp(0.0, slices.count as f32 - 1.0);
        let low = (slice.floor() as u32).min(slices.count - 2);
        let radii = tilt_rad / ring_tilt_rad(radius_m.max(LEAST_RING_RADIUS_M), distance_m);
        let domain = profile_domain(radius_m, slices.farthest_m, roughness_rad);
        let [near, far] = [low, low + 1].map(|slice| {
            let distance_m = slices.distance_m(slice);
            let mut row = [0; PROFILE_TEXELS];
            write_profile(&mut row, domain, radius_m, distance_m, roughness_rad);
            filtered(&row.map(half), radii / domain)
        });
        (near + (slice - low as f32) * (far - near)) / (2.0 * PI * roughness_rad * roughness_rad)
    }

    #[test]
    fn the_table_is_the_profile_at_every_distance() {
        for (radius_m, roughness_rad) in [(0.004, 0.002), (0.004, 0.006), (0.004, 0.02), (0.004, 0.12), (0.0, 0.05)] {
            let slices = DistanceSlices::covering(0.04, 0.4);
            for distance_m in [0.04, 0.053, 0.1, 0.137, 0.26, 0.4] {
                let tilt = ring_tilt_rad(f32::max(radius_m, LEAST_RING_RADIUS_M), distance_m);
                let profile = RingProfile { ring_tilt_rad: tilt, roughness_rad };
                let reach = tilt + 4.0 * roughness_rad;
                let tilts: Vec<f32> = (0..400).map(|k| k as f32 / 400.0 * reach).collect();
                let peak = tilts.iter().map(|tilt| profile.density(*tilt)).fold(0.0, f32::max);
                for tilt in tilts {
                    let (got, wanted) =
                        (looked_up(slices, radius_m, roughness_rad, distance_m, tilt), profile.density(tilt));
                    assert!(
                        (got - wanted).abs() < 0.02 * peak,
                        "ring {radius_m}, roughness {roughness_rad}, {distance_m} m, tilt {tilt}: {got}, not {wanted}"
                    );
                }
            }
        }
    }

    #[test]
    fn odd_rows_are_finite() {
        let mut row = [0; PROFILE_TEXELS];
        for (radius_m, distance_m, roughness_rad) in
            [(0.0, 1e-4, 0.002), (10.0, 1e-4, 0.002), (0.004, 1e4, 0.7), (10.0, 1e4, 0.7), (-1.0, 0.1, 0.1)]
        {
            let domain = profile_domain(radius_m, distance_m, roughness_rad);
            write_profile(&mut row, domain, radius_m, distance_m, roughness_rad);
            assert!(row.iter().all(|texel| half(*texel) <= 1.0), "{radius_m}, {distance_m}, {roughness_rad}");
            assert!(row.iter().any(|texel| *texel > 0));
        }
    }

    #[test]
    fn the_ramp_errs_by_less_than_a_hundredth_where_a_ring_is_seen() {
        let ramp: Vec<f32> = radial_ramp().into_iter().map(half).collect();
        let filtered_ramp = |x: f32, y: f32| {
            let rows: Vec<f32> = ramp.chunks(RAMP_TEXELS).map(|row| filtered(row, ramp_uv(x))).collect();
            filtered(&rows, ramp_uv(y))
        };
        assert_eq!(filtered_ramp(0.0, 0.0), 0.0);
        // A ring that is blurred by more than three fifths of its radius is a filled disk; so wide it reaches seven radii.
        let domain = 1.0 + PROFILE_REACH * 1.2;
        for place in 0..2000 {
            let (sin, cos) = (place as f32 * 0.37).sin_cos();
            let radius = (0.8 + 0.0005 * place as f32) / domain;
            let got = filtered_ramp(radius * cos, radius * sin);
            assert!(
                (got - radius).abs() * domain < 0.01,
                "at {}: {} ring radii off",
                radius * domain,
                (got - radius) * domain
            );
        }
    }
}
