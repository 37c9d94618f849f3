//! The way back through a map that is trilinear in each patch, by Newton's method.

use crate::deform::lattice::{Tree, map_in};
use glam::{DMat3, DVec3};

/// How close it must come, in shares of the box: a tenth of a micrometre in an organ.
const CLOSE: f64 = 1e-6;

/// Most steps from one guess.
const MOST_STEPS: usize = 24;

/// Where `x + by(x)` is, and its derivative, with the vectors `by` at the vertices of a tree. Shares of the box; beyond the box
/// `by` goes on as it is.
pub(crate) fn moved(tree: &Tree, by: &[DVec3], x: DVec3) -> (DVec3, DMat3) {
    let number = tree.patch_at(x);
    let patch = tree.patches()[number];
    map_in(tree.corners(number).map(|vertex| by[vertex]), patch.low(), patch.side(), x)
}

/// The place that the map moves to `target`, looked for from some guesses on. `None` where it is not found, or lies in matter
/// that is turned inside out.
pub(crate) fn found(tree: &Tree, by: &[DVec3], target: DVec3, guesses: &[DVec3]) -> Option<DVec3> {
    guesses.iter().find_map(|&guess| newton(tree, by, target, guess))
}

fn newton(tree: &Tree, by: &[DVec3], target: DVec3, guess: DVec3) -> Option<DVec3> {
    let mut x = guess;
    let (mut at, mut slope) = moved(tree, by, x);
    let mut distance = at.distance_squared(target);
    for _ in 0..MOST_STEPS {
        // NaN is not close, and no step leads away from it.
        if distance <= CLOSE * CLOSE {
            return (slope.determinant() > 0.0).then_some(x);
        }
        let determinant = slope.determinant();
        if determinant.is_nan() || determinant.abs() < 1e-9 {
            return None;
        }
        let step = slope.inverse() * (target - at);
        // Newton's step may lead across patches where the slope is another: then half of it, and so on.
        let mut share = (0.5 / step.length()).min(1.0);
        loop {
            let next = x + step * share;
            let (next_at, next_slope) = moved(tree, by, next);
            let next_distance = next_at.distance_squared(target);
            if next_distance < distance {
                (x, at, slope, distance) = (next, next_at, next_slope, next_distance);
                break;
            }
            share *= 0.5;
            if share.is_nan() || share < 1e-3 {
                return None;
            }
        }
    }
    None
}
