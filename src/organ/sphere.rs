//! A triangulated unit sphere: what a spherical chart is, and where a direction lies on it.

use super::mesh;
use bevy::reflect::Reflect;
use exact::{minor_sign, triple_sign};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// A place on a triangulated surface: a face and the weights of its three corners (they sum to one).
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SurfacePoint {
    /// Index of the face.
    pub face: u32,
    /// Weights of the face's three corners.
    pub barycentric: DVec3,
}

/// A triangulation of the unit sphere by great-circle arcs, bijective where every face is positive and the solid
/// angles sum to 4 pi.
///
/// Inside a face the sphere and the surface correspond by central (gnomonic) projection of the flat triangle through
/// the three directions: weights `w` on the surface face belong to the direction `normalize(w0 d0 + w1 d1 + w2 d2)`.
/// Great circles are therefore straight lines inside every face, and neither the date line nor the poles are special.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SphereMesh {
    /// Unit vectors, one per vertex.
    pub directions: Vec<DVec3>,
    /// Faces, counter-clockwise seen from outside the sphere.
    pub triangles: Vec<[u32; 3]>,
    /// Face across the edges (0,1), (1,2), (2,0) of each face.
    pub neighbours: Vec<[u32; 3]>,
}

impl SphereMesh {
    /// Takes directions and faces as they are; see [`SphereMesh::is_positive`] for whether they form a chart.
    pub fn new(directions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let neighbours = mesh::neighbours(&triangles);
        Self { directions, triangles, neighbours }
    }

    /// Directions of a face's corners.
    pub fn corners(&self, face: u32) -> [DVec3; 3] {
        self.triangles[face as usize].map(|vertex| self.directions[vertex as usize])
    }

    /// Signed volume spanned by a face's corners: positive where the face is not flipped.
    pub fn determinant(&self, face: u32) -> f64 {
        let [a, b, c] = self.corners(face);
        a.dot(b.cross(c))
    }

    /// Signed solid angle of a face in steradians (van Oosterom and Strackee 1983).
    pub fn solid_angle(&self, face: u32) -> f64 {
        let [a, b, c] = self.corners(face);
        2.0 * a.dot(b.cross(c)).atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    }

    /// Whether no face is flipped or degenerate and the whole sphere is covered exactly once.
    ///
    /// The signs of the faces are exact. Positive faces that close up cover every point equally often, so the solid
    /// angles, summed with rounding, need only tell once from twice.
    pub fn is_positive(&self) -> bool {
        let faces = 0..self.triangles.len() as u32;
        let covered: f64 = faces.clone().map(|face| self.solid_angle(face)).sum();
        (covered - 4.0 * std::f64::consts::PI).abs() < 1e-6
            && self.directions.iter().all(|direction| direction.is_finite())
            && self.neighbours.iter().flatten().all(|&neighbour| neighbour != mesh::NO_FACE)
            && faces.into_iter().all(|face| self.orientation(face).is_gt())
    }

    /// Exact sign of [`SphereMesh::determinant`]: greater where a face is the right way round, equal where it is
    /// degenerate. All components must lie within [-1, 1].
    pub fn orientation(&self, face: u32) -> Ordering {
        let [a, b, c] = self.corners(face);
        triple_sign(a, b, c)
    }

    /// Exact side of the great circle from vertex `a` to vertex `b` that a direction lies on: greater on the left,
    /// equal on the circle. All components must lie within [-1, 1].
    pub fn side(&self, a: u32, b: u32, direction: DVec3) -> Ordering {
        triple_sign(direction, self.directions[a as usize], self.directions[b as usize])
    }

    /// Which side of the edge from vertex `a` to vertex `b` a direction lies on; `true` is the left (inner) side.
    ///
    /// Exact, ties included: a direction on an edge counts as moved by an infinitely small amount, the same for every
    /// edge (by `(e, e^2, e^3)`, after Edelsbrunner and Muecke 1990). So every direction lies in exactly one face of
    /// a chart, also where faces meet in an edge or a vertex. All components must lie within [-1, 1]; neither the
    /// direction nor the vertices need to be of unit length.
    pub fn is_left_of(&self, a: u32, b: u32, direction: DVec3) -> bool {
        let side = self.side(a, b, direction);
        let (a, b) = (self.directions[a as usize], self.directions[b as usize]);
        side.then_with(|| minor_sign(a.y, b.z, a.z, b.y))
            .then_with(|| minor_sign(a.z, b.x, a.x, b.z))
            .then_with(|| minor_sign(a.x, b.y, a.y, b.x))
            == Ordering::Greater
    }

    /// Whether a direction lies in a face, under the tie rule of [`SphereMesh::is_left_of`].
    pub fn contains(&self, face: u32, direction: DVec3) -> bool {
        let [a, b, c] = self.triangles[face as usize];
        self.is_left_of(a, b, direction) && self.is_left_of(b, c, direction) && self.is_left_of(c, a, direction)
    }

    /// The face and place that a direction lies in, found from `start_face`; a nearby start makes it a step or two.
    pub fn locate(&self, start_face: u32, direction: DVec3) -> SurfacePoint {
        let face = self.face_of(start_face, direction);
        SurfacePoint { face, barycentric: self.barycentric(face, direction) }
    }

    /// The face that a direction lies in, found from `start_face`; on a broken chart that may be `start_face` itself.
    pub fn face_of(&self, start_face: u32, direction: DVec3) -> u32 {
        self.walk(start_face, direction)
            .or_else(|| (0..self.triangles.len() as u32).find(|&face| self.contains(face, direction)))
            .unwrap_or(start_face)
    }

