//! What burns look like, and the electrosurgical unit that makes them.

use crate::organ::surface::NEUTRAL_GLOSS;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Entries of a ramp.
const ENTRIES: usize = 256;

/// How a texel of a burn is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct BurnLook {
    /// Premultiplied RGBA, sRGB-encoded.
    pub colour: [u8; 4],
    /// 128 as dry skin, 0 dull.
    pub gloss: u8,
}

impl BurnLook {
    /// Skin that is not burnt.
    const NONE: Self = Self { colour: [0; 4], gloss: NEUTRAL_GLOSS };
}

/// A designer's stop of a [`BurnRamp`]: what tissue looks like that has received a dose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct BurnStop {
    /// Heat received per area, J/mm2; see [`HeatMap`](super::heat::HeatMap).
    pub dose_j_per_mm2: f32,
    /// sRGB-encoded colour, each part 0 to 1, not premultiplied.
    pub colour_srgb: [f32; 3],
    /// Opacity over the skin, 0 to 1.
    pub opacity: f32,
    /// 128 as dry skin, 0 dull.
    pub gloss: u8,
}

/// The look-up table from the dose of heat to the look: 256 entries, evenly spaced in the square root of the dose, so
/// that faint marks are resolved as well as char.
///
/// Between stops the looks change linearly along the table. Entry 0 is skin that is not burnt; the last stop's dose has
/// the last entry, and so has every greater one. Serialized as its stops.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(from = "Vec<BurnStop>", into = "Vec<BurnStop>")]
pub struct BurnRamp {
    stops: Vec<BurnStop>,
    looks: Vec<BurnLook>,
    indices_per_root: f32,
}

impl Default for BurnRamp {
    /// Yellow for marking, tan and brown for coagulation, brown-black for char.
    ///
    /// In the default layer of 1 mm, 0.15 J/mm2 over the threshold bring tissue to the boiling point; drying it takes
    /// about 1.5 more (water has 2.3 J/mm3, tissue three quarters of it), and carbon forms while it dries.
    fn default() -> Self {
        let stop =
            |dose_j_per_mm2, colour_srgb, opacity, gloss| BurnStop { dose_j_per_mm2, colour_srgb, opacity, gloss };
        Self::from_stops(&[
            stop(0.0, [0.96, 0.89, 0.55], 0.0, NEUTRAL_GLOSS),
            stop(0.05, [0.95, 0.87, 0.50], 0.20, 122),
            stop(0.32, [0.88, 0.74, 0.42], 0.54, 100),
            stop(0.50, [0.69, 0.48, 0.25], 0.76, 76),
            stop(0.70, [0.42, 0.26, 0.14], 0.90, 44),
            stop(0.95, [0.22, 0.13, 0.08], 0.96, 16),
            stop(2.00, [0.09, 0.06, 0.05], 1.0, 0),
        ])
    }
}

