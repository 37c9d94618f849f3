//! The organ's surface at one moment: chart, faces, and vertices where they are now.

use super::atlas::{Atlas, FaceTable, SurfaceFrame};
use super::sphere::SurfacePoint;
use super::{OrganModel, OrganShape};
use glam::{DVec3, Vec3};

/// Gloss of skin on which nothing lies: neither wetter (255) nor duller (0) than the skin itself.
pub const NEUTRAL_GLOSS: u8 = 128;

/// A surface at one moment. All positions are in the organ's space, metres.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// The chart with its texture coordinates.
    pub atlas: &'a Atlas,
    /// Where to start looking for the face of texture coordinates.
    pub table: &'a FaceTable,
    /// Positions of the primary vertices, metres.
    pub positions_m: &'a [Vec3],
    /// Unit normals of the primary vertices.
    pub normals: &'a [Vec3],
}

impl Surface<'_> {
    /// Corner positions of a face, metres.
    pub fn corners(&self, face: u32) -> [DVec3; 3] {
        self.atlas.chart().triangles[face as usize].map(|vertex| self.positions_m[vertex as usize].as_dvec3())
    }

    /// Where a place of the surface is, metres.
    pub fn position_m(&self, point: SurfacePoint) -> DVec3 {
        let [a, b, c] = self.corners(point.face);
        let w = point.barycentric;
        a * w.x + b * w.y + c * w.z
    }

    /// The place with weights that are not negative and sum to one, if it is one of this surface: its face is there, its
    /// numbers and its corners' positions are finite.
    pub fn checked(&self, point: SurfacePoint) -> Option<SurfacePoint> {
        let has_face = (point.face as usize) < self.atlas.chart().triangles.len();
        if !has_face || !point.barycentric.is_finite() {
            return None;
        }
        let weights = point.barycentric.max(DVec3::ZERO);
        let sum = weights.element_sum();
        let point = SurfacePoint { face: point.face, barycentric: weights / sum };
        (sum > 0.0 && self.position_m(point).is_finite()).then_some(point)
    }

    /// Unit normal between those of the corners; the flat face's where they cancel.
    pub fn normal(&self, point: SurfacePoint) -> DVec3 {
        let triangle = self.atlas.chart().triangles[point.face as usize];
        let [a, b, c] = triangle.map(|vertex| self.normals[vertex as usize].as_dvec3());
        let w = point.barycentric;
        (a * w.x + b * w.y + c * w.z).try_normalize().unwrap_or_else(|| self.face_normal(point.face))
    }

    /// Unit normal of a flat face; zero where it has no area.
    pub fn face_normal(&self, face: u32) -> DVec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Place, normal and Jacobian of the chart.
    pub fn frame(&self, point: SurfacePoint) -> SurfaceFrame {
        self.atlas.frame(point, self.positions_m, self.normals)
    }
}

impl OrganModel {
    /// The organ's surface with its vertices where they are now; the shape must be of this model.
    pub fn surface<'a>(&'a self, shape: &'a OrganShape) -> Surface<'a> {
        Surface { atlas: &self.atlas, table: &self.table, positions_m: shape.positions_m(), normals: shape.normals() }
    }
}
