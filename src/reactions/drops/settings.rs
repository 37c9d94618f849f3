//! What drops are made of and how they cling: [`DropSettings`] and the laws that depend on a drop's size alone.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Radius to which friction and retention are given, metres.
const REFERENCE_RADIUS_M: f64 = 1e-3;

/// Physics of the drops of one liquid on one kind of surface. The defaults are blood on the capsule of a liver.
///
/// A drop is a spherical cap; its radius is that of the disk on which it lies. Values that are not finite count as the
/// default, others outside the range given at each field as the nearest end of it ([`DropSettings::tamed`]).
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(default)]
pub struct DropSettings {
    /// Density of the liquid, kg/m3; 1 to 20,000.
    pub density_kg_per_m3: f64,
    /// Contact angle, which gives the cap its height; 0.1 to 3 radians. At the default of 60 degrees a drop of 1 uL has
    /// a radius of 1 mm.
    pub contact_angle_rad: f64,
    /// Friction of a drop of 1 mm radius on dry ground: it loses this share of its speed per second; 0 to 1e6 per
    /// second. Viscous stress in a film as high as the drop makes it fall with the square of the radius.
    pub friction_at_1_mm_per_s: f64,
    /// Friction on wet ground over that on dry; 0 to 1.
    pub wet_friction_share: f64,
    /// Retention of a drop of 1 mm radius on dry ground: acceleration by which the difference between its advancing and
    /// receding contact angle holds it back, whether it rests or moves; 0 to 1e6 m/s2. The force grows with the width
    /// and the mass with its cube (Furmidge 1962), so that it falls with the square of the radius. Zero switches it
    /// off.
    pub retention_at_1_mm_m_per_s2: f64,
    /// Retention on wet ground over that on dry; 0 to 1.
    pub wet_retention_share: f64,
    /// Force per contact width with which a drop clings to what it hangs from; 0 to 10 N/m. At the default a drop under
    /// a horizontal ceiling falls off at a radius above 2.2 mm (as Tate's law has it, with a width of two radii).
    pub adhesion_n_per_m: f64,
    /// Thickness of the film that a moving drop leaves behind; 0 to 1 mm, in metres.
    pub film_thickness_m: f64,
    /// Two disks meet when their centres are nearer than this share of the sum of their radii; 0.05 to 1.
    pub contact_share: f64,
    /// Longest way walked at once, so that a fast drop feels the curvature; 10 um to 1 m, in metres.
    pub stride_m: f64,
}

impl Default for DropSettings {
    fn default() -> Self {
        Self {
            density_kg_per_m3: 1060.0,
            contact_angle_rad: PI / 3.0,
            friction_at_1_mm_per_s: 1000.0,
            wet_friction_share: 0.4,
            retention_at_1_mm_m_per_s2: 9.0,
            wet_retention_share: 0.25,
            adhesion_n_per_m: 0.0254,
            film_thickness_m: 10e-6,
            contact_share: 0.7,
            stride_m: 1e-3,
        }
    }
}

impl DropSettings {
    /// The settings with every value brought into its range.
    pub fn tamed(&self) -> Self {
        let default = Self::default();
        let tame = |value: f64, default: f64, low: f64, high: f64| {
            if value.is_finite() { value.clamp(low, high) } else { default }
        };
        Self {
            density_kg_per_m3: tame(self.density_kg_per_m3, default.density_kg_per_m3, 1.0, 2e4),
            contact_angle_rad: tame(self.contact_angle_rad, default.contact_angle_rad, 0.1, 3.0),
            friction_at_1_mm_per_s: tame(self.friction_at_1_mm_per_s, default.friction_at_1_mm_per_s, 0.0, 1e6),
            wet_friction_share: tame(self.wet_friction_share, default.wet_friction_share, 0.0, 1.0),
            retention_at_1_mm_m_per_s2: tame(
                self.retention_at_1_mm_m_per_s2,
                default.retention_at_1_mm_m_per_s2,
                0.0,
                1e6,
            ),
            wet_retention_share: tame(self.wet_retention_share, default.wet_retention_share, 0.0, 1.0),
            adhesion_n_per_m: tame(self.adhesion_n_per_m, default.adhesion_n_per_m, 0.0, 10.0),
            film_thickness_m: tame(self.film_thickness_m, default.film_thickness_m, 0.0, 1e-3),
            contact_share: tame(self.contact_share, default.contact_share, 0.05, 1.0),
            stride_m: tame(self.stride_m, default.stride_m, 1e-5, 1.0),
        }
    }

    /// Volume of a cap over the cube of the radius on which it lies.
    fn cap_factor(&self) -> f64 {
        let (sin, cos) = self.tamed().contact_angle_rad.sin_cos();
        PI * (2.0 - 3.0 * cos + cos.powi(3)) / (3.0 * sin.powi(3))
    }

    /// Radius of the disk on which a drop lies, metres; zero for what is no positive volume.
    pub fn radius_m(&self, volume_m3: f64) -> f64 {
        if volume_m3 > 0.0 { (volume_m3 / self.cap_factor()).cbrt() } else { 0.0 }
    }

    /// Volume of a drop that lies on a disk of this radius, cubic metres; zero for what is no positive radius.
    pub fn volume_m3(&self, radius_m: f64) -> f64 {
        if radius_m > 0.0 { self.cap_factor() * radius_m.powi(3) } else { 0.0 }
    }

    /// Share of its speed that a drop of this radius loses per second; infinite for none.
    pub fn friction_per_s(&self, radius_m: f64, is_wet: bool) -> f64 {
        let settings = self.tamed();
        let share = if is_wet { settings.wet_friction_share } else { 1.0 };
        by_size(settings.friction_at_1_mm_per_s * share, radius_m)
    }

