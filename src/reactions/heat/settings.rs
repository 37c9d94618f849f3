//! What heated tissue is made of.

use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Longest cooling time, seconds; in a session it amounts to no cooling at all.
const LONGEST_COOLING_S: f64 = 1e9;

/// Physical constants of the heated surface layer.
///
/// Values out of range count as the nearest end of their range, those that are no numbers as the default.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct HeatSettings {
    /// Thickness of the layer that takes up the heat, metres; 10 micrometres to 5 cm. Electrosurgical marks on liver
    /// are from half a millimetre to a few millimetres deep.
    pub layer_thickness_m: f64,
    /// Density times specific heat capacity, J/(m3 K); 1e5 to 1e7. Liver: about 1060 kg/m3 times 3600 J/(kg K).
    pub heat_capacity_j_per_m3_k: f64,
    /// Thermal diffusivity along the surface, m2/s; 0 (none) to 1e-5. Liver: about 0.52 W/(m K) over the above.
    pub diffusivity_m2_per_s: f64,
    /// Time in which the layer's heat falls to 1/e by conduction into the depth, seconds; 0.01 to 1e9 (practically
    /// never).
    ///
    /// A layer of thickness `h` that loses no heat outwards and lies on tissue at body temperature cools in its slowest
    /// mode with `4 h^2 / (pi^2 diffusivity)`, 2.9 s for the other defaults. Blood flow (about 0.015 per second in
    /// liver) adds little, and coagulated tissue has none.
    pub cooling_time_s: f64,
    /// Rise over the body from which heat leaves a lasting mark, kelvin; 0 to 500. Proteins denature within seconds at
    /// 60 degrees Celsius, 23 K over the body.
    pub threshold_rise_k: f64,
    /// Greatest rise over the body, kelvin; 1 to 2000. Water boils off from 100 degrees Celsius on and carbon forms
    /// above 200: what arrives beyond this leaves at once with steam and smoke. It still counts as received.
    pub ceiling_rise_k: f64,
    /// Rise under which a tile counts as cold and is no longer computed, kelvin; 1e-4 to 1.
    pub cold_rise_k: f64,
}

impl Default for HeatSettings {
    fn default() -> Self {
        Self {
            layer_thickness_m: 1e-3,
            heat_capacity_j_per_m3_k: 3.8e6,
            diffusivity_m2_per_s: 1.4e-7,
            cooling_time_s: 2.9,
            threshold_rise_k: 23.0,
            ceiling_rise_k: 263.0,
            cold_rise_k: 0.05,
        }
    }
}

impl HeatSettings {
    /// The same with every value in its range.
    pub fn clamped(&self) -> Self {
        let default = Self::default();
        let within = |value: f64, default: f64, low: f64, high: f64| {
            if value.is_nan() { default } else { value.clamp(low, high) }
        };
        Self {
            layer_thickness_m: within(self.layer_thickness_m, default.layer_thickness_m, 1e-5, 0.05),
            heat_capacity_j_per_m3_k: within(self.heat_capacity_j_per_m3_k, default.heat_capacity_j_per_m3_k, 1e5, 1e7),
            diffusivity_m2_per_s: within(self.diffusivity_m2_per_s, default.diffusivity_m2_per_s, 0.0, 1e-5),
            cooling_time_s: within(self.cooling_time_s, default.cooling_time_s, 0.01, LONGEST_COOLING_S),
            threshold_rise_k: within(self.threshold_rise_k, default.threshold_rise_k, 0.0, 500.0),
            ceiling_rise_k: within(self.ceiling_rise_k, default.ceiling_rise_k, 1.0, 2000.0),
            cold_rise_k: within(self.cold_rise_k, default.cold_rise_k, 1e-4, 1.0),
        }
    }

    /// Heat that warms the layer by one kelvin, J/(m2 K).
    pub fn areal_capacity_j_per_m2_k(&self) -> f64 {
        self.layer_thickness_m * self.heat_capacity_j_per_m3_k
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_in_range_and_cool_as_the_layer_does() {
        let default = HeatSettings::default();
        assert_eq!(default.clamped(), default);
        let slowest_mode_s =
            4.0 * default.layer_thickness_m.powi(2) / (std::f64::consts::PI.powi(2) * default.diffusivity_m2_per_s);
        assert!((slowest_mode_s / default.cooling_time_s - 1.0).abs() < 0.01, "{slowest_mode_s}");
    }

    #[test]
    fn wrong_values_are_brought_into_range() {
        let wrong = HeatSettings {
            layer_thickness_m: -1.0,
            heat_capacity_j_per_m3_k: f64::NAN,
            diffusivity_m2_per_s: f64::INFINITY,
            cooling_time_s: f64::INFINITY,
            threshold_rise_k: f64::NEG_INFINITY,
            ceiling_rise_k: 0.0,
            cold_rise_k: 1e9,
        };
        let clamped = wrong.clamped();
        assert_eq!(
            clamped,
            HeatSettings {
                layer_thickness_m: 1e-5,
                heat_capacity_j_per_m3_k: 3.8e6,
                diffusivity_m2_per_s: 1e-5,
                cooling_time_s: 1e9,
                threshold_rise_k: 0.0,
                ceiling_rise_k: 1.0,
                cold_rise_k: 1.0,
            }
        );
    }
}
