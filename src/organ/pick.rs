//! Picking on the CPU: what a ray hits and which place of the surface is nearest, without rendering.
//!
//! The paper of 2002 (section 5.4) found the face under the pointer by another rendering pass. Here a tree of boxes
//! over the faces answers in about a microsecond; it is built once per organ and refitted as the organ deforms. The
//! tree is that of `parry3d`; what happens in a face is computed here in double precision, so that no ray slips
//! through between two faces and equal inputs give equal bits whatever shape the tree has.

use super::closest::on_segment;
use super::sphere::SurfacePoint;
use bevy::prelude::{Component, Reflect, ReflectComponent, ReflectDefault};
use glam::{DVec3, Vec3};
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use std::cell::{Cell, RefCell};
use std::fmt;

/// Vertices further out than this are no part of an organ, metres. Keeps the tree's single precision sums finite.
const MOST_COORDINATE_M: f32 = 1e6;

/// By how much boxes are widened in the double precision tests, relative to the lengths involved: far above rounding,
/// far below what single precision positions resolve.
const SLACK: f64 = 1e-12;

/// Scores of the tree's search are single precision; this one is just below its mark for "leave out".
const MOST_SCORE: f32 = f32::MAX / 2.0;

/// Where a ray hits first. All in the space of the positions that the picker was given.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct PickHit {
    /// The face and the weights of its corners (none is negative).
    pub point: SurfacePoint,
    /// How far along the ray, metres.
    pub distance_m: f64,
    /// The place hit, metres.
    pub position_m: DVec3,
    /// Unit normal of the flat face, to the side from which its corners run counter-clockwise.
    pub face_normal: DVec3,
    /// Whether the ray came from that side.
    pub is_front: bool,
}

/// The place of the surface that is nearest to a position.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct NearestHit {
    /// The face and the weights of its corners (none is negative).
    pub point: SurfacePoint,
    /// How far away it is, metres.
    pub distance_m: f64,
    /// The place found, metres.
    pub position_m: DVec3,
}

/// Finds places of a triangle surface: first along a ray, or nearest to a position.
///
/// Faces without area, with a vertex that is not finite (or a million metres off) or that does not exist are never
/// found; they are looked at anew by each [`OrganPicker::refit`].
#[derive(Component, Clone, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone)]
pub struct OrganPicker {
    triangles: Vec<[u32; 3]>,
    /// Corners of every face, side by side for the cache; NaN for those that cannot be found.
    corners_m: Vec<[Vec3; 3]>,
    tree: Bvh,
}

impl fmt::Debug for OrganPicker {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("OrganPicker").field("faces", &self.triangles.len()).finish_non_exhaustive()
    }
}

impl OrganPicker {
    /// A picker for these faces, three vertex indices each, with their vertices at these positions in metres.
    pub fn build(triangles: &[[u32; 3]], positions_m: &[Vec3]) -> Self {
        let corners_m: Vec<[Vec3; 3]> = triangles.iter().map(|&face| corners(face, positions_m)).collect();
        let stand_in_m = stand_in(&corners_m);
        let boxes: Vec<Aabb> = corners_m.iter().map(|corners| box_around(corners, stand_in_m)).collect();
        let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        Self { triangles: triangles.to_vec(), corners_m, tree }
    }

    /// Follows moved vertices; they must be those of [`OrganPicker::build`] in the same order. Allocates nothing.
    ///
    /// The tree keeps its shape, so answers stay exact but come more slowly once an organ is crumpled beyond
    /// recognition.
    pub fn refit(&mut self, positions_m: &[Vec3]) {
        for (corners_m, &face) in self.corners_m.iter_mut().zip(&self.triangles) {
            *corners_m = corners(face, positions_m);
        }
        let stand_in_m = stand_in(&self.corners_m);
        for (face, corners_m) in self.corners_m.iter().enumerate() {
            self.tree.insert_or_update_partially(box_around(corners_m, stand_in_m), face as u32, 0.0);
        }
        self.tree.refit_without_opt();
    }

    /// Number of faces, findable or not.
    pub fn face_count(&self) -> usize {
        self.triangles.len()
    }

