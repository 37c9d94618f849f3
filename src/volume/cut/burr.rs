//! Burrs: what turns at the end of a drill.

use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Smallest and largest diameter, metres.
pub const BURR_DIAMETERS_M: [f32; 2] = [1e-3, 6e-3];
/// Greatest length of a cylinder or a matchstick, metres.
pub const MAX_BURR_LENGTH_M: f32 = 20e-3;

/// How a burr's surface takes bone away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
pub enum BurrKind {
    /// Steel or carbide with flutes: fast.
    #[default]
    Cutting,
    /// Coated with diamond grit: a quarter as fast, for work near what must not be hurt.
    Diamond,
    /// Fine grit for smoothing: a fortieth as fast.
    Polishing,
}

impl BurrKind {
    /// Coefficient of Preston's equation for cortical bone: mm³ removed per newton of contact force and millimetre that the
    /// burr's surface passes, that is mm²/N.
    ///
    /// Chosen, not measured: a cutting burr of 4 mm at 2 N and 40,000 turns a minute removes 8 mm³ of cortical bone per second.
    pub fn removal_mm2_per_n(self) -> f64 {
        match self {
            Self::Cutting => 4.775e-4,
            Self::Diamond => 4.775e-4 / 4.0,
            Self::Polishing => 4.775e-4 / 40.0,
        }
    }
}

/// Outline of a burr, a body of revolution about its axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub enum BurrShape {
    /// A ball.
    #[default]
    Sphere,
    /// A cylinder with flat ends.
    Cylinder {
        /// From end to end, metres.
        length_m: f32,
    },
    /// A cylinder with half a ball at either end.
    Matchstick {
        /// From tip to tip, metres; at least the diameter.
        length_m: f32,
    },
}

/// A burr that no drill takes.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum BurrError {
    /// Not within [`BURR_DIAMETERS_M`].
    #[error("a burr's diameter is 1 to 6 mm, not {} mm", .0 * 1e3)]
    Diameter(f32),
    /// Not positive, longer than [`MAX_BURR_LENGTH_M`], or a matchstick shorter than it is wide.
    #[error("a burr's length is above 0 and up to 20 mm, a matchstick's at least its diameter, not {} mm", .0 * 1e3)]
    Length(f32),
}

/// A burr.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct Burr {
    /// How it takes bone away.
    pub kind: BurrKind,
    /// Its outline.
    pub shape: BurrShape,
    /// Across its axis, metres, within [`BURR_DIAMETERS_M`].
    pub diameter_m: f32,
}

impl Default for Burr {
    /// A cutting ball of 4 mm.
    fn default() -> Self {
        Self { kind: BurrKind::Cutting, shape: BurrShape::Sphere, diameter_m: 4e-3 }
    }
}

impl Burr {
    /// A burr with sizes that burrs have.
    ///
    /// # Errors
    /// [`BurrError`] names the size that is out of range.
    pub fn new(kind: BurrKind, shape: BurrShape, diameter_m: f32) -> Result<Self, BurrError> {
        let burr = Self { kind, shape, diameter_m };
        burr.check()?;
        Ok(burr)
    }

    /// Whether its sizes are in range: fields can be set by hand.
    ///
    /// # Errors
    /// As [`Burr::new`].
    pub fn check(&self) -> Result<(), BurrError> {
        // Sizes computed in single precision, such as 0.5 * 2e-3, may miss a limit by their rounding.
        let [least, greatest] = BURR_DIAMETERS_M;
        if !(least * 0.9999..=greatest * 1.0001).contains(&self.diameter_m) {
            return Err(BurrError::Diameter(self.diameter_m));
        }
        let (length_m, shortest_m) = match self.shape {
            BurrShape::Sphere => return Ok(()),
            BurrShape::Cylinder { length_m } => (length_m, f32::MIN_POSITIVE),
            BurrShape::Matchstick { length_m } => (length_m, self.diameter_m * 0.9999),
        };
        if (shortest_m..=MAX_BURR_LENGTH_M * 1.0001).contains(&length_m) {
            Ok(())
        } else {
            Err(BurrError::Length(length_m))
        }
    }

    /// Signed distance from the burr's surface, metres, negative inside, at a point in the burr's own frame: centre at the
    /// origin, axis along Y.
    pub fn signed_distance_m(&self, point_m: Vec3) -> f32 {
        let radius_m = self.diameter_m * 0.5;
        match self.shape {
            BurrShape::Sphere => point_m.length() - radius_m,
            BurrShape::Cylinder { length_m } => {
                let beside = point_m.x.hypot(point_m.z) - radius_m;
                let beyond = point_m.y.abs() - length_m * 0.5;
                beside.max(beyond).min(0.0) + beside.max(0.0).hypot(beyond.max(0.0))
            }
            BurrShape::Matchstick { length_m } => {
                let straight = (length_m * 0.5 - radius_m).max(0.0);
                let nearest = Vec3::new(0.0, point_m.y.clamp(-straight, straight), 0.0);
                point_m.distance(nearest) - radius_m
            }
        }
    }

