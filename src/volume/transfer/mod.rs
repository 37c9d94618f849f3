//! What values look like: control points that a designer edits, baked to the table that renderers read.

mod colours;
mod presets;
mod table;

pub use colours::colours;
pub use table::{TABLE_ENTRIES, TransferTable};

use bevy::color::Srgba;
use bevy::ecs::VariantDefaults;
use bevy::prelude::{Component, ReflectComponent, ReflectDefault};
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// One control point of a transfer function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct ControlPoint {
    /// The value it stands at, in the units that [`TransferFunction::scale`] names.
    pub value: f64,
    /// Colour, sRGB.
    pub colour: [u8; 3],
    /// Share of light, 0 to 1, that [`TransferFunction::reference_length_m`] of such material absorbs.
    pub opacity: f32,
}

/// What the values of control points are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum ValueScale {
    /// Values of the volume: Hounsfield units for CT.
    #[default]
    Values,
    /// Shares of the volume's range: 0 is its least value, 1 its greatest.
    ShareOfRange,
}

/// Where colours come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum ColourSource {
    /// From the control points.
    #[default]
    Points,
    /// From the voxels: the colours of the structures or of the volume itself ([`colours`]). Control points give the opacity only.
    Voxels,
}

/// Colour and opacity of a volume's values.
///
/// Any list of points is usable: for a table it is put in order (the field itself stays as the designer left it). Points whose
/// value is NaN or infinite are left out, opacities are clamped to 0..=1 (NaN is 0), points are sorted by value. Two points at
/// one value make a step, the first in the list holds below and the last at and above it; others between these are left out.
/// Between points colours are mixed in sRGB and opacities linearly; beyond the outermost points theirs hold. Without any usable
/// point nothing is visible.
#[derive(Component, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub struct TransferFunction {
    /// The control points, in any order.
    pub points: Vec<ControlPoint>,
    /// What the values of the points are.
    pub scale: ValueScale,
    /// Length of material that absorbs a point's opacity, metres. Short lengths make surfaces crisp. What is not a positive
    /// number counts as 1 mm.
    pub reference_length_m: f64,
    /// Where colours come from.
    pub colour_source: ColourSource,
}

/// The reference length where none is given, metres.
const DEFAULT_REFERENCE_LENGTH_M: f64 = 1e-3;

impl Default for TransferFunction {
    /// A grey ramp over the upper three quarters of the range, for volumes of which nothing is known.
    fn default() -> Self {
        Self {
            points: vec![
                ControlPoint { value: 0.25, colour: [90; 3], opacity: 0.0 },
                ControlPoint { value: 1.0, colour: [255; 3], opacity: 1.0 },
            ],
            scale: ValueScale::ShareOfRange,
            reference_length_m: DEFAULT_REFERENCE_LENGTH_M,
            colour_source: ColourSource::Points,
        }
    }
}

impl TransferFunction {
    /// Window and level, as radiologists set them: a grey ramp from black at `centre - width / 2`, which is invisible, to opaque
    /// white at `centre + width / 2`. A width of 0 or less is a step at the centre; what is no number makes nothing visible.
    pub fn window(centre: f64, width: f64) -> Self {
        let half = 0.5 * width.max(0.0);
        let point = |value, grey: u8, opacity| ControlPoint { value, colour: [grey; 3], opacity };
        Self {
            points: if width.is_nan() {
                Vec::new()
            } else {
                vec![point(centre - half, 0, 0.0), point(centre + half, 255, 1.0)]
            },
            scale: ValueScale::Values,
            ..Self::default()
        }
    }

    /// The points in order, as tables use them: see the type.
    pub fn sorted_points(&self) -> Vec<ControlPoint> {
        let usable = |point: &ControlPoint| -> Option<ControlPoint> {
            // NaN compares with nothing, so it takes the other side.
            let opacity = if point.opacity > 0.0 { point.opacity.min(1.0) } else { 0.0 };
            point.value.is_finite().then_some(ControlPoint { opacity, ..*point })
        };
        let mut points: Vec<ControlPoint> = self.points.iter().filter_map(usable).collect();
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        let mut kept: Vec<ControlPoint> = Vec::with_capacity(points.len());
        for point in points {
            match kept.as_mut_slice() {
                [.., before, last] if before.value == point.value => *last = point,
                _ => kept.push(point),
            }
        }
        kept
    }

    /// The reference length that counts, metres.
    pub fn usable_reference_length_m(&self) -> f64 {
        let length = self.reference_length_m;
        if length.is_finite() && length > 0.0 { length } else { DEFAULT_REFERENCE_LENGTH_M }
    }