    /// The first place along a ray, from either side of a face, at most `max_distance_m` away (which may be infinite).
    ///
    /// The direction's length does not matter. A ray through an edge or vertex of a closed surface hits one of the
    /// faces around it. Of equally distant hits the face with the lowest index is returned. `None` also for a ray that
    /// is not finite or has no direction, and for a distance that is negative or no number.
    pub fn cast_ray(&self, origin_m: DVec3, direction: DVec3, max_distance_m: f64) -> Option<PickHit> {
        // Scaled first: squares of very long or short directions are out of range.
        let direction = (direction / direction.abs().max_element()).try_normalize()?;
        if !origin_m.is_finite() || max_distance_m.is_nan() || max_distance_m < 0.0 {
            return None;
        }
        let ray = Ray::new(origin_m, direction, self.reach_m(origin_m));
        let best: Cell<Option<FaceHit>> = Cell::new(None);
        // The best hit is kept here, not in the tree's search, whose single precision and order of visits would
        // otherwise decide between equal distances.
        self.tree.find_best(
            f32::MAX,
            |node: &BvhNode, _| {
                let nearest_m = best.get().map_or(max_distance_m, |hit| hit.distance_m);
                score(ray.enters_box_m(node), nearest_m)
            },
            |face, _| {
                if let Some(hit) = ray.hit_face(face, &self.corners_m[face as usize])
                    && hit.distance_m <= max_distance_m
                    && best.get().is_none_or(|best| hit.is_before(&best))
                {
                    best.set(Some(hit));
                }
                None::<f32>
            },
        );
        let hit = best.get()?;
        let [a, b, c] = self.corners_m[hit.face as usize].map(|corner| corner.as_dvec3());
        let face_normal = (b - a).cross(c - a).try_normalize()?;
        let w = hit.barycentric;
        Some(PickHit {
            point: SurfacePoint { face: hit.face, barycentric: w },
            distance_m: hit.distance_m,
            position_m: a * w.x + b * w.y + c * w.z,
            face_normal,
            is_front: direction.dot(face_normal) < 0.0,
        })
    }

    /// The nearest place of the surface, at most `max_distance_m` away (which may be infinite).
    ///
    /// Of equally near places the one on the face with the lowest index is returned. `None` also for a position that
    /// is not finite and for a distance that is negative or no number.
    pub fn nearest(&self, position_m: DVec3, max_distance_m: f64) -> Option<NearestHit> {
        if !position_m.is_finite() || max_distance_m.is_nan() || max_distance_m < 0.0 {
            return None;
        }
        let margin_m = SLACK * self.reach_m(position_m);
        let best: Cell<Option<FaceHit>> = Cell::new(None);
        self.tree.find_best(
            f32::MAX,
            |node: &BvhNode, _| {
                let nearest_m = best.get().map_or(max_distance_m, |hit| hit.distance_m);
                score(Some(distance_to_box_m(position_m, node) - margin_m), nearest_m)
            },
            |face, _| {
                if let Some(hit) = nearest_on_face(position_m, face, &self.corners_m[face as usize])
                    && hit.distance_m <= max_distance_m
                    && best.get().is_none_or(|best| hit.is_before(&best))
                {
                    best.set(Some(hit));
                }
                None::<f32>
            },
        );
        let FaceHit { face, distance_m, barycentric } = best.get()?;
        let [a, b, c] = self.corners_m[face as usize].map(|corner| corner.as_dvec3());
        Some(NearestHit {
            point: SurfacePoint { face, barycentric },
            distance_m,
            position_m: a * barycentric.x + b * barycentric.y + c * barycentric.z,
        })
    }

    /// Corners of a face, metres.
    pub(super) fn corners_of(&self, face: u32) -> [DVec3; 3] {
        self.corners_m[face as usize].map(|corner| corner.as_dvec3())
    }

    /// Looks at the faces whose boxes come within a distance of a segment; each look says how far the next ones may be.
    pub(super) fn visit_near_segment(
        &self,
        ends_m: [DVec3; 2],
        max_distance_m: f64,
        look: impl FnMut(u32, [DVec3; 3]) -> f64,
    ) {
        let is_search = ends_m.iter().all(|end| end.is_finite()) && max_distance_m >= 0.0;
        if !is_search {
            return;
        }
        let margin_m = SLACK * self.reach_m(ends_m[0]).max(self.reach_m(ends_m[1]));
        let (low, high) = (ends_m[0].min(ends_m[1]), ends_m[0].max(ends_m[1]));
        // Two bounds: from the box around the segment, and from the ball around the other box.
        let at_least_m = |node: &BvhNode| {
            let (min, max) = (vector(node.mins().to_array()), vector(node.maxs().to_array()));
            let of_boxes = (min - high).max(low - max).max(DVec3::ZERO).length();
            let middle = (min + max) * 0.5;
            let of_ball = on_segment(middle, ends_m).distance(middle) - (max - middle).length();
            of_boxes.max(of_ball) - margin_m
        };
        // The tree's search takes functions that change nothing.
        let (look, most_m) = (RefCell::new(look), Cell::new(max_distance_m));
        self.tree.find_best(
            f32::MAX,
            |node: &BvhNode, _| score(Some(at_least_m(node)), most_m.get()),
            |face, _| {
                if !self.corners_m[face as usize][0].is_nan() {
                    most_m.set(look.borrow_mut()(face, self.corners_of(face)));
                }
                None::<f32>
            },
        );
    }

