//! Turning a Worley distance into a colour, and the sRGB transfer curve in exact, repeatable arithmetic.

use super::TileError;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// One control point of a [`ColourRamp`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct RampStop {
    /// Distance to the nearest feature point divided by the Poisson radius: 0 is a cell's middle, borders between two
    /// cells lie at 0.5 and beyond, corners between three cells near 0.8 to 1.
    pub position: f32,
    /// sRGB-encoded colour, each channel in 0..=1, as a colour picker shows it.
    pub colour_srgb: [f32; 3],
}

impl RampStop {
    /// A control point from 8-bit sRGB.
    pub const fn new(position: f32, [r, g, b]: [u8; 3]) -> Self {
        Self { position, colour_srgb: [r as f32 / 255.0, g as f32 / 255.0, b as f32 / 255.0] }
    }
}

/// A piecewise linear colour map over the normalised distance. Colours are given in sRGB and mixed in linear light;
/// before the first and after the last control point the colour stays constant.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct ColourRamp {
    /// Control points in ascending order of position, at least one.
    pub stops: Vec<RampStop>,
}

impl ColourRamp {
    /// A ramp from (position, 8-bit sRGB) pairs in ascending order of position.
    pub fn from_srgb8(stops: &[(f32, [u8; 3])]) -> Self {
        Self { stops: stops.iter().map(|&(position, colour)| RampStop::new(position, colour)).collect() }
    }

    /// The colour at a normalised distance, linear light.
    pub fn colour_linear(&self, position: f64) -> [f64; 3] {
        let after = self.stops.partition_point(|stop| f64::from(stop.position) <= position);
        let linear = |index: usize| {
            self.stops.get(index).map_or([0.0; 3], |stop| stop.colour_srgb.map(|c| linear_from_srgb(f64::from(c))))
        };
        if after == 0 {
            return linear(0);
        }
        if after == self.stops.len() {
            return linear(after - 1);
        }
        let (low, high) = (f64::from(self.stops[after - 1].position), f64::from(self.stops[after].position));
        mix(linear(after - 1), linear(after), (position - low) / (high - low))
    }

    /// Refuses empty ramps, positions out of order and colours outside 0..=1.
    pub fn validate(&self) -> Result<(), TileError> {
        let wrong = |what: String| Err(TileError::Options { field: "ramp", what });
        if self.stops.is_empty() {
            return wrong("needs at least one control point".into());
        }
        for (index, stop) in self.stops.iter().enumerate() {
            if !stop.position.is_finite() || !(-4.0..=4.0).contains(&stop.position) {
                return wrong(format!("position of control point {index} is {}, not in -4..=4", stop.position));
            }
            if let Some(channel) = stop.colour_srgb.iter().find(|c| !(0.0..=1.0).contains(*c)) {
                return wrong(format!("colour of control point {index} has a channel of {channel}, not in 0..=1"));
            }
            if index > 0 && stop.position <= self.stops[index - 1].position {
                return wrong(format!("control point {index} does not lie after the one before it"));
            }
        }
        Ok(())
    }
}

/// A ramp sampled finely, so that a texel costs one interpolation.
pub(super) struct RampTable {
    colours: Vec<[f64; 3]>,
}

impl RampTable {
    const STEPS: usize = 2048;
    const END: f64 = 2.0;

    pub(super) fn new(ramp: &ColourRamp) -> Self {
        let colours =
            (0..=Self::STEPS).map(|step| ramp.colour_linear(step as f64 * Self::END / Self::STEPS as f64)).collect();
        Self { colours }
    }

    pub(super) fn colour(&self, position: f64) -> [f64; 3] {
        let place = (position * (Self::STEPS as f64 / Self::END)).clamp(0.0, Self::STEPS as f64 - 1e-9);
        let index = place as usize;
        mix(self.colours[index], self.colours[index + 1], place - index as f64)
    }
}