    /// Bakes the table that renderers read, for a volume with values in `range` that is sampled every `step_m` metres.
    ///
    /// Entry `e` is the colour (linear RGB, not multiplied by the opacity) and the opacity of one step at the value
    /// `range[0] + e / 1023 * (range[1] - range[0])`. An opacity `a` per reference length becomes
    /// `1 - (1 - a)^(step / reference)`, so the picture does not depend on the step; `a = 1` stays opaque at any step. A step
    /// that is no positive number is taken as one reference length. A range that is not finite makes nothing visible.
    pub fn bake(&self, range: [f64; 2], step_m: f64) -> TransferTable {
        let reference = self.usable_reference_length_m();
        let is_length = step_m.is_finite() && step_m > 0.0;
        // Finite even where the quotient is not: nothing times infinity would be no number.
        let steps_per_reference = if is_length { (step_m / reference).min(f64::MAX) } else { 1.0 };
        let points = self.sorted_points();
        let is_usable = range[0].is_finite() && range[1].is_finite();
        let entry = |number: usize| -> [f32; 4] {
            let share = number as f64 / (TABLE_ENTRIES - 1) as f64;
            let value = match self.scale {
                ValueScale::Values => range[0] + share * (range[1] - range[0]),
                ValueScale::ShareOfRange => share,
            };
            if !is_usable {
                return [1.0, 1.0, 1.0, 0.0];
            }
            let (srgb, opacity) = at(&points, value);
            // The logarithm keeps digits of faint opacities that a power would lose; of 1 it is infinite.
            let corrected =
                if opacity < 1.0 { 0.0 - f64::exp_m1(steps_per_reference * f64::ln_1p(-opacity)) } else { 1.0 };
            let [r, g, b] = srgb.map(|channel| Srgba::gamma_function(channel as f32 / 255.0));
            [r, g, b, corrected as f32]
        };
        TransferTable::new(&std::array::from_fn(entry))
    }
}

/// Colour (sRGB, 0 to 255) and opacity of a value between points that are in order.
fn at(points: &[ControlPoint], value: f64) -> ([f64; 3], f64) {
    let after = points.partition_point(|point| point.value <= value);
    let (low, high) = match (points.get(after.wrapping_sub(1)), points.get(after)) {
        (Some(low), Some(high)) => (low, high),
        (Some(only), None) | (None, Some(only)) => (only, only),
        (None, None) => return ([255.0; 3], 0.0),
    };
    let width = high.value - low.value;
    let share = if width > 0.0 { ((value - low.value) / width).clamp(0.0, 1.0) } else { 0.0 };
    let mix = |a: f64, b: f64| a + (b - a) * share;
    let colour = std::array::from_fn(|channel| mix(low.colour[channel].into(), high.colour[channel].into()));
    (colour, mix(low.opacity.into(), high.opacity.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(value: f64, opacity: f32) -> ControlPoint {
        ControlPoint { value, colour: [200; 3], opacity }
    }

    #[test]
    fn points_in_any_order_with_any_numbers_are_put_right() {
        let points = vec![
            point(5.0, 2.0),
            point(f64::NAN, 0.5),
            point(1.0, f32::NAN),
            point(f64::INFINITY, 1.0),
            point(3.0, -1.0),
        ];
        let sorted = TransferFunction { points, ..Default::default() }.sorted_points();
        assert_eq!(sorted, [point(1.0, 0.0), point(3.0, 0.0), point(5.0, 1.0)]);
    }

    #[test]
    fn points_at_one_value_are_a_step() {
        let points = vec![point(0.0, 0.1), point(0.5, 0.2), point(0.5, 0.9), point(0.5, 0.7), point(1.0, 0.8)];
        let points = TransferFunction { points, ..Default::default() }.sorted_points();
        assert_eq!(points, [point(0.0, 0.1), point(0.5, 0.2), point(0.5, 0.7), point(1.0, 0.8)]);
        assert!((at(&points, 0.5 - 1e-9).1 - 0.2).abs() < 1e-6);
        assert!((at(&points, 0.5).1 - f64::from(0.7f32)).abs() < 1e-12);
    }

    #[test]
    fn a_window_is_a_grey_ramp() {
        let table = TransferFunction::window(40.0, 400.0).bake([-1000.0, 1000.0], 1e-3);
        let at_value = |value: f64| table.entry(((value + 1000.0) / 2000.0) as f32);
        assert_eq!(at_value(-500.0), [0.0, 0.0, 0.0, 0.0]);
        assert_eq!(at_value(900.0), [1.0, 1.0, 1.0, 1.0]);
        let middle = at_value(40.0);
        assert!((middle[3] - 0.5).abs() < 3e-3, "{middle:?}");
        assert!((middle[0] - 0.214).abs() < 5e-3, "half grey in sRGB: {middle:?}");
    }
}