    /// Distance within which everything lies, metres; the scale of rounding errors.
    fn reach_m(&self, from_m: DVec3) -> f64 {
        let (low, high) = (self.tree.root_aabb().mins, self.tree.root_aabb().maxs);
        let (low, high) = (vector(low.to_array()), vector(high.to_array()));
        (low - from_m).abs().max((high - from_m).abs()).element_sum()
    }
}

/// Corners of a face; NaN where it cannot be found.
fn corners(face: [u32; 3], positions_m: &[Vec3]) -> [Vec3; 3] {
    let corners_m = face.map(|vertex| positions_m.get(vertex as usize).copied().unwrap_or(Vec3::NAN));
    let is_near = corners_m.iter().all(|corner| corner.abs().max_element() <= MOST_COORDINATE_M && corner.is_finite());
    let [a, b, c] = corners_m.map(|corner| corner.as_dvec3());
    let has_area = (b - a).cross(c - a).try_normalize().is_some();
    if is_near && has_area { corners_m } else { [Vec3::NAN; 3] }
}

/// Where the boxes of faces that cannot be found are put, so that they widen no box around others.
fn stand_in(corners_m: &[[Vec3; 3]]) -> Vec3 {
    corners_m.iter().map(|corners| corners[0]).find(|corner| corner.is_finite()).unwrap_or_default()
}

fn box_around(corners_m: &[Vec3; 3], stand_in_m: Vec3) -> Aabb {
    let [a, b, c] = if corners_m[0].is_finite() { *corners_m } else { [stand_in_m; 3] };
    Aabb::new(a.min(b).min(c).to_array().into(), a.max(b).max(c).to_array().into())
}

/// From the tree's vectors, which are of another version of `glam`.
fn vector(components: [f32; 3]) -> DVec3 {
    Vec3::from_array(components).as_dvec3()
}

/// How soon the tree should look into a box that is at least this far away; never if that is beyond the best so far.
fn score(distance_m: Option<f64>, nearest_m: f64) -> f32 {
    match distance_m {
        // A tie is still looked at: the face may have a lower index.
        Some(distance_m) if distance_m <= nearest_m => (distance_m as f32).min(MOST_SCORE),
        _ => f32::MAX,
    }
}

fn distance_to_box_m(position_m: DVec3, node: &BvhNode) -> f64 {
    let (low, high) = (vector(node.mins().to_array()), vector(node.maxs().to_array()));
    (low - position_m).max(position_m - high).max(DVec3::ZERO).length()
}

/// A place of a face and how far away it is.
#[derive(Clone, Copy)]
struct FaceHit {
    face: u32,
    distance_m: f64,
    barycentric: DVec3,
}

impl FaceHit {
    fn is_before(&self, other: &Self) -> bool {
        (self.distance_m, self.face) < (other.distance_m, other.face)
    }
}

/// A ray in the form that the tests of boxes and faces want.
struct Ray {
    origin_m: DVec3,
    /// One over the direction.
    inverse: DVec3,
    /// By how much boxes are widened, metres.
    margin_m: f64,
    /// Axis along which the direction is longest, and the two others.
    axes: [usize; 3],
    /// What is taken off the two other axes per metre along the longest, so that the ray runs along it.
    shear: [f64; 2],
    /// Length of the ray per metre along the longest axis.
    stretch: f64,
}

impl Ray {
    fn new(origin_m: DVec3, direction: DVec3, reach_m: f64) -> Self {
        let long = direction.abs().max_position();
        let axes = [long, (long + 1) % 3, (long + 2) % 3];
        // Finite also along the planes of a box's sides, so that no infinity meets a zero.
        let inverse = DVec3::from_array(
            direction.to_array().map(|part| if part.abs() < 1e-200 { 1e200_f64.copysign(part) } else { 1.0 / part }),
        );
        Self {
            origin_m,
            inverse,
            margin_m: SLACK * reach_m,
            axes,
            shear: [direction[axes[1]] / direction[long], direction[axes[2]] / direction[long]],
            stretch: 1.0 / direction[long],
        }
    }

