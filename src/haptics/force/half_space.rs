//! The nearest place that many half-spaces leave free, exactly.
//!
//! In three dimensions at most three of them hold a place: none, one plane, the line of two, or the point of three. Half-spaces
//! that are violated enter one by one; each time the few that held the place and the new one decide which hold it now. The distance
//! from the goal only grows, so that it ends.

use super::SurfaceFeel;
use glam::{DMat3, DVec3};

/// All places `x` with `normal · x >= offset_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Unit length, away from what is solid.
    pub normal: DVec3,
    /// Metres.
    pub offset_m: f64,
    /// How it feels.
    pub feel: SurfaceFeel,
    /// Where the solid is touched, world, metres.
    pub point_m: DVec3,
    /// Which obstacle it belongs to.
    pub obstacle: u32,
    /// Which triangle of it.
    pub element: u32,
}

impl HalfSpace {
    /// How far inside a place is, metres; negative where it is forbidden.
    pub fn height_m(&self, place_m: DVec3) -> f64 {
        self.normal.dot(place_m) - self.offset_m
    }
}

/// The nearest free place, and what holds it there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// The place.
    pub place_m: DVec3,
    /// Indices of the half-spaces that hold it.
    pub held_by: [usize; 3],
    /// How many they are.
    pub count: usize,
    /// How far each pushes along its normal, metres: `place = goal + sum of pushes times normals`.
    pub push_m: [f64; 3],
}

/// Below this a half-space counts as kept, metres.
const KEPT_M: f64 = 1e-10;

/// Planes through the place nearest to the goal: exact for one, two and three. None where they are parallel.
fn on_all(goal_m: DVec3, spaces: &[HalfSpace], held_by: &[usize]) -> Option<Projection> {
    let below = |place: usize| -spaces[held_by[place]].height_m(goal_m);
    let normal = |place: usize| spaces[held_by[place]].normal;
    let mut push_m = [0.0; 3];
    match held_by.len() {
        0 => {}
        1 => push_m[0] = below(0),
        2 => {
            let cosine = normal(0).dot(normal(1));
            let determinant = 1.0 - cosine * cosine;
            if determinant < 1e-9 {
                return None;
            }
            push_m[0] = (below(0) - cosine * below(1)) / determinant;
            push_m[1] = (below(1) - cosine * below(0)) / determinant;
        }
        _ => {
            let rows = DMat3::from_cols(normal(0), normal(1), normal(2));
            let gram = rows.transpose() * rows;
            if gram.determinant() < 1e-9 {
                return None;
            }
            push_m = (gram.inverse() * DVec3::new(below(0), below(1), below(2))).to_array();
        }
    }
    let mut indices = [0; 3];
    indices[..held_by.len()].copy_from_slice(held_by);
    let moved: DVec3 = (0..held_by.len()).map(|place| normal(place) * push_m[place]).sum();
    Some(Projection { place_m: goal_m + moved, held_by: indices, count: held_by.len(), push_m })
}

/// The place nearest to a goal that all half-spaces leave free. None where they leave no place, or one that cannot be told from none.
pub fn nearest_in_all(goal_m: DVec3, spaces: &[HalfSpace]) -> Option<Projection> {
    let mut best = on_all(goal_m, spaces, &[])?;
    for _ in 0..spaces.len() * 2 + 8 {
        let mut worst = (KEPT_M, usize::MAX);
        for (index, space) in spaces.iter().enumerate() {
            let below = -space.height_m(best.place_m);
            if below > worst.0 {
                worst = (below, index);
            }
        }
        let (_, entering) = worst;
        if entering == usize::MAX {
            return Some(best);
        }
        best = exchange(goal_m, spaces, &best, entering)?;
    }
    None
}

/// What holds the place when one more half-space enters: all subsets of the old ones with the new one.
fn exchange(goal_m: DVec3, spaces: &[HalfSpace], old: &Projection, entering: usize) -> Option<Projection> {
    let mut next: Option<(f64, Projection)> = None;
    for subset in 0..1_usize << old.count {
        let mut held_by = [entering, 0, 0, 0];
        let mut count = 1;
        for place in (0..old.count).filter(|place| subset >> place & 1 == 1) {
            held_by[count] = old.held_by[place];
            count += 1;
        }
        if count > 3 {
            continue;
        }
        let Some(candidate) = on_all(goal_m, spaces, &held_by[..count]) else { continue };
        let pushes_back = candidate.push_m[..count].iter().any(|&push| push < -KEPT_M);
        let broken = old.held_by[..old.count].iter().any(|&index| spaces[index].height_m(candidate.place_m) < -KEPT_M);
        if pushes_back || broken {
            continue;
        }
        let distance = candidate.place_m.distance_squared(goal_m);
        if next.is_none_or(|(nearest, _)| distance < nearest) {
            next = Some((distance, candidate));
        }
    }
    next.map(|(_, candidate)| candidate)
}