    /// Its volume, mm³.
    pub fn volume_mm3(&self) -> f64 {
        let radius_mm = f64::from(self.diameter_m) * 500.0;
        let ball = radius_mm.powi(3) * 4.0 / 3.0;
        let over_pi = match self.shape {
            BurrShape::Sphere => ball,
            BurrShape::Cylinder { length_m } => radius_mm.powi(2) * f64::from(length_m) * 1e3,
            BurrShape::Matchstick { length_m } => {
                ball + radius_mm.powi(2) * (f64::from(length_m) * 1e3 - 2.0 * radius_mm)
            }
        };
        over_pi * std::f64::consts::PI
    }

    /// Volume of cortical bone that it can remove per second, mm³: Preston's equation, `k * force * speed of its surface`.
    /// 0 for a force that pulls away and for numbers that are not finite; either sense of rotation cuts.
    pub fn cortical_mm3_per_s(&self, force_n: f32, speed_rpm: f32) -> f64 {
        let turns_per_s = f64::from(speed_rpm).abs() / 60.0;
        let surface_mm_per_s = std::f64::consts::PI * f64::from(self.diameter_m) * 1e3 * turns_per_s;
        let rate = self.kind.removal_mm2_per_n() * f64::from(force_n) * surface_mm_per_s;
        if rate.is_finite() { rate.max(0.0) } else { 0.0 }
    }
}

/// Where a burr is, in the volume's space.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct BurrPose {
    /// Middle of the burr, metres.
    pub centre_m: Vec3,
    /// Direction of its axis, of any length but 0; a ball's does not matter.
    pub axis: Vec3,
}

/// What a burr did during a step.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct BurrStroke {
    /// The burr.
    pub burr: Burr,
    /// Where it was when the step began.
    pub from: BurrPose,
    /// Where it is when the step ends; on the way it moved along a straight line.
    pub to: BurrPose,
    /// Force with which it presses on the bone, newtons.
    pub force_n: f32,
    /// Turns per minute.
    pub speed_rpm: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_out_of_range_are_refused() {
        let new = |shape, diameter_m| Burr::new(BurrKind::Diamond, shape, diameter_m);
        assert!(new(BurrShape::Sphere, 1e-3).is_ok());
        assert!(new(BurrShape::Sphere, 6e-3).is_ok());
        for diameter_m in [0.9e-3, 6.1e-3, 0.0, -4e-3, f32::NAN, f32::INFINITY] {
            assert!(matches!(new(BurrShape::Sphere, diameter_m), Err(BurrError::Diameter(_))), "{diameter_m}");
        }
        assert!(new(BurrShape::Cylinder { length_m: 1e-3 }, 2e-3).is_ok());
        assert!(new(BurrShape::Matchstick { length_m: 2e-3 }, 2e-3).is_ok());
        for length_m in [0.0, -1e-3, 0.03, f32::NAN, f32::INFINITY] {
            assert!(matches!(new(BurrShape::Cylinder { length_m }, 2e-3), Err(BurrError::Length(_))), "{length_m}");
        }
        let error = new(BurrShape::Matchstick { length_m: 1.5e-3 }, 2e-3).expect_err("shorter than wide");
        assert_eq!(error.to_string().split("not ").last(), Some("1.5 mm"));
    }

    #[test]
    fn distances_are_those_of_the_outlines() {
        let burr = |shape| Burr { shape, diameter_m: 2e-3, ..Burr::default() };
        let at = |burr: Burr, x, y, z| burr.signed_distance_m(Vec3::new(x, y, z) * 1e-3) * 1e3;
        let near = |a: f32, b: f32| assert!((a - b).abs() < 1e-5, "{a} {b}");
        near(at(burr(BurrShape::Sphere), 0.0, 3.0, 4.0), 4.0);
        near(at(burr(BurrShape::Sphere), 0.0, 0.0, 0.25), -0.75);
        let cylinder = burr(BurrShape::Cylinder { length_m: 6e-3 });
        near(at(cylinder, 0.0, 2.5, 0.0), -0.5);
        near(at(cylinder, 0.6, 2.5, 0.0), -0.4);
        near(at(cylinder, 4.0, 7.0, 0.0), 5.0);
        let matchstick = burr(BurrShape::Matchstick { length_m: 6e-3 });
        near(at(matchstick, 0.0, 3.0, 0.0), 0.0);
        near(at(matchstick, 3.0, 6.0, 0.0), 4.0);
        near(at(matchstick, 0.25, -1.0, 0.0), -0.75);
    }

    #[test]
    fn rates_follow_prestons_equation() {
        let rate = |kind, force_n, rpm| Burr { kind, ..Burr::default() }.cortical_mm3_per_s(force_n, rpm);
        assert!((rate(BurrKind::Cutting, 2.0, 40_000.0) - 8.0).abs() < 0.01);
        assert!((rate(BurrKind::Diamond, 2.0, 40_000.0) - 2.0).abs() < 0.01);
        assert!((rate(BurrKind::Polishing, 2.0, 40_000.0) - 0.2).abs() < 0.001);
        assert!((rate(BurrKind::Cutting, 1.0, -80_000.0) - 8.0).abs() < 0.01);
        for (force_n, rpm) in [(-1.0, 4e4), (f32::NAN, 4e4), (1.0, f32::INFINITY), (0.0, 4e4), (f32::MAX, f32::NAN)] {
            assert_eq!(rate(BurrKind::Cutting, force_n, rpm), 0.0);
        }
    }
}