impl BurnRamp {
    /// A ramp through stops, in any order. Values out of range count as the nearest end of their range; stops with
    /// values that are no numbers, or whose dose is negative, do not count. With no stop of a positive dose left,
    /// burns do not show.
    pub fn from_stops(stops: &[BurnStop]) -> Self {
        let is_usable = |stop: &&BurnStop| {
            (0.0..f32::INFINITY).contains(&stop.dose_j_per_mm2)
                && stop.opacity.is_finite()
                && stop.colour_srgb.iter().all(|part| part.is_finite())
        };
        let mut stops: Vec<BurnStop> = stops.iter().filter(is_usable).copied().collect();
        for stop in &mut stops {
            stop.opacity = stop.opacity.clamp(0.0, 1.0);
            stop.colour_srgb = stop.colour_srgb.map(|part| part.clamp(0.0, 1.0));
        }
        // Stable, so that of two stops with the same dose the later one counts from there on.
        stops.sort_by(|a, b| a.dose_j_per_mm2.total_cmp(&b.dose_j_per_mm2));
        let full_root = stops.last().map_or(0.0, |stop| stop.dose_j_per_mm2).sqrt();
        if full_root == 0.0 {
            return Self { stops, looks: vec![BurnLook::NONE; ENTRIES], indices_per_root: 0.0 };
        }
        let indices_per_root = (ENTRIES - 1) as f32 / full_root;
        let look = |index: usize| {
            let root = index as f32 / indices_per_root;
            let next = stops.partition_point(|stop| stop.dose_j_per_mm2.sqrt() <= root);
            let above = stops[next.min(stops.len() - 1)];
            let below = stops[next.saturating_sub(1)];
            let (low, high) = (below.dose_j_per_mm2.sqrt(), above.dose_j_per_mm2.sqrt());
            between(&below, &above, if high > low { ((root - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 })
        };
        let looks = (0..ENTRIES).map(|index| if index == 0 { BurnLook::NONE } else { look(index) }).collect();
        Self { stops, looks, indices_per_root }
    }

    /// The stops, brought into range, in the order of their doses.
    pub fn stops(&self) -> &[BurnStop] {
        &self.stops
    }

    /// Entry for a dose in J/mm2; never falls as the dose grows. What is no number counts as no dose.
    pub fn index(&self, dose_j_per_mm2: f32) -> u8 {
        // The conversion ends at 255 and makes 0 of what is no number.
        (dose_j_per_mm2.max(0.0).sqrt() * self.indices_per_root + 0.5) as u8
    }

    /// Dose in J/mm2 that the middle of an entry stands for.
    pub fn dose_j_per_mm2(&self, index: u8) -> f32 {
        if self.indices_per_root > 0.0 { (f32::from(index) / self.indices_per_root).powi(2) } else { 0.0 }
    }

    /// Look of an entry.
    pub fn look(&self, index: u8) -> BurnLook {
        self.looks[usize::from(index)]
    }
}

impl From<Vec<BurnStop>> for BurnRamp {
    fn from(stops: Vec<BurnStop>) -> Self {
        Self::from_stops(&stops)
    }
}

impl From<BurnRamp> for Vec<BurnStop> {
    fn from(ramp: BurnRamp) -> Self {
        ramp.stops
    }
}

fn between(a: &BurnStop, b: &BurnStop, share: f32) -> BurnLook {
    let mix = |a: f32, b: f32| a + (b - a) * share;
    let opacity = mix(a.opacity, b.opacity);
    let part = |k: usize| byte(mix(a.colour_srgb[k], b.colour_srgb[k]) * opacity);
    BurnLook {
        colour: [part(0), part(1), part(2), byte(opacity)],
        gloss: mix(a.gloss.into(), b.gloss.into()).round() as u8,
    }
}

fn byte(share: f32) -> u8 {
    (share * 255.0).round() as u8
}

/// Duty cycle of a pure coagulation waveform: bursts with pauses about sixteen times as long.
const COAGULATION_DUTY: f64 = 0.06;

/// Share of the power that stays in the tissue as heat with the pure cut waveform: most of it boils the cells in the
/// spark's way and leaves as steam.
const CUT_HEAT_SHARE: f64 = 0.15;

/// The same with the coagulation waveform. The rest leaves with steam and smoke, or warms deeper tissue on the current's
/// way to the return electrode.
const COAGULATION_HEAT_SHARE: f64 = 0.6;

/// Radius over which the cut waveform lays its heat, per radius of the spot: the arc stays where the edge is closest.
const CUT_SPREAD: f64 = 0.5;

/// The same for the coagulation waveform, whose peak voltage is several times higher: its sparks reach beyond the spot.
const COAGULATION_SPREAD: f64 = 1.25;

/// A monopolar electrosurgical unit and its tip.
///
/// The power that a unit is set to is the mean one, whatever the waveform. A continuous waveform (duty cycle 1) is for
/// cutting: cells boil along a narrow line and what lies beside it stays cool. The same power in short bursts of high
/// voltage (duty cycle about 0.06) dries, chars and seals a wider spot instead. Blends lie between, with duty cycles
/// of 0.8 to 0.25. How much heat stays and how far it reaches go with the logarithm of the duty cycle here, so that
/// each halving changes them by as much; the shares at both ends are set for the looks that surgeons know.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct Cautery {
    /// Mean power into the tissue, watts. Units are used at 10 to 200; more counts as 200, less than nothing as none.
    pub power_w: f64,
    /// Share of the time in which the current flows, 0.02 to 1.
    pub duty_cycle: f64,
    /// Radius of the tip's contact with the tissue, metres; 0.1 to 10 mm.
    pub spot_radius_m: f64,
}

impl Default for Cautery {
    /// Coagulation with a ball or spatula of 2 mm at 20 W: a light pass at 2 cm/s marks, a second one crossing it
    /// browns, and a third, or standing for a second, chars.
    fn default() -> Self {
        Self { power_w: 20.0, duty_cycle: COAGULATION_DUTY, spot_radius_m: 1e-3 }
    }
}

impl Cautery {
    /// Pure cut at a power in watts, otherwise as by default.
    pub fn cut(power_w: f64) -> Self {
        Self { power_w, duty_cycle: 1.0, ..Self::default() }
    }