    /// Where the ray enters a box, or zero inside it, metres.
    fn enters_box_m(&self, node: &BvhNode) -> Option<f64> {
        let (low, high) = (vector(node.mins().to_array()), vector(node.maxs().to_array()));
        let to_low = (low - self.margin_m - self.origin_m) * self.inverse;
        let to_high = (high + self.margin_m - self.origin_m) * self.inverse;
        let enters_m = to_low.min(to_high).max_element().max(0.0);
        let leaves_m = to_low.max(to_high).min_element();
        (enters_m <= leaves_m).then_some(enters_m)
    }

    /// Where the ray hits a face (Woop, Benthin and Wald 2013: watertight).
    ///
    /// The face is sheared so that the ray runs along an axis through the origin, and the sides of its edges are asked
    /// in the plane across. A vertex gets the same sheared place in all faces, and an edge the same number, with the
    /// sign turned, in both of its faces: a ray cannot be outside both.
    fn hit_face(&self, face: u32, corners_m: &[Vec3; 3]) -> Option<FaceHit> {
        let [long, x, y] = self.axes;
        let [a, b, c] = corners_m.map(|corner| {
            let offset = corner.as_dvec3() - self.origin_m;
            let along = offset[long];
            [offset[x] - self.shear[0] * along, offset[y] - self.shear[1] * along, along]
        });
        let side = |from: [f64; 3], to: [f64; 3]| from[0] * to[1] - from[1] * to[0];
        let sides = DVec3::new(side(b, c), side(c, a), side(a, b));
        let is_inside = sides.cmpge(DVec3::ZERO).all() || sides.cmple(DVec3::ZERO).all();
        let sum = sides.element_sum();
        // Not the negation: sums that are no number are left out as well.
        if !(is_inside && sum.abs() > 0.0 && sum.is_finite()) {
            return None;
        }
        let barycentric = sides / sum;
        let distance_m = barycentric.dot(DVec3::new(a[2], b[2], c[2])) * self.stretch;
        (distance_m >= 0.0).then_some(FaceHit { face, distance_m, barycentric })
    }
}

/// The place of a face that is nearest to a position, by the region that the position is in (Ericson 2005, 5.1.5).
fn nearest_on_face(position_m: DVec3, face: u32, corners_m: &[Vec3; 3]) -> Option<FaceHit> {
    if corners_m[0].is_nan() {
        return None;
    }
    let [a, b, c] = corners_m.map(|corner| corner.as_dvec3());
    let (ab, ac) = (b - a, c - a);
    let along = |corner: DVec3| (ab.dot(position_m - corner), ac.dot(position_m - corner));
    let ((ab_a, ac_a), (ab_b, ac_b), (ab_c, ac_c)) = (along(a), along(b), along(c));
    let (weight_a, weight_b, weight_c) =
        (ab_b * ac_c - ab_c * ac_b, ab_c * ac_a - ab_a * ac_c, ab_a * ac_b - ab_b * ac_a);
    let barycentric = if ab_a <= 0.0 && ac_a <= 0.0 {
        DVec3::X
    } else if ab_b >= 0.0 && ac_b <= ab_b {
        DVec3::Y
    } else if ac_c >= 0.0 && ab_c <= ac_c {
        DVec3::Z
    } else if weight_c <= 0.0 && ab_a >= 0.0 && ab_b <= 0.0 {
        between(DVec3::X, DVec3::Y, ab_a, -ab_b)
    } else if weight_b <= 0.0 && ac_a >= 0.0 && ac_c <= 0.0 {
        between(DVec3::X, DVec3::Z, ac_a, -ac_c)
    } else if weight_a <= 0.0 && ac_b >= ab_b && ab_c >= ac_c {
        between(DVec3::Y, DVec3::Z, ac_b - ab_b, ab_c - ac_c)
    } else {
        let weights = DVec3::new(weight_a, weight_b, weight_c).max(DVec3::ZERO);
        weights / weights.element_sum()
    };
    let nearest_m = a * barycentric.x + b * barycentric.y + c * barycentric.z;
    let distance_m = nearest_m.distance(position_m);
    distance_m.is_finite().then_some(FaceHit { face, distance_m, barycentric })
}

/// Weights of a place on an edge that is this far from its two ends, in any unit.
fn between(start: DVec3, end: DVec3, from_start: f64, from_end: f64) -> DVec3 {
    let length = from_start + from_end;
    let fraction = if length > 0.0 { from_start / length } else { 0.0 };
    start * (1.0 - fraction) + end * fraction
}