    /// The face that a direction lies in, by stepping over edges that it lies beyond; `None` where the walk leaves
    /// the chart by a border or takes longer than any sound one.
    fn walk(&self, start_face: u32, direction: DVec3) -> Option<u32> {
        let mut face = start_face;
        // The first side tried changes from step to step, so that a walk cannot circle for ever round a vertex.
        for turn in 0..2 * self.triangles.len() + 3 {
            let triangle = *self.triangles.get(face as usize)?;
            let out = (0..3)
                .map(|k| (k + turn) % 3)
                .find(|&k| !self.is_left_of(triangle[k], triangle[(k + 1) % 3], direction));
            match out {
                None => return Some(face),
                Some(side) => face = self.neighbours[face as usize][side],
            }
        }
        None
    }

    /// Weights on the flat face of the point that a direction projects to (not clamped: sums to one).
    pub fn barycentric(&self, face: u32, direction: DVec3) -> DVec3 {
        let [a, b, c] = self.corners(face);
        let weights = DVec3::new(b.cross(c).dot(direction), c.cross(a).dot(direction), a.cross(b).dot(direction));
        weights / weights.element_sum()
    }

    /// The direction of a place on the surface.
    pub fn direction(&self, point: SurfacePoint) -> DVec3 {
        let [a, b, c] = self.corners(point.face);
        let w = point.barycentric;
        (a * w.x + b * w.y + c * w.z).normalize()
    }
}

mod exact {
    //! Signs that are right to the last bit, for the few places where rounding could give a point two faces or none.
    //!
    //! A sum of products of floating-point numbers is itself a sum of a few such numbers without any error (Dekker 1971,
    //! Shewchuk 1997); its sign is that of the largest term. This is slow, so it is only asked where the plain result is
    //! smaller than its own rounding error could be. Exact for inputs whose products of three stay clear of underflow,
    //! which all coordinates of zero or above about 1e-80 do.

    use glam::DVec3;
    use std::cmp::Ordering;

    /// Terms of a determinant of three vectors: six products of three numbers, four terms each.
    const MOST_TERMS: usize = 24;

    /// Bound on the rounding error of `a . (b x c)` for vectors with components within [-1, 1], with some to spare.
    const TRIPLE_ERROR: f64 = 1e-14;

    /// Sign of the determinant of three vectors with components within [-1, 1].
    pub(super) fn triple_sign(a: DVec3, b: DVec3, c: DVec3) -> Ordering {
        let plain = b.cross(c).dot(a);
        if plain.abs() > TRIPLE_ERROR {
            return if plain > 0.0 { Ordering::Greater } else { Ordering::Less };
        }
        let mut sum = ExactSum { terms: [0.0; MOST_TERMS], count: 0 };
        for (x, y, z, sign) in [
            (a.x, b.y, c.z, 1.0),
            (a.y, b.z, c.x, 1.0),
            (a.z, b.x, c.y, 1.0),
            (a.x, b.z, c.y, -1.0),
            (a.y, b.x, c.z, -1.0),
            (a.z, b.y, c.x, -1.0),
        ] {
            let (high, low) = two_product(sign * x, y);
            for part in [high, low] {
                let (high, low) = two_product(part, z);
                sum.add(low);
                sum.add(high);
            }
        }
        sum.sign()
    }

    /// Sign of `a b - c d`.
    pub(super) fn minor_sign(a: f64, b: f64, c: f64, d: f64) -> Ordering {
        let mut sum = ExactSum { terms: [0.0; MOST_TERMS], count: 0 };
        for (x, y) in [(a, b), (-c, d)] {
            let (high, low) = two_product(x, y);
            sum.add(low);
            sum.add(high);
        }
        sum.sign()
    }

    /// The product and what rounding took from it.
    fn two_product(a: f64, b: f64) -> (f64, f64) {
        let product = a * b;
        (product, a.mul_add(b, -product))
    }

    /// The sum and what rounding took from it.
    fn two_sum(a: f64, b: f64) -> (f64, f64) {
        let sum = a + b;
        let b_part = sum - a;
        (sum, (a - (sum - b_part)) + (b - b_part))
    }

    /// A sum without rounding: terms that do not overlap, in order of growing size.
    struct ExactSum {
        terms: [f64; MOST_TERMS],
        count: usize,
    }

    impl ExactSum {
        fn add(&mut self, value: f64) {
            let mut carry = value;
            for term in &mut self.terms[..self.count] {
                (carry, *term) = two_sum(carry, *term);
            }
            self.terms[self.count] = carry;
            self.count += 1;
        }

        fn sign(&self) -> Ordering {
            let largest = self.terms[..self.count].iter().rev().find(|&&term| term != 0.0).copied().unwrap_or(0.0);
            largest.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[test]
        fn sign_of_a_determinant_below_rounding() {
            // The third vector is the sum of the other two but for the last bit of one component.
            let (a, b) = (DVec3::new(0.1, 0.7, -0.3), DVec3::new(0.3, -0.2, 0.6));
            let exact = DVec3::new(0.5, 0.25, 0.125);
            assert_eq!(triple_sign(exact, exact * 0.5, b), Ordering::Equal);
            let nudged = DVec3::new(0.25, 0.125, 0.0625f64.next_up());
            // exact x nudged = (0.25 e, -0.5 e, 0) with e > 0, so the sign is that of 0.25 b.x - 0.5 b.y.
            assert_eq!(triple_sign(exact, nudged, b), Ordering::Greater);
            assert_eq!(triple_sign(nudged, exact, b), Ordering::Less);
            assert_eq!(triple_sign(a, b, a.cross(b)), Ordering::Greater);
        }

        #[test]
        fn sign_of_a_minor_below_rounding() {
            let x = 0.1f64;
            assert_eq!(minor_sign(x, x, x, x), Ordering::Equal);
            assert_eq!(minor_sign(x.next_up(), x.next_down(), x, x), Ordering::Less);
        }
    }
}
