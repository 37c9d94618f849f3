//! Signed distances to simple bodies, millimetres, negative inside.

use super::anatomy::NEAR;
use glam::{Vec2, Vec3};

/// Distance to a ball.
pub(super) fn ball(p: Vec3, centre: Vec3, radius: f32) -> f32 {
    p.distance(centre) - radius
}

/// Distance to an ellipsoid with its axes along x, y and z: exact to first order near the surface, bounded elsewhere.
pub(super) fn ellipsoid(p: Vec3, centre: Vec3, radii: Vec3) -> f32 {
    let local = (p - centre) / radii;
    let share = local.length();
    let slope = (local / radii).length();
    if slope < 1e-6 { -radii.min_element() } else { share * (share - 1.0) / slope }
}

/// Distance to a capsule whose radius goes linearly from one end to the other.
pub(super) fn cone(p: Vec3, from: (Vec3, f32), to: (Vec3, f32)) -> f32 {
    let along = to.0 - from.0;
    let share = ((p - from.0).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    p.distance(from.0 + along * share) - (from.1 + (to.1 - from.1) * share)
}

/// Distance to a disc with a thickness, rounded at its rim.
pub(super) fn disc(p: Vec3, centre: Vec3, axis: Vec3, radius: f32, half_thickness: f32) -> f32 {
    let local = p - centre;
    let height = local.dot(axis);
    let out = (local - axis * height).length();
    Vec2::new((out - radius + half_thickness).max(0.0), height).length() - half_thickness
}

/// Union of two bodies whose meeting edge is filled with a fillet of about `radius`.
pub(super) fn blend(a: f32, b: f32, radius: f32) -> f32 {
    let overlap = (radius - (a - b).abs()).max(0.0) / radius;
    a.min(b) - 0.25 * overlap * overlap * radius
}

/// Body `a` without body `b`, the cut's edge rounded.
pub(super) fn without(a: f32, b: f32, radius: f32) -> f32 {
    -blend(-a, b, radius)
}

/// What both bodies share, edges rounded.
pub(super) fn common(a: f32, b: f32, radius: f32) -> f32 {
    -blend(-a, -b, radius)
}

/// A tube along a smooth curve, with its own radius at every point of the curve.
#[derive(Clone, Debug)]
pub(super) struct Tube {
    pieces: Vec<Piece>,
    centre: Vec3,
    /// Of a ball around the curve with its radii.
    reach: f32,
}

/// A straight piece of a tube, ready for many places.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: Vec3,
    along: Vec3,
    /// `along` over its squared length.
    share_per_mm: Vec3,
    radius: f32,
    radius_growth: f32,
}

impl Tube {
    /// Through points with radii, along a Catmull-Rom curve in `pieces` straight pieces per span.
    pub(super) fn through(knots: &[(Vec3, f32)], pieces: u32) -> Self {
        let knot = |place: isize| knots[place.clamp(0, knots.len() as isize - 1) as usize];
        let mut points = Vec::new();
        for span in 0..knots.len() as isize - 1 {
            let [a, b, c, d] = [span - 1, span, span + 1, span + 2].map(knot);
            for piece in 0..pieces {
                let t = piece as f32 / pieces as f32;
                let place = 0.5
                    * (2.0 * b.0
                        + (c.0 - a.0) * t
                        + (2.0 * a.0 - 5.0 * b.0 + 4.0 * c.0 - d.0) * t * t
                        + (3.0 * b.0 - a.0 - 3.0 * c.0 + d.0) * t * t * t);
                points.push((place, b.1 + (c.1 - b.1) * t));
            }
        }
        points.push(knot(knots.len() as isize - 1));
        Self::straight(&points)
    }

    /// Through points with radii in straight pieces.
    pub(super) fn straight(points: &[(Vec3, f32)]) -> Self {
        let centre = points.iter().map(|point| point.0).sum::<Vec3>() / points.len() as f32;
        let reach = points.iter().map(|point| point.0.distance(centre) + point.1).fold(0.0, f32::max);
        let piece = |pair: &[(Vec3, f32)]| {
            let along = pair[1].0 - pair[0].0;
            Piece {
                from: pair[0].0,
                along,
                share_per_mm: along / along.length_squared(),
                radius: pair[0].1,
                radius_growth: pair[1].1 - pair[0].1,
            }
        };
        Self { pieces: points.windows(2).map(piece).collect(), centre, reach }
    }

    /// Distance to its surface. Far away a lower bound, which is cheaper.
    pub(super) fn distance(&self, p: Vec3) -> f32 {
        let bound = p.distance(self.centre) - self.reach;
        if bound > NEAR {
            return bound;
        }
        let mut least = f32::INFINITY;
        for piece in &self.pieces {
            let local = p - piece.from;
            let share = local.dot(piece.share_per_mm).clamp(0.0, 1.0);
            let distance = local.distance(piece.along * share) - (piece.radius + piece.radius_growth * share);
            least = least.min(distance);
        }
        least
    }
}
