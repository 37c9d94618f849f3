//! How near the suction is while something is drilled.

use super::motion::mean;
use bevy::math::DVec3;

/// Mean distance between both tips over the samples in which both are there and the burr turns, metres.
///
/// A row of samples is of (drill, suction, whether the burr turns).
pub fn suction_distance_m(samples: impl IntoIterator<Item = (Option<DVec3>, Option<DVec3>, bool)>) -> Option<f64> {
    let distance_m = |(drill, suction, is_on): (Option<DVec3>, Option<DVec3>, bool)| {
        is_on.then_some(drill?.distance(suction?)).filter(|distance_m| distance_m.is_finite())
    };
    mean(&samples.into_iter().filter_map(distance_m).collect::<Vec<f64>>())
}
