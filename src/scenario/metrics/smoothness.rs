//! How smooth one movement is: SPARC and jerk, as in <https://github.com/siva82kb/smoothness> (Balasubramanian and others 2015).
//!
//! Both are of single movements of at most a few seconds; cut a run into movements first.

use super::motion::{finite, is_rate};
use std::f64::consts::TAU;

/// Frequencies above this are noise, hertz.
pub const SPARC_CUTOFF_HZ: f64 = 10.0;
/// The spectrum ends where it stays below this share of its largest value.
pub const SPARC_THRESHOLD: f64 = 0.05;
/// The movement is padded with zeros to this power of two times its length.
const PADDING_LEVEL: u32 = 4;
/// Longer ones are not a movement; their spectrum is not computed.
const MOST_SAMPLES: usize = 8192;

/// Spectral arc length of a row of speeds, negative; nearer to 0 is smoother. None where there are fewer than two speeds, or
/// more than a movement has, where one is negative or no number, and where nothing moves.
///
/// The transform is evaluated at the few frequencies up to [`SPARC_CUTOFF_HZ`] that count: a whole FFT would not be faster for
/// such short rows.
pub fn sparc(speeds: &[f64], rate_hz: f64) -> Option<f64> {
    let is_speed = |speed: &f64| speed.is_finite() && *speed >= 0.0;
    if speeds.len() < 2 || speeds.len() > MOST_SAMPLES || !is_rate(rate_hz) || !speeds.iter().all(is_speed) {
        return None;
    }
    // Scaled to 1, so that squares of very small or large speeds stay numbers.
    let peak = speeds.iter().copied().fold(0.0, f64::max);
    let speeds: Vec<f64> = speeds.iter().map(|speed| speed / peak).collect();
    let size = speeds.len().next_power_of_two() << PADDING_LEVEL;
    // No part of the spectrum of what is never negative is larger than the part at 0.
    let largest: f64 = finite(speeds.iter().sum::<f64>()).filter(|sum| *sum > 0.0)?;
    let step_hz = rate_hz / size as f64;
    let circle: Vec<(f64, f64)> = (0..size).map(|index| (TAU * index as f64 / size as f64).sin_cos()).collect();
    let mut spectrum: Vec<f64> = (0..size)
        .take_while(|bin| *bin as f64 * step_hz <= SPARC_CUTOFF_HZ)
        .map(|bin| {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (index, speed) in speeds.iter().enumerate() {
                let (sin, cos) = circle[(bin * index) % size];
                real += speed * cos;
                imaginary -= speed * sin;
            }
            real.hypot(imaginary) / largest
        })
        .collect();
    // The part at 0 is 1, so it begins there.
    let last = spectrum.iter().rposition(|share| *share >= SPARC_THRESHOLD)?;
    spectrum.truncate(last + 1);
    let across = 1.0 / last as f64;
    let length: f64 = spectrum.windows(2).map(|pair| across.hypot(pair[1] - pair[0])).sum();
    if last == 0 { None } else { finite(-length) }
}

/// Dimensionless jerk of a row of speeds, negative; nearer to 0 is smoother:
/// `-(T³ / peak²) · Σ (d²v/dt²)² · dt`, with `T` the number of speeds over the rate. None where there are fewer than three
/// speeds, where one is no number, and where nothing moves.
pub fn dimensionless_jerk(speeds: &[f64], rate_hz: f64) -> Option<f64> {
    if speeds.len() < 3 || !is_rate(rate_hz) || !speeds.iter().all(|speed| speed.is_finite()) {
        return None;
    }
    let peak = speeds.iter().map(|speed| speed.abs()).fold(0.0, f64::max);
    if peak == 0.0 {
        return None;
    }
    // Scaled to a peak of 1 and a step of 1: the rate falls out.
    let jerk = |three: &[f64]| (three[2] / peak - 2.0 * (three[1] / peak) + three[0] / peak).powi(2);
    let sum: f64 = speeds.windows(3).map(jerk).sum();
    finite(-(speeds.len() as f64).powi(3) * sum)
}

/// Log dimensionless jerk: `-ln |DLJ|`; larger is smoother. None where [`dimensionless_jerk`] is none or 0.
pub fn log_dimensionless_jerk(speeds: &[f64], rate_hz: f64) -> Option<f64> {
    finite(-dimensionless_jerk(speeds, rate_hz)?.abs().ln())
}
