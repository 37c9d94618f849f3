//! Strokes of a drill: cut at changes of direction.
//!
//! "k-cos" measures of temporal bone drilling (PubMed 34872376) define strokes by their change of direction; the k-cosine
//! itself is Rosenfeld and Johnston's (1973): at place `i` the cosine of the angle between the way on, `p[i+k] - p[i]`, and the
//! way back, `p[i-k] - p[i]`. It is -1 where the way goes straight on, 0 at a right angle, and 1 where it turns back. Which `k` and
//! which threshold the study took is not known here; ours are in [`StrokeRule::default`].

use super::motion::{IDLE_M_PER_S, is_rate, runs};
use bevy::math::DVec3;

/// What counts as a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrokeRule {
    /// How far the k-cosine looks on and back, seconds.
    pub reach_s: f64,
    /// A stroke ends where the way turns most and the k-cosine is above this.
    pub turn_cosine: f64,
    /// It ends too where the tip rests for so long, seconds.
    pub rest_s: f64,
    /// Slower than this is rest, metres per second.
    pub rest_m_per_s: f64,
    /// Where the way on or back is shorter than this, it has no direction, metres.
    pub min_way_m: f64,
    /// A stroke that goes no farther than this from its beginning is tremor, metres.
    pub min_reach_m: f64,
    /// It is curved where its ends are nearer than this share of its length: 0.9 is the arc of a quarter of a circle.
    pub straight_share: f64,
}

impl Default for StrokeRule {
    /// Turns of more than a right angle, seen over 100 ms to each side: strokes on cadavers last 0.37 s in the mean, and a hand is
    /// slow where it turns.
    fn default() -> Self {
        Self {
            reach_s: 0.1,
            turn_cosine: 0.0,
            rest_s: 0.2,
            rest_m_per_s: IDLE_M_PER_S,
            min_way_m: 1e-4,
            min_reach_m: 1e-3,
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

/// The strokes in a row of places, in order. There are none where places are no numbers.
pub fn strokes(positions_m: &[DVec3], rate_hz: f64, rule: &StrokeRule) -> Vec<Stroke> {
    if !is_rate(rate_hz) || positions_m.len() < 2 || !positions_m.iter().all(|place| place.is_finite()) {
        return Vec::new();
    }
    let k = ((rule.reach_s * rate_hz).round() as usize).clamp(1, positions_m.len());
    let turns = turns(positions_m, k, rule);
    let mut found = Vec::new();
    for (first, last) in moving(positions_m, rate_hz, rule) {
        let mut from = first;
        for index in first + 1..last {
            if is_turn(&turns, index, k) {
                found.extend(stroke(positions_m, from, index, rate_hz, rule));
                from = index;
            }
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

/// How much the way turns at each place, metres; none where it turns less than the rule says. On a straight way back the k-cosine is
/// the same all around the turn, so it is weighed with the shorter of both ways, which is longest at the turn itself.
fn turns(positions_m: &[DVec3], k: usize, rule: &StrokeRule) -> Vec<Option<f64>> {
    let turn = |(index, cosine): (usize, Option<f64>)| {
        let cosine = cosine.filter(|cosine| *cosine > rule.turn_cosine)?;
        let way_m = |other: usize| positions_m[other].distance(positions_m[index]);
        Some((1.0 + cosine) * way_m(index + k).min(way_m(index - k)))
    };
    k_cosines(positions_m, k, rule.min_way_m).into_iter().enumerate().map(turn).collect()
}

/// Whether the way turns most here: of equal places within reach the first one.
fn is_turn(turns: &[Option<f64>], index: usize, k: usize) -> bool {
    let Some(here) = turns[index] else { return false };
    let around = |range: std::ops::Range<usize>| turns[range].iter().flatten().copied().fold(0.0, f64::max);
    let (before, after) = (around(index.saturating_sub(k)..index), around(index + 1..(index + k + 1).min(turns.len())));
    here > before && here >= after
}

fn stroke(positions_m: &[DVec3], first: usize, last: usize, rate_hz: f64, rule: &StrokeRule) -> Option<Stroke> {
    let way = &positions_m[first..=last];
    let length_m: f64 = way.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let reach_m = way.iter().map(|place| place.distance(way[0])).fold(0.0, f64::max);
    if !length_m.is_finite() || length_m <= 0.0 || reach_m < rule.min_reach_m {
        return None;
    }
    let is_curved = way[0].distance(way[way.len() - 1]) < rule.straight_share * length_m;
    Some(Stroke { first, last, length_m, time_s: (last - first) as f64 / rate_hz, is_curved })
}