pub(super) fn mix(a: [f64; 3], b: [f64; 3], share_of_b: f64) -> [f64; 3] {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share_of_b)
}

/// Hermite step from 0 at `low` to 1 at `high`.
pub(super) fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// sRGB transfer curve, decoded (IEC 61966-2-1).
pub fn linear_from_srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// sRGB transfer curve, encoded (IEC 61966-2-1).
pub fn srgb_from_linear(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Linear light 1.0 in the fixed-point numbers that filters add up: sums of integers do not depend on their order, so
/// two edges that see the same colours in mirrored order still get the same bits.
pub(super) const FIXED_ONE: i32 = 1 << 20;

struct Tables {
    /// Fixed-point linear light of every 8-bit sRGB value.
    decode: [i32; 256],
    /// Largest fixed-point value that still rounds to the sRGB value of its index.
    last: [i32; 256],
    /// Lower bound of the sRGB value for the upper 12 bits of a fixed-point value.
    first_guess: Vec<u8>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let fixed = |encoded: f64| (linear_from_srgb(encoded) * f64::from(FIXED_ONE)).round() as i32;
    let decode = std::array::from_fn(|value| fixed(value as f64 / 255.0));
    let last: [i32; 256] =
        std::array::from_fn(|value| if value == 255 { i32::MAX } else { fixed((value as f64 + 0.5) / 255.0) });
    let first_guess =
        (0..=FIXED_ONE >> 8).map(|index| last.partition_point(|&limit| limit < index << 8) as u8).collect();
    Tables { decode, last, first_guess }
});

pub(super) fn fixed_from_linear(linear: [f64; 3]) -> [i32; 3] {
    linear.map(|c| (c.clamp(0.0, 1.0) * f64::from(FIXED_ONE) + 0.5) as i32)
}

pub(super) fn fixed_from_bytes(bytes: [u8; 3]) -> [i32; 3] {
    bytes.map(|byte| TABLES.decode[byte as usize])
}

/// Nearest 8-bit sRGB colour; values outside 0..=1 are clamped.
pub(super) fn bytes_from_fixed(fixed: [i32; 3]) -> [u8; 3] {
    let tables = &*TABLES;
    fixed.map(|value| {
        let value = value.clamp(0, FIXED_ONE);
        let mut byte = tables.first_guess[(value >> 8) as usize];
        while tables.last[byte as usize] < value {
            byte += 1;
        }
        byte
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eight_bit_colours_survive_linear_light() {
        for value in 0..=255u8 {
            assert_eq!(bytes_from_fixed(fixed_from_bytes([value; 3])), [value; 3]);
        }
        assert_eq!(bytes_from_fixed([-5, FIXED_ONE + 5, 0]), [0, 255, 0]);
    }

    #[test]
    fn encoding_by_table_rounds_like_the_formula() {
        for value in (0..=FIXED_ONE).step_by(37) {
            let exact = srgb_from_linear(f64::from(value) / f64::from(FIXED_ONE)) * 255.0;
            let byte = f64::from(bytes_from_fixed([value; 3])[0]);
            assert!((byte - exact).abs() <= 0.502, "{value}: {byte} against {exact}");
        }
    }

    #[test]
    fn ramp_mixes_in_linear_light_and_holds_its_ends() {
        let ramp = ColourRamp::from_srgb8(&[(0.25, [0, 0, 0]), (0.75, [255, 255, 255])]);
        assert_eq!(ramp.colour_linear(0.0), [0.0; 3]);
        assert_eq!(ramp.colour_linear(0.5), [0.5; 3]);
        assert_eq!(ramp.colour_linear(9.0), [1.0; 3]);
        let table = RampTable::new(&ramp);
        for position in [0.0, 0.3, 0.5, 0.61, 0.9, 3.0] {
            let (a, b) = (ramp.colour_linear(position)[0], table.colour(position)[0]);
            assert!((a - b).abs() < 2e-3, "{position}: {a} against {b}");
        }
    }
}