    /// A blend of cut and coagulation, half of the time on.
    pub fn blend(power_w: f64) -> Self {
        Self { power_w, duty_cycle: 0.5, ..Self::default() }
    }

    /// Coagulation at a power in watts, otherwise as by default.
    pub fn coagulate(power_w: f64) -> Self {
        Self { power_w, ..Self::default() }
    }

    /// Heat that stays in the tissue of what the unit gives in a time of up to one second, joules. Zero for times that
    /// are not positive numbers.
    pub fn heat_j(&self, dt_s: f64) -> f64 {
        let power_w = if self.power_w.is_nan() { 0.0 } else { self.power_w.clamp(0.0, 200.0) };
        let dt_s = if dt_s.is_nan() { 0.0 } else { dt_s.clamp(0.0, 1.0) };
        power_w * dt_s * mix(CUT_HEAT_SHARE, COAGULATION_HEAT_SHARE, self.coagulation())
    }

    /// Radius of the disk over which the heat is laid, falling from the middle to nothing at the rim as
    /// [`Cautery::weight`] says, metres.
    pub fn heat_radius_m(&self) -> f64 {
        let radius_m = if self.spot_radius_m.is_nan() {
            Self::default().spot_radius_m
        } else {
            self.spot_radius_m.clamp(1e-4, 1e-2)
        };
        radius_m * mix(CUT_SPREAD, COAGULATION_SPREAD, self.coagulation())
    }

    /// Heat per area at a distance from the middle, as a share of the radius, relative to the middle.
    pub fn weight(share_of_radius: f32) -> f32 {
        (1.0 - share_of_radius * share_of_radius).max(0.0)
    }

