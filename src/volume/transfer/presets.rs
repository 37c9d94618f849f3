//! Transfer functions to begin with.
//!
//! Values in Hounsfield units follow what CT textbooks agree on: air -1000, fat -100, water 0, muscle 50, blood with contrast
//! medium 150 to 400, cancellous bone from 200, cortical bone 700 to 2000. Colours are chosen.

use super::{ColourSource, ControlPoint, TransferFunction, ValueScale};
use crate::volume::structures::{SolidRamp, Thresholds};
use crate::volume::{Volume, Voxels};

fn points(list: &[(f64, [u8; 3], f32)]) -> Vec<ControlPoint> {
    list.iter().map(|&(value, colour, opacity)| ControlPoint { value, colour, opacity }).collect()
}

/// Greatest value of volumes that are normalized rather than in Hounsfield units.
const NORMALIZED_RANGE: [f64; 2] = [-0.05, 1.05];

impl TransferFunction {
    /// Bone in a CT with Hounsfield units; soft tissue is invisible.
    pub fn bone() -> Self {
        Self {
            points: points(&[
                (180.0, [176, 122, 88], 0.0),
                (320.0, [214, 176, 136], 0.35),
                (600.0, [234, 212, 174], 0.9),
                (1200.0, [245, 233, 208], 1.0),
                (2500.0, [255, 252, 244], 1.0),
            ]),
            reference_length_m: 0.5e-3,
            ..Self::default()
        }
        .in_values()
    }

    /// Skin and muscle as a veil over bone, in Hounsfield units.
    pub fn soft_tissue() -> Self {
        Self {
            points: points(&[
                (-250.0, [205, 150, 125], 0.0),
                (-100.0, [222, 180, 140], 0.03),
                (20.0, [196, 110, 92], 0.12),
                (80.0, [172, 70, 62], 0.2),
                (180.0, [196, 140, 96], 0.25),
                (500.0, [240, 225, 196], 0.9),
                (1500.0, [255, 250, 240], 1.0),
            ]),
            ..Self::default()
        }
        .in_values()
    }

    /// Vessels filled with contrast medium, in Hounsfield units, with bone behind them.
    pub fn vessels() -> Self {
        Self {
            points: points(&[
                (110.0, [140, 10, 10], 0.0),
                (180.0, [190, 20, 16], 0.35),
                (350.0, [226, 60, 40], 0.8),
                (500.0, [232, 190, 150], 0.5),
                (900.0, [245, 233, 208], 0.9),
                (2000.0, [255, 252, 244], 1.0),
            ]),
            reference_length_m: 0.7e-3,
            ..Self::default()
        }
        .in_values()
    }

    /// The skull in a head scan whose values run from 0 (air) to 1, with soft tissue at 0.35 and bone from 0.42.
    pub fn head() -> Self {
        Self {
            points: points(&[
                (0.385, [150, 86, 58], 0.0),
                (0.43, [196, 140, 96], 0.45),
                (0.5, [230, 204, 160], 0.9),
                (0.65, [245, 233, 208], 1.0),
                (1.0, [255, 252, 244], 1.0),
            ]),
            ..Self::default()
        }
        .in_values()
    }

    /// A surface where voxels are filled: what is drawn is what can be drilled.
    pub fn surface(filled: &SolidRamp) -> Self {
        let SolidRamp { empty_below, full_above } = *filled;
        let dense = full_above + 2.0 * (full_above - empty_below);
        Self {
            points: points(&[
                (empty_below, [138, 124, 112], 0.0),
                (full_above, [206, 196, 182], 0.95),
                (dense, [252, 248, 240], 1.0),
            ]),
            ..Self::default()
        }
        .in_values()
    }

    /// For coloured volumes: colours of the voxels, and a surface where the opacity passes through one half of 255.
    pub fn labelled() -> Self {
        Self {
            points: points(&[(64.0, [255; 3], 0.0), (192.0, [255; 3], 1.0)]),
            reference_length_m: 0.2e-3,
            colour_source: ColourSource::Voxels,
            ..Self::default()
        }
        .in_values()
    }

    /// For a CT with named structures that stand in air: everything denser than half air is drawn, in its structure's colour.
    /// Values in Hounsfield units.
    pub fn structures() -> Self {
        Self {
            points: points(&[(-550.0, [255; 3], 0.0), (-100.0, [255; 3], 0.9), (300.0, [255; 3], 1.0)]),
            reference_length_m: 0.2e-3,
            colour_source: ColourSource::Voxels,
            ..Self::default()
        }
        .in_values()
    }

    /// The sensible one for a volume:
    ///
    /// - [`Self::labelled`] for colours;
    /// - [`Self::structures`] for Hounsfield units with critical structures named, so that soft ones are seen as well;
    /// - [`Self::bone`] for other Hounsfield units (values below -500 and above 800);
    /// - [`Self::head`] for values from 0 to 1;
    /// - [`Self::surface`] for anything else, with the ramp of [`Thresholds::otsu`] that its structures are found with;
    /// - [`Self::default`] where all voxels are equal.
    pub fn for_volume(volume: &Volume) -> Self {
        let [least, greatest] = volume.range();
        let has_critical = volume
            .structures()
            .is_some_and(|structures| structures.list().iter().any(|structure| structure.is_critical));
        if matches!(volume.voxels(), Voxels::Rgba(_)) {
            Self::labelled()
        } else if least < -500.0 && greatest > 800.0 {
            if has_critical { Self::structures() } else { Self::bone() }
        } else if least >= NORMALIZED_RANGE[0] && greatest <= NORMALIZED_RANGE[1] && greatest > 0.5 {
            Self::head()
        } else if greatest > least {
            Self::surface(&Thresholds::otsu(volume).solid)
        } else {
            Self::default()
        }
    }

    fn in_values(self) -> Self {
        Self { scale: ValueScale::Values, ..self }
    }
}
