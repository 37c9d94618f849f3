//! How hard an instrument presses.

use super::motion::{finite, is_rate};

/// Forces in a row of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceStats {
    /// The mean while it presses, newtons.
    pub mean_n: f64,
    /// The largest, newtons.
    pub max_n: f64,
    /// Their sum over time, newton seconds.
    pub impulse_n_s: f64,
    /// How long it presses, seconds.
    pub time_s: f64,
}

/// Mean, largest and sum of forces. Samples without force are not counted in the mean; forces that are negative or no number are
/// left out. None where nothing presses.
pub fn force_stats(forces_n: &[f64], rate_hz: f64) -> Option<ForceStats> {
    if !is_rate(rate_hz) {
        return None;
    }
    let (mut count, mut sum_n, mut max_n) = (0_u64, 0.0, 0.0_f64);
    for force_n in forces_n.iter().copied().filter(|force_n| force_n.is_finite() && *force_n > 0.0) {
        count += 1;
        sum_n += force_n;
        max_n = max_n.max(force_n);
    }
    let mean_n = (count > 0).then_some(sum_n / count as f64).and_then(finite)?;
    Some(ForceStats { mean_n, max_n, impulse_n_s: finite(sum_n / rate_hz)?, time_s: count as f64 / rate_hz })
}

/// The values of those samples that are nearer than a distance; a sample without a distance is far.
pub fn near(values: &[f64], distances_m: &[Option<f64>], within_m: f64) -> Vec<f64> {
    let is_near = |distance_m: &Option<f64>| distance_m.is_some_and(|distance_m| distance_m <= within_m);
    values.iter().zip(distances_m).filter(|(_, distance_m)| is_near(distance_m)).map(|(value, _)| *value).collect()
}