    /// Acceleration that holds a drop of this radius back, m/s2; infinite for none.
    pub fn retention_m_per_s2(&self, radius_m: f64, is_wet: bool) -> f64 {
        let settings = self.tamed();
        let share = if is_wet { settings.wet_retention_share } else { 1.0 };
        by_size(settings.retention_at_1_mm_m_per_s2 * share, radius_m)
    }

    /// Acceleration away from the surface that a drop of this radius just withstands, m/s2; infinite for none.
    pub fn adhesion_m_per_s2(&self, radius_m: f64) -> f64 {
        let settings = self.tamed();
        let mass_per_width_and_area = 0.5 * settings.density_kg_per_m3 * settings.cap_factor();
        if settings.adhesion_n_per_m > 0.0 {
            settings.adhesion_n_per_m / (mass_per_width_and_area * radius_m.powi(2))
        } else {
            0.0
        }
    }

    /// Film that a drop of this radius leaves on a way of this length, cubic metres. What is no positive number leaves
    /// none. Take it from the drop with [`DropHead::shed`](super::DropHead::shed), which knows when it is used up.
    pub fn film_volume_m3(&self, radius_m: f64, distance_m: f64) -> f64 {
        let area_m2 = 2.0 * radius_m.max(0.0) * distance_m.max(0.0);
        if area_m2.is_finite() { area_m2 * self.tamed().film_thickness_m } else { 0.0 }
    }
}

/// A value that belongs to the reference radius and falls with the square of the radius.
fn by_size(at_reference: f64, radius_m: f64) -> f64 {
    if at_reference > 0.0 { at_reference * (REFERENCE_RADIUS_M / radius_m).powi(2) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_microlitre_lies_on_a_millimetre() {
        let settings = DropSettings::default();
        assert!((settings.radius_m(1e-9) / 1e-3 - 1.0).abs() < 0.01, "{}", settings.radius_m(1e-9));
        // Half a sphere.
        let half = DropSettings { contact_angle_rad: PI / 2.0, ..settings };
        assert!((half.volume_m3(0.003) / (2.0 / 3.0 * PI * 0.003f64.powi(3)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn radius_and_volume_are_inverse() {
        for degrees in [6.0, 30.0, 60.0, 90.0, 120.0, 170.0] {
            let settings = DropSettings { contact_angle_rad: f64::to_radians(degrees), ..Default::default() };
            for exponent in -30..3 {
                let volume_m3 = 1.37 * 10f64.powi(exponent);
                let back = settings.volume_m3(settings.radius_m(volume_m3));
                assert!((back / volume_m3 - 1.0).abs() < 1e-14, "{degrees} degrees, {volume_m3} m3: {back}");
            }
        }
        let settings = DropSettings::default();
        for senseless in [0.0, -1.0, f64::NAN] {
            assert_eq!((settings.radius_m(senseless), settings.volume_m3(senseless)), (0.0, 0.0));
        }
    }

    #[test]
    fn resistance_falls_with_the_square_of_the_radius_and_on_wet_ground() {
        let settings = DropSettings::default();
        assert_eq!(settings.friction_per_s(1e-3, false), settings.friction_at_1_mm_per_s);
        assert_eq!(settings.friction_per_s(2e-3, false), settings.friction_at_1_mm_per_s / 4.0);
        assert_eq!(settings.friction_per_s(1e-3, true), settings.friction_at_1_mm_per_s * settings.wet_friction_share);
        assert_eq!(settings.retention_m_per_s2(2e-3, false), settings.retention_at_1_mm_m_per_s2 / 4.0);
        assert_eq!(settings.friction_per_s(0.0, false), f64::INFINITY);
        let none = DropSettings { friction_at_1_mm_per_s: 0.0, retention_at_1_mm_m_per_s2: -3.0, ..settings };
        assert_eq!((none.friction_per_s(0.0, false), none.retention_m_per_s2(0.0, false)), (0.0, 0.0));
    }

    #[test]
    fn senseless_settings_are_tamed() {
        let wild = DropSettings {
            density_kg_per_m3: f64::NAN,
            contact_angle_rad: -1.0,
            friction_at_1_mm_per_s: f64::INFINITY,
            wet_friction_share: 7.0,
            retention_at_1_mm_m_per_s2: -5.0,
            wet_retention_share: f64::NEG_INFINITY,
            adhesion_n_per_m: 1e9,
            film_thickness_m: 1.0,
            contact_share: 0.0,
            stride_m: 0.0,
        };
        let default = DropSettings::default();
        let tamed = DropSettings {
            density_kg_per_m3: default.density_kg_per_m3,
            contact_angle_rad: 0.1,
            friction_at_1_mm_per_s: default.friction_at_1_mm_per_s,
            wet_friction_share: 1.0,
            retention_at_1_mm_m_per_s2: 0.0,
            wet_retention_share: default.wet_retention_share,
            adhesion_n_per_m: 10.0,
            film_thickness_m: 1e-3,
            contact_share: 0.05,
            stride_m: 1e-5,
        };
        assert_eq!(wild.tamed(), tamed);
        assert_eq!(default.tamed(), default);
    }

    #[test]
    fn a_film_is_as_long_wide_and_thick_as_its_drop_left_it() {
        let settings = DropSettings { film_thickness_m: 2e-5, ..Default::default() };
        assert!((settings.film_volume_m3(0.002, 0.5) / (0.004 * 0.5 * 2e-5) - 1.0).abs() < 1e-12);
        for (radius_m, distance_m) in [(-1.0, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY), (0.0, f64::INFINITY)] {
            assert_eq!(settings.film_volume_m3(radius_m, distance_m), 0.0);
        }
    }
}
