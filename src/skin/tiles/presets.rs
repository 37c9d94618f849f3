//! The organs' skins as parameters.

use super::{ColourRamp, TileDetail, TileOptions};

fn srgb(colour: [u8; 3]) -> [f32; 3] {
    colour.map(|c| f32::from(c) / 255.0)
}

impl TileOptions {
    /// Liver capsule: fine lobules, dark red-brown around the central vein and paler towards the septa.
    pub fn liver() -> Self {
        Self {
            cells_per_edge: 18.0,
            ramp: ColourRamp::from_srgb8(&[
                (0.0, [88, 29, 22]),
                (0.22, [99, 34, 25]),
                (0.48, [115, 43, 31]),
                (0.7, [131, 55, 40]),
                (0.95, [148, 72, 54]),
            ]),
            cell_jitter: 0.2,
            wobble: 0.2,
            detail: TileDetail { cells_ratio: 2.7, relief: 0.42, net: 0.10, net_srgb: srgb([168, 92, 66]) },
            ..Self::default()
        }
    }

    /// Gallbladder: grey-green to yellowish, with a fine net of vessels.
    pub fn gallbladder() -> Self {
        Self {
            cells_per_edge: 14.0,
            ramp: ColourRamp::from_srgb8(&[
                (0.0, [112, 122, 88]),
                (0.35, [121, 129, 92]),
                (0.62, [133, 138, 98]),
                (0.95, [150, 148, 106]),
            ]),
            cell_jitter: 0.14,
            wobble: 0.2,
            detail: TileDetail { cells_ratio: 3.4, relief: 0.4, net: 0.26, net_srgb: srgb([150, 108, 72]) },
            ..Self::default()
        }
    }

    /// Spleen: dark purple with a faint granulation.
    pub fn spleen() -> Self {
        Self {
            cells_per_edge: 20.0,
            ramp: ColourRamp::from_srgb8(&[
                (0.0, [58, 22, 42]),
                (0.35, [69, 28, 49]),
                (0.65, [84, 37, 58]),
                (0.95, [104, 52, 72]),
            ]),
            cell_jitter: 0.2,
            wobble: 0.2,
            detail: TileDetail { cells_ratio: 2.6, relief: 0.4, net: 0.12, net_srgb: srgb([128, 78, 96]) },
            ..Self::default()
        }
    }

    /// Kidney: smooth red-brown under a thin, tight capsule.
    pub fn kidney() -> Self {
        Self {
            cells_per_edge: 16.0,
            ramp: ColourRamp::from_srgb8(&[
                (0.0, [122, 50, 42]),
                (0.4, [130, 56, 46]),
                (0.7, [140, 63, 51]),
                (0.95, [150, 72, 57]),
            ]),
            cell_jitter: 0.09,
            wobble: 0.2,
            detail: TileDetail { cells_ratio: 3.0, relief: 0.3, net: 0.10, net_srgb: srgb([172, 100, 80]) },
            ..Self::default()
        }
    }

    /// Mucosa: pink, large soft cells under fine vessels.
    pub fn mucosa() -> Self {
        Self {
            cells_per_edge: 13.0,
            ramp: ColourRamp::from_srgb8(&[
                (0.0, [216, 140, 130]),
                (0.4, [210, 129, 120]),
                (0.7, [201, 115, 108]),
                (1.0, [190, 98, 95]),
            ]),
            cell_jitter: 0.08,
            wobble: 0.22,
            detail: TileDetail { cells_ratio: 2.9, relief: 0.2, net: 0.25, net_srgb: srgb([168, 62, 64]) },
            ..Self::default()
        }
    }
}
