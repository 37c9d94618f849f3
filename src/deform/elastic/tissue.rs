//! What bodies are made of.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// How tissue gives way. The presets are orders of magnitude from the literature on soft tissue; living organs of one kind differ
/// among themselves by a factor of three and more.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(default)]
#[reflect(Default, Clone, Debug, PartialEq)]
pub struct ElasticTissue {
    /// Young's modulus, pascal.
    pub youngs_modulus_pa: f32,
    /// How much it narrows when it is stretched: 0 not at all, 0.5 so that its volume stays.
    pub poisson_ratio: f32,
    /// Mass per volume, kilograms per cubic metre.
    pub density_kg_per_m3: f32,
    /// Time in which strain settles, seconds: viscosity over stiffness (Kelvin and Voigt).
    pub damping_s: f32,
    /// Stretch at which it tears: 1.4 is 40% longer.
    pub tears_at_stretch: f32,
    /// What the thin, tough skin of an organ adds where its surface is ([`ElasticBody::of_organ`](super::ElasticBody::of_organ)): its
    /// Young's modulus times its thickness, newtons per metre. It spreads a dent.
    pub capsule_n_per_m: f32,
}

impl Default for ElasticTissue {
    fn default() -> Self {
        Self::LIVER
    }
}

impl ElasticTissue {
    /// All its numbers.
    pub(super) fn numbers(&self) -> [f32; 6] {
        let Self { youngs_modulus_pa, poisson_ratio, density_kg_per_m3, damping_s, tears_at_stretch, capsule_n_per_m } =
            *self;
        [youngs_modulus_pa, poisson_ratio, density_kg_per_m3, damping_s, tears_at_stretch, capsule_n_per_m]
    }

    /// A healthy liver in Glisson's capsule (some 2 MPa and 0.1 mm).
    pub const LIVER: Self = Self {
        youngs_modulus_pa: 5e3,
        poisson_ratio: 0.45,
        density_kg_per_m3: 1060.0,
        damping_s: 0.03,
        tears_at_stretch: 1.5,
        capsule_n_per_m: 200.0,
    };
    /// A gallbladder with its bile, taken as one.
    pub const GALLBLADDER: Self = Self { youngs_modulus_pa: 1e4, tears_at_stretch: 1.8, ..Self::LIVER };
    /// A kidney.
    pub const KIDNEY: Self = Self { youngs_modulus_pa: 1.2e4, ..Self::LIVER };
    /// Brain and nerves.
    pub const BRAIN: Self =
        Self { youngs_modulus_pa: 2e3, density_kg_per_m3: 1040.0, capsule_n_per_m: 0.0, ..Self::LIVER };
    /// Muscle at rest.
    pub const MUSCLE: Self = Self { youngs_modulus_pa: 1.5e4, tears_at_stretch: 1.6, ..Self::LIVER };
    /// Fat under the skin.
    pub const FAT: Self =
        Self { youngs_modulus_pa: 2e3, density_kg_per_m3: 920.0, capsule_n_per_m: 0.0, ..Self::LIVER };
    /// Skin.
    pub const SKIN: Self =
        Self { youngs_modulus_pa: 1e5, density_kg_per_m3: 1100.0, tears_at_stretch: 1.7, ..Self::LIVER };
    /// Cartilage.
    pub const CARTILAGE: Self =
        Self { youngs_modulus_pa: 5e6, poisson_ratio: 0.4, density_kg_per_m3: 1100.0, ..Self::LIVER };
    /// Bone: as good as rigid. It comes out softer than it is, and still does not visibly give way.
    pub const BONE: Self = Self {
        youngs_modulus_pa: 1e10,
        poisson_ratio: 0.3,
        density_kg_per_m3: 1900.0,
        damping_s: 0.001,
        tears_at_stretch: 1.02,
        capsule_n_per_m: 0.0,
    };

    /// Softest and stiffest that is taken as it is, pascal.
    pub const STIFFNESS_PA: (f32, f32) = (1e-2, 1e13);

    /// The tissue with numbers that can be: stiffness within [`ElasticTissue::STIFFNESS_PA`], a Poisson ratio from 0 to 0.4999,
    /// 0.1 to 100,000 kilograms per cubic metre. What is no number becomes that of the default.
    pub fn bounded(self) -> Self {
        let bounded = |value: f32, least: f32, most: f32, otherwise: f32| {
            if value.is_nan() { otherwise } else { value.clamp(least, most) }
        };
        let (softest, stiffest) = Self::STIFFNESS_PA;
        let usual = Self::LIVER;
        Self {
            youngs_modulus_pa: bounded(self.youngs_modulus_pa, softest, stiffest, usual.youngs_modulus_pa),
            poisson_ratio: bounded(self.poisson_ratio, 0.0, 0.4999, usual.poisson_ratio),
            density_kg_per_m3: bounded(self.density_kg_per_m3, 0.1, 1e5, usual.density_kg_per_m3),
            damping_s: bounded(self.damping_s, 0.0, 10.0, usual.damping_s),
            capsule_n_per_m: bounded(self.capsule_n_per_m, 0.0, 1e9, 0.0),
            tears_at_stretch: bounded(self.tears_at_stretch, 1.0, 1e6, usual.tears_at_stretch),
        }
    }

    /// Lamé's parameters, pascal: shear modulus, and the one of volume.
    pub fn lame_pa(&self) -> (f64, f64) {
        let (e, nu) = (f64::from(self.youngs_modulus_pa), f64::from(self.poisson_ratio));
        (e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)))
    }
}