    /// From cut (0) to coagulation (1).
    fn coagulation(&self) -> f64 {
        let duty_cycle = if self.duty_cycle.is_nan() { COAGULATION_DUTY } else { self.duty_cycle.clamp(0.02, 1.0) };
        (duty_cycle.ln() / COAGULATION_DUTY.ln()).clamp(0.0, 1.0)
    }
}

fn mix(a: f64, b: f64, share: f64) -> f64 {
    a + (b - a) * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_goes_from_nothing_over_yellow_to_dull_brown_black() {
        let ramp = BurnRamp::default();
        assert_eq!(ramp.look(0), BurnLook::NONE);
        assert_eq!(ramp.index(0.0), 0);
        for index in 0..=255u8 {
            assert_eq!(ramp.index(ramp.dose_j_per_mm2(index)), index);
            let look = ramp.look(index);
            assert!(look.colour[..3].iter().all(|&part| part <= look.colour[3]), "premultiplied: {look:?}");
        }
        for pair in ramp.looks.windows(2) {
            assert!(pair[1].gloss <= pair[0].gloss && pair[1].colour[3] >= pair[0].colour[3]);
        }
        let [r, g, b, a] = ramp.look(ramp.index(0.2)).colour.map(f32::from);
        assert!(r > g && g > 1.5 * b && g / a > 0.7 && a < 180.0, "translucent yellow: {r} {g} {b} {a}");
        let char = ramp.look(ramp.index(5.0));
        assert_eq!((char.colour[3], char.gloss), (255, 0));
        assert!(char.colour[..3].iter().all(|&part| part < 30) && char.colour[0] > char.colour[2]);
    }

    #[test]
    fn indices_never_fall_and_end_at_the_table() {
        let ramp = BurnRamp::default();
        let doses = (0..20_000).map(|k| k as f32 * 2e-4);
        assert!(doses.clone().zip(doses.skip(1)).all(|(a, b)| ramp.index(a) <= ramp.index(b)));
        assert_eq!([f32::NAN, -1.0, f32::NEG_INFINITY].map(|dose| ramp.index(dose)), [0; 3]);
        assert_eq!([2.0, 1e30, f32::INFINITY].map(|dose| ramp.index(dose)), [255; 3]);
    }

    #[test]
    fn stops_are_met_whatever_their_order_and_bad_ones_do_not_count() {
        let stop =
            |dose_j_per_mm2, red, gloss| BurnStop { dose_j_per_mm2, colour_srgb: [red, 0.0, 0.0], opacity: 1.0, gloss };
        let ramp = BurnRamp::from_stops(&[stop(4.0, 1.0, 0), stop(f32::NAN, 9.0, 0), stop(1.0, 0.0, 100)]);
        assert_eq!(ramp.stops().len(), 2);
        assert_eq!(ramp.look(ramp.index(4.0)), BurnLook { colour: [255, 0, 0, 255], gloss: 0 });
        // Halfway in the square root: 1.5 squared.
        assert_eq!(ramp.look(ramp.index(2.25)).gloss, 50);
        assert_eq!(ramp.look(1).gloss, 100, "below the first stop its look holds");
        let [steep] = [BurnRamp::from_stops(&[stop(1.0, 0.0, 100), stop(1.0, 1.0, 7)])];
        assert_eq!(steep.look(255).gloss, 7);
        for none in [&[][..], &[stop(0.0, 1.0, 0)], &[stop(-1.0, 1.0, 0)], &[stop(f32::INFINITY, 1.0, 0)]] {
            let ramp = BurnRamp::from_stops(none);
            assert_eq!(ramp.look(ramp.index(9.0)), BurnLook::NONE);
            assert_eq!(ramp.dose_j_per_mm2(200), 0.0);
        }
        let stops: Vec<BurnStop> = ramp.clone().into();
        assert_eq!(BurnRamp::from(stops), ramp);
    }

    #[test]
    fn coagulation_keeps_more_heat_and_spreads_it_wider_than_cutting() {
        let units = [Cautery::cut(40.0), Cautery::blend(40.0), Cautery::coagulate(40.0)];
        for pair in units.windows(2) {
            assert!(pair[0].heat_j(0.1) < pair[1].heat_j(0.1));
            assert!(pair[0].heat_radius_m() < pair[1].heat_radius_m());
        }
        assert!((units[2].heat_j(0.5) - 0.6 * 40.0 * 0.5).abs() < 1e-12);
        assert!((units[0].heat_j(0.5) - 0.15 * 40.0 * 0.5).abs() < 1e-12);
    }

    #[test]
    fn any_setting_gives_finite_heat() {
        let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e300];
        for value in odd {
            let unit = Cautery { power_w: value, duty_cycle: value, spot_radius_m: value };
            assert!((0.0..=200.0).contains(&unit.heat_j(1.0)), "{value}");
            assert!((1e-5..=2e-2).contains(&unit.heat_radius_m()), "{value}");
            assert!((0.0..=20.0).contains(&Cautery::default().heat_j(value)), "{value}");
        }
        assert_eq!(Cautery { power_w: f64::NAN, ..Default::default() }.heat_j(1.0), 0.0);
    }
}
