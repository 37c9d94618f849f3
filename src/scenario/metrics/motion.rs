//! Time, way and speed of a tip. Every function answers none where its input says nothing, and never a number that is none.

use bevy::math::DVec3;
use std::ops::Range;

/// Tips slower than this are still, metres per second. A hand that holds an instrument still trembles at about 1 mm/s.
pub const IDLE_M_PER_S: f64 = 5e-3;

/// Length of the way through places, metres: the sum of the distances between neighbours.
pub fn path_length_m(positions_m: &[DVec3]) -> Option<f64> {
    if positions_m.is_empty() || !positions_m.iter().all(|place| place.is_finite()) {
        return None;
    }
    finite(positions_m.windows(2).map(|pair| pair[0].distance(pair[1])).sum())
}

/// Straight distance between the ends of a way over its length, 0 to 1; none for a way without length.
///
/// A straight line is no ideal for a whole operation (Chmarra 2008, doi 10.1007/s00464-007-9526-z: surgeons draw back before
/// they go elsewhere), but it is one for a single movement: give it one at a time.
pub fn economy(positions_m: &[DVec3]) -> Option<f64> {
    let path_m = path_length_m(positions_m)?;
    let (first, last) = (positions_m.first()?, positions_m.last()?);
    // Rounding must not make a straight way better than straight.
    finite(first.distance(*last) / path_m).map(|share| share.min(1.0))
}

/// Way along the instrument's axis, metres: the sum of |step · axis|, the axis in the mean of both ends of the step.
pub fn depth_m(positions_m: &[DVec3], axes: &[DVec3]) -> Option<f64> {
    if positions_m.is_empty() || positions_m.len() != axes.len() {
        return None;
    }
    let steps = positions_m.windows(2).zip(axes.windows(2));
    finite(steps.map(|(place, axis)| (place[1] - place[0]).dot(0.5 * (axis[0] + axis[1])).abs()).sum())
}

/// Speed between neighbours, metres per second: one fewer than places. Empty where there is none.
pub fn speeds_m_per_s(positions_m: &[DVec3], rate_hz: f64) -> Vec<f64> {
    if !is_rate(rate_hz) {
        return Vec::new();
    }
    positions_m.windows(2).map(|pair| pair[0].distance(pair[1]) * rate_hz).collect()
}

/// The mean of numbers.
pub fn mean(values: &[f64]) -> Option<f64> {
    if values.is_empty() { None } else { finite(values.iter().sum::<f64>() / values.len() as f64) }
}

/// The largest of numbers; none where one of them is none.
pub fn largest(values: &[f64]) -> Option<f64> {
    values.iter().copied().map(finite).reduce(|a, b| Some(a?.max(b?))).flatten()
}

/// The middle of numbers, or the mean of the middle two.
pub fn median(values: &[f64]) -> Option<f64> {
    if values.is_empty() || !values.iter().all(|value| value.is_finite()) {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 { Some(sorted[middle]) } else { finite(0.5 * (sorted[middle - 1] + sorted[middle])) }
}

/// Seconds in which speeds are below a limit.
pub fn idle_s(speeds_m_per_s: &[f64], rate_hz: f64, below_m_per_s: f64) -> Option<f64> {
    if speeds_m_per_s.is_empty() || !is_rate(rate_hz) || !speeds_m_per_s.iter().all(|speed| speed.is_finite()) {
        return None;
    }
    Some(speeds_m_per_s.iter().filter(|speed| **speed < below_m_per_s).count() as f64 / rate_hz)
}

/// What counts as one movement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovementRule {
    /// Slower than this is rest, metres per second.
    pub above_m_per_s: f64,
    /// Shortest movement, seconds.
    pub min_s: f64,
    /// Longest one, seconds: what lasts longer is not one movement, and measures of smoothness say nothing about it.
    pub max_s: f64,
}

impl Default for MovementRule {
    /// From rest to rest in 0.25 to 5 s: SPARC is tested for movements of at most a few seconds.
    fn default() -> Self {
        Self { above_m_per_s: IDLE_M_PER_S, min_s: 0.25, max_s: 5.0 }
    }
}

/// The movements in a row of speeds: runs above the rule's speed that last neither too short nor too long, and on both sides as far
/// as the speed still falls, so that the slow ends, in which much of the jerk is, belong to them.
pub fn movements(speeds_m_per_s: &[f64], rate_hz: f64, rule: &MovementRule) -> Vec<Range<usize>> {
    if !is_rate(rate_hz) {
        return Vec::new();
    }
    let speeds = speeds_m_per_s;
    let is_one = |range: &Range<usize>| {
        let time_s = range.len() as f64 / rate_hz;
        time_s >= rule.min_s && time_s <= rule.max_s
    };
    let whole = |range: Range<usize>| {
        let Range { mut start, mut end } = range;
        while start > 0 && speeds[start - 1] < speeds[start] {
            start -= 1;
        }
        while end < speeds.len() && speeds[end] < speeds[end - 1] {
            end += 1;
        }
        start..end
    };
    runs(speeds.len(), |index| speeds[index] >= rule.above_m_per_s).into_iter().filter(is_one).map(whole).collect()
}

/// The longest ranges below `count` in which something holds.
pub(super) fn runs(count: usize, holds: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut begin = None;
    for index in 0..count {
        match (holds(index), begin) {
            (true, None) => begin = Some(index),
            (false, Some(from)) => {
                found.push(from..index);
                begin = None;
            }
            _ => {}
        }
    }
    found.extend(begin.map(|from| from..count));
    found
}

/// Whether it is a rate of samples.
pub(super) fn is_rate(rate_hz: f64) -> bool {
    rate_hz.is_finite() && rate_hz > 0.0
}

/// A number that is one.
pub(super) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
