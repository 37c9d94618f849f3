//! Strokes of a drill: cut at changes of direction.
//!
//! "k-cos" measures of temporal bone drilling (PubMed 34872376) define strokes by their change of direction; the k-cosine
//! itself is Rosenfeld and Johnston's (1973): at place `i` the cosine of the angle between the way on, `p[i+k] - p[i]`, and the
//! way back, `p[i-k] - p[i]`. It is -1 where the way goes straight on, 0 at a right angle, and 1 where it turns back. Which `k` and
//! which threshold the study took is not known here; ours are in [`StrokeRule::default`].

use super::motion::{IDLE_M_PER_S, is_rate, runs};
use bevy::math::DVec3;

/// Ways shorter than this share of the shortest stroke have no direction.
const LEAST_WAY_SHARE: f64 = 0.05;

/// What counts as a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeRule {
    /// How far the k-cosine looks on and back, seconds.
    pub reach_s: f64,
    /// A stroke ends where the k-cosine is largest and above this.
    pub turn_cosine: f64,
    /// It ends too where the tip rests for so long, seconds.
    pub rest_s: f64,
    /// Slower than this is rest, metres per second.
    pub rest_m_per_s: f64,
    /// Shorter ones are tremor, metres.
    pub min_length_m: f64,
    /// It is curved where its ends are nearer than this share of its length: 0.9 is the arc of a quarter of a circle.
    pub straight_share: f64,
}

impl Default for StrokeRule {
    /// Turns of more than a right angle, seen over 50 ms to each side: strokes on cadavers last 0.37 s in the mean.
    fn default() -> Self {
        Self {
            reach_s: 0.05,
            turn_cosine: 0.0,
            rest_s: 0.2,
            rest_m_per_s: IDLE_M_PER_S,
            min_length_m: 1e-3,
            straight_share: 0.9,
        }
    }
}

/// A stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Index of its first place.
    pub first: usize,
    /// Index of its last place.
    pub last: usize,
    /// Length of its way, metres.
    pub length_m: f64,
    /// How long it takes, seconds.
    pub time_s: f64,
    /// Whether it is curved.
    pub is_curved: bool,
}

/// The k-cosine at each place; none within `k` of the ends, and where one of the ways is shorter than `min_way_m`.
pub fn k_cosines(positions_m: &[DVec3], k: usize, min_way_m: f64) -> Vec<Option<f64>> {
    let at = |index: usize| {
        let (on, back) = (positions_m.get(index + k)?, positions_m.get(index.checked_sub(k)?)?);
        let (on, back) = (*on - positions_m[index], *back - positions_m[index]);
        let (on_m, back_m) = (on.length(), back.length());
        let is_way = |way_m: f64| way_m.is_finite() && way_m > 0.0 && way_m >= min_way_m;
        (is_way(on_m) && is_way(back_m)).then(|| (on / on_m).dot(back / back_m).clamp(-1.0, 1.0))
    };
    (0..positions_m.len()).map(at).collect()
}

/// The strokes in a row of places, in order. None where places are no numbers.
pub fn strokes(positions_m: &[DVec3], rate_hz: f64, rule: &StrokeRule) -> Vec<Stroke> {
    if !is_rate(rate_hz) || positions_m.len() < 2 || !positions_m.iter().all(|place| place.is_finite()) {
        return Vec::new();
    }
    let k = ((rule.reach_s * rate_hz).round() as usize).clamp(1, positions_m.len());
    let cosines = k_cosines(positions_m, k, LEAST_WAY_SHARE * rule.min_length_m);
    let turns = turns(&cosines, rule.turn_cosine);
    let mut found = Vec::new();
    for (first, last) in moving(positions_m, rate_hz, rule) {
        let mut from = first;
        for &turn in turns.iter().filter(|turn| (first + 1..last).contains(turn)) {
            found.extend(stroke(positions_m, from, turn, rate_hz, rule));
            from = turn;
        }
        found.extend(stroke(positions_m, from, last, rate_hz, rule));
    }
    found
}

/// First and last places of what lies between rests.
fn moving(positions_m: &[DVec3], rate_hz: f64, rule: &StrokeRule) -> Vec<(usize, usize)> {
    let steps = positions_m.len() - 1;
    let is_slow = |step: usize| positions_m[step].distance(positions_m[step + 1]) * rate_hz < rule.rest_m_per_s;
    let rests = runs(steps, is_slow).into_iter().filter(|rest| rest.len() as f64 >= rule.rest_s * rate_hz);
    let mut found = Vec::new();
    let mut from = 0;
    for rest in rests {
        found.push((from, rest.start));
        from = rest.end;
    }
    found.push((from, steps));
    found.retain(|(first, last)| first < last);
    found
}

/// Where the way turns: of each row of places at which it does, the one at which it turns most, in the middle of those that are equal.
fn turns(cosines: &[Option<f64>], above: f64) -> Vec<usize> {
    let cosine = |index: usize| cosines[index].unwrap_or(-1.0);
    let rows = runs(cosines.len(), |index| cosine(index) > above);
    let sharpest = |row: std::ops::Range<usize>| {
        let most = row.clone().map(cosine).fold(-1.0, f64::max) - 1e-9;
        let (first, last) = (row.clone().find(|at| cosine(*at) >= most)?, row.rev().find(|at| cosine(*at) >= most)?);
        Some((first + last) / 2)
    };
    rows.into_iter().filter_map(sharpest).collect()
}

fn stroke(positions_m: &[DVec3], first: usize, last: usize, rate_hz: f64, rule: &StrokeRule) -> Option<Stroke> {
    let way = &positions_m[first..=last];
    let length_m: f64 = way.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    // To and fro in one place is no way, however long.
    let extent_m = way.iter().map(|place| place.distance(way[0])).fold(0.0, f64::max);
    if !length_m.is_finite() || extent_m < rule.min_length_m || length_m <= 0.0 {
        return None;
    }
    let is_curved = way[0].distance(way[way.len() - 1]) < rule.straight_share * length_m;
    Some(Stroke { first, last, length_m, time_s: (last - first) as f64 / rate_hz, is_curved })
}
