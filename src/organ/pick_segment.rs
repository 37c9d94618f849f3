//! Which place of a surface is nearest to a rod, and which faces are near it.

use super::closest::of_segment_and_triangle;
use super::pick::OrganPicker;
use super::sphere::SurfacePoint;
use bevy::reflect::Reflect;
use glam::DVec3;

/// The place of a surface that is nearest to a segment.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct SegmentHit {
    /// The face and the weights of its corners (none is negative).
    pub point: SurfacePoint,
    /// How far apart they are, metres; 0 where the segment goes through the face.
    pub distance_m: f64,
    /// The place on the surface, metres.
    pub position_m: DVec3,
    /// The place on the segment, metres.
    pub on_segment_m: DVec3,
}

impl OrganPicker {
    /// The place that is nearest to a segment (or to a point, where its ends are one), at most `max_distance_m` away.
    ///
    /// Of equally near places the one on the face with the lowest index is returned. `None` also for ends that are not finite
    /// and for a distance that is negative or no number.
    pub fn nearest_to_segment(&self, ends_m: [DVec3; 2], max_distance_m: f64) -> Option<SegmentHit> {
        let mut best: Option<(f64, u32, DVec3, DVec3)> = None;
        self.visit_near_segment(ends_m, max_distance_m, |face, corners_m| {
            let (on_segment_m, position_m) = of_segment_and_triangle(ends_m, corners_m);
            let distance_m = on_segment_m.distance(position_m);
            let is_nearer = distance_m <= max_distance_m
                && best.is_none_or(|(other_m, other, ..)| (distance_m, face) < (other_m, other));
            if is_nearer {
                best = Some((distance_m, face, position_m, on_segment_m));
            }
            best.map_or(max_distance_m, |(nearest_m, ..)| nearest_m)
        });
        let (distance_m, face, position_m, on_segment_m) = best?;
        let barycentric = weights(position_m, self.corners_of(face));
        Some(SegmentHit { point: SurfacePoint { face, barycentric }, distance_m, position_m, on_segment_m })
    }

    /// The faces within a distance of a segment, ascending; some may be a little further away.
    pub fn faces_near_segment(&self, ends_m: [DVec3; 2], distance_m: f64) -> Vec<u32> {
        let mut faces = Vec::new();
        self.visit_near_segment(ends_m, distance_m, |face, _| {
            faces.push(face);
            distance_m
        });
        faces.sort_unstable();
        faces
    }
}

/// Weights of a place in the corners of its triangle; none is negative.
fn weights(place: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let normal = (b - a).cross(c - a);
    let part = |from: DVec3, to: DVec3| (to - from).cross(place - from).dot(normal).max(0.0);
    let parts = DVec3::new(part(b, c), part(c, a), part(a, b));
    let sum = parts.element_sum();
    if sum > 0.0 { parts / sum } else { DVec3::X }
}
