//! SPARC and jerk against the published implementation.
//!
//! The numbers are of `python/smoothness.py` of siva82kb/smoothness (its formulas in numpy 2.4, in f64). The Gauss curve is the
//! one of its own documentation.

use super::near;
use bevy_surgery::scenario::metrics::smoothness::*;
use proptest::prelude::*;
use std::f64::consts::PI;

fn row(count: usize, at: impl Fn(f64) -> f64, rate_hz: f64) -> Vec<f64> {
    (0..count).map(|index| at(index as f64 / rate_hz)).collect()
}

fn gauss() -> Vec<f64> {
    row(200, |t| (-5.0 * (t - 1.0).powi(2)).exp(), 100.0)
}

/// The speed of a movement of one metre in one second with the least jerk.
fn least_jerk(t: f64) -> f64 {
    30.0 * t.powi(2) - 60.0 * t.powi(3) + 30.0 * t.powi(4)
}

fn three_bells(t: f64) -> f64 {
    let bell = |width: f64, at: f64| (-width * (t - at).powi(2)).exp();
    bell(40.0, 0.4) + 0.6 * bell(60.0, 1.0) + 0.8 * bell(50.0, 1.5)
}

#[test]
fn the_published_numbers() {
    let to_and_fro = |t: f64| (4.0 * PI * t).sin().abs() * 0.05;
    let slow = |t: f64| (PI * t / 2.4).sin().powi(2);
    for (speeds, rate_hz, expected) in [
        (gauss(), 100.0, [-1.414031262, -335.746837033, -5.816357415]),
        (row(61, least_jerk, 60.0), 60.0, [-1.400407743, -197.865308189, -5.287586538]),
        (row(1001, least_jerk, 1000.0), 1000.0, [-1.402426063, -204.389991630, -5.320029893]),
        (row(120, three_bells, 60.0), 60.0, [-3.009046344, -19825.981901025, -9.894748574]),
        (row(90, to_and_fro, 60.0), 60.0, [-3.503523029, -700508.455700114, -13.459561716]),
        // The cut-off lies above half the rate: the mirrored part counts there too.
        (row(37, slow, 15.0), 15.0, [-1.401103674, -198.745872553, -5.292026986]),
    ] {
        near(sparc(&speeds, rate_hz), expected[0], 1e-8);
        near(dimensionless_jerk(&speeds, rate_hz), expected[1], 1e-8);
        near(log_dimensionless_jerk(&speeds, rate_hz), expected[2], 1e-8);
    }
}

#[test]
fn the_least_jerk_comes_to_its_closed_form() {
    // T³ / peak² · ∫ jerk² dt = 720 · 64 / 225 for a minimum-jerk movement.
    near(dimensionless_jerk(&row(100_001, least_jerk, 1e5), 1e5), -204.8, 1e-4);
}

#[test]
fn what_is_less_smooth_has_smaller_numbers() {
    let (smooth, rough) = (row(120, |t| least_jerk(t / 2.0), 60.0), row(120, three_bells, 60.0));
    assert!(sparc(&smooth, 60.0) > sparc(&rough, 60.0));
    assert!(log_dimensionless_jerk(&smooth, 60.0) > log_dimensionless_jerk(&rough, 60.0));
}

#[test]
fn what_says_nothing_has_no_value() {
    let bad: [(&[f64], f64); 8] = [
        (&[], 60.0),
        (&[1.0], 60.0),
        (&[0.0; 30], 60.0),
        (&[1.0, f64::NAN, 1.0, 1.0], 60.0),
        (&[1.0, f64::INFINITY, 1.0, 1.0], 60.0),
        (&[1.0, 2.0, 1.0, 0.5], 0.0),
        (&[1.0, 2.0, 1.0, 0.5], f64::NAN),
        (&[1.0, 2.0, 1.0, 0.5], -60.0),
    ];
    for (speeds, rate_hz) in bad {
        assert_eq!(sparc(speeds, rate_hz), None, "{speeds:?} {rate_hz}");
        assert_eq!(dimensionless_jerk(speeds, rate_hz), None, "{speeds:?} {rate_hz}");
        assert_eq!(log_dimensionless_jerk(speeds, rate_hz), None, "{speeds:?} {rate_hz}");
    }
    assert_eq!(sparc(&[1.0, -1.0, 1.0], 60.0), None, "no speed is negative");
    assert_eq!(sparc(&vec![1.0; 1 << 20], 60.0), None, "no movement is that long");
    assert_eq!(log_dimensionless_jerk(&[2.0; 20], 60.0), None, "no jerk has no logarithm");
    assert_eq!(sparc(&[1.0, 2.0, 1.0], 1e9), None, "one frequency makes no arc");
}

proptest! {
    #[test]
    fn sparc_knows_neither_height_nor_time(height in 1e-6..1e6_f64, late in 0_usize..=56) {
        let speeds = gauss();
        let mut shifted = vec![0.0; late];
        shifted.extend(speeds.iter().map(|speed| speed * height));
        shifted.resize(256, 0.0);
        let mut plain = speeds;
        plain.resize(256, 0.0);
        // The same number of samples, so that both spectra are taken at the same frequencies.
        near(sparc(&shifted[..256], 100.0), sparc(&plain, 100.0).expect("a value"), 1e-9);
    }

    #[test]
    fn whatever_moves_has_numbers_or_none(speeds in prop::collection::vec(0.0..1e3_f64, 0..200), rate_hz in 1.0..2000.0_f64) {
        for value in [sparc(&speeds, rate_hz), dimensionless_jerk(&speeds, rate_hz)].into_iter().flatten() {
            prop_assert!(value.is_finite() && value <= 0.0, "{value}");
        }
        prop_assert!(log_dimensionless_jerk(&speeds, rate_hz).is_none_or(f64::is_finite));
    }
}
