//! Whether what was removed could be seen, after Sewell and others 2008 (doi 10.1080/10929080801957712): from each removed
//! voxel one goes along the line to the eye; where something solid is in the way, other than close to the burr that is just
//! drilling it, the trainee drilled blindly.

use bevy::math::DVec3;

/// How the line to the eye is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SightLine {
    /// Where the eye is.
    pub eye_m: DVec3,
    /// Middle of the burr.
    pub burr_m: DVec3,
    /// What is this near to the middle of the burr hides nothing, metres.
    pub clear_m: f64,
    /// How far one goes in a step, metres: at most half a voxel.
    pub step_m: f64,
}

/// Lines with more steps than this are not followed: the eye or the step is not what it should be.
const MOST_STEPS: f64 = 100_000.0;

/// Whether nothing solid lies between a place and the eye. None where the numbers are none, or the line has too many steps.
pub fn is_seen(point_m: DVec3, line: &SightLine, is_solid: &mut impl FnMut(DVec3) -> bool) -> Option<bool> {
    let way = line.eye_m - point_m;
    let distance_m = way.length();
    let steps = (distance_m / line.step_m).ceil();
    let is_line = line.burr_m.is_finite() && line.clear_m.is_finite() && line.step_m > 0.0 && distance_m.is_finite();
    if !is_line || steps > MOST_STEPS {
        return None;
    }
    for step in 1..steps as u64 {
        let place_m = point_m + way * (step as f64 * line.step_m / distance_m);
        if place_m.distance(line.burr_m) > line.clear_m && is_solid(place_m) {
            return Some(false);
        }
    }
    Some(true)
}

/// Share of removed places that can be seen, 0 to 1; none where there are none.
pub fn seen_share(points_m: &[DVec3], line: &SightLine, mut is_solid: impl FnMut(DVec3) -> bool) -> Option<f64> {
    let seen: Vec<bool> = points_m.iter().filter_map(|point_m| is_seen(*point_m, line, &mut is_solid)).collect();
    (!seen.is_empty()).then(|| seen.iter().filter(|seen| **seen).count() as f64 / seen.len() as f64)
}

/// Share of a removed volume that was seen: the mean of (mm³, share seen) by volume. Entries that are no numbers, or without
/// volume, do not count.
pub fn seen_volume_share(removals: impl IntoIterator<Item = (f64, f64)>) -> Option<f64> {
    let is_one = |(mm3, share): &(f64, f64)| mm3.is_finite() && *mm3 > 0.0 && share.is_finite();
    let (mut all, mut seen) = (0.0, 0.0);
    for (mm3, share) in removals.into_iter().filter(is_one) {
        all += mm3;
        seen += mm3 * share.clamp(0.0, 1.0);
    }
    (all > 0.0).then_some(seen / all).filter(|share| share.is_finite())
}
