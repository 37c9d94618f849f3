//! What tissues are typically like, so that a structure is named in one line.

use super::{Structure, Tissue};

impl Default for Structure {
    /// Cortical bone without a name.
    fn default() -> Self {
        Self::new("", [230, 220, 196], Tissue::CorticalBone)
    }
}

impl Tissue {
    /// Hardness as a multiple of cortical bone.
    ///
    /// Chosen, not measured: the order follows mineral content (enamel and the ear's dense bone above cortical bone, cancellous
    /// bone far below it, since its strength falls with the square of its density), and soft tissue is given just enough
    /// resistance that a burr does not fall through it.
    pub fn typical_hardness(self) -> f32 {
        match self {
            Self::CorticalBone => 1.0,
            Self::CancellousBone => 0.4,
            Self::Tooth => 1.8,
            Self::Cartilage => 0.15,
            Self::Dura => 0.12,
            Self::Nerve => 0.08,
            Self::Vessel => 0.06,
            Self::Soft => 0.05,
        }
    }

    /// Bleeding rate in millilitres per second and cubic millimetre, chosen so that opened bone oozes for minutes, a nerve's
    /// sheath and the dura stain the field, and a vessel fills it within seconds.
    pub fn typical_bleeding_ml_per_s_mm3(self) -> f32 {
        match self {
            Self::CorticalBone => 2e-5,
            Self::CancellousBone => 2e-4,
            Self::Tooth | Self::Cartilage => 0.0,
            Self::Nerve => 1e-4,
            Self::Vessel => 0.05,
            Self::Dura => 1e-3,
            Self::Soft => 5e-4,
        }
    }
}

impl Structure {
    /// A structure of a tissue with its typical hardness and bleeding; not critical.
    pub fn new(name: impl Into<String>, colour: [u8; 3], tissue: Tissue) -> Self {
        Self {
            name: name.into(),
            colour,
            tissue,
            hardness: tissue.typical_hardness(),
            bleeding_ml_per_s_mm3: tissue.typical_bleeding_ml_per_s_mm3(),
            is_critical: false,
        }
    }

    /// The same structure, not to be touched.
    pub fn critical(mut self) -> Self {
        self.is_critical = true;
        self
    }

    /// The same structure with another hardness, as a multiple of cortical bone.
    pub fn with_hardness(mut self, hardness: f32) -> Self {
        self.hardness = hardness;
        self
    }

    /// The same structure with another bleeding rate, millilitres per second and cubic millimetre.
    pub fn with_bleeding(mut self, ml_per_s_mm3: f32) -> Self {
        self.bleeding_ml_per_s_mm3 = ml_per_s_mm3;
        self
    }
}
