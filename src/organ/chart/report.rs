//! How much a chart stretches, in numbers.

use crate::organ::mesh::SurfaceMesh;
use crate::organ::sphere::{SphereMesh, SurfacePoint};
use bevy::reflect::Reflect;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How a chart was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub enum ChartMethod {
    /// Projection of the organ from a point inside, from which all of it is visible.
    CentralProjection,
    /// Coarse-to-fine layout of least stretch.
    #[default]
    Relaxed,
}

/// Where a pole of the chart came to lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct PoleReport {
    /// Place on the organ's surface.
    pub point: SurfacePoint,
    /// The same place in the organ's space, metres.
    pub position_m: DVec3,
    /// Outward unit normal of the surface round the pole (mean over a cap of the chart).
    pub normal: DVec3,
}

/// What was built, and how well it does.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct ChartReport {
    /// Which of the ways was taken.
    pub method: ChartMethod,
    /// Whether the organ is star-shaped: all of it visible from one point inside.
    pub is_star_shaped: bool,
    /// Stretch of the chart.
    pub distortion: Distortion,
    /// North pole (+Y of the sphere, `v = 0`).
    pub north: PoleReport,
    /// South pole (-Y of the sphere, `v = 1`).
    pub south: PoleReport,
}

/// Stretch of a chart over its faces, counted face by face.
///
/// The area ratio of a face is its share of the sphere over its share of the organ's area: one everywhere would be an
/// equal-area chart. The angle distortion is the longer over the shorter axis of the ellipse that the flat face on
/// the organ makes of a circle on the flat face on the sphere: one everywhere would be a conformal chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Distortion {
    /// Least area ratio of all faces.
    pub area_min: f64,
    /// Area ratio that one in a hundred faces falls short of.
    pub area_p1: f64,
    /// Median area ratio.
    pub area_median: f64,
    /// Area ratio that one in a hundred faces exceeds.
    pub area_p99: f64,
    /// Greatest area ratio of all faces.
    pub area_max: f64,
    /// Mean angle distortion.
    pub angle_mean: f64,
    /// Angle distortion that one in a hundred faces exceeds.
    pub angle_p99: f64,
}

impl Distortion {
    /// Measures a chart of a surface (same faces, same vertices).
    pub fn measure(mesh: &SurfaceMesh, chart: &SphereMesh) -> Self {
        let faces = 0..mesh.triangles.len() as u32;
        let total_m2 = mesh.area_m2();
        let mut areas: Vec<f64> = faces
            .clone()
            .map(|face| (chart.solid_angle(face) / (4.0 * PI)) / (mesh.face_area_m2(face) / total_m2))
            .collect();
        let mut angles: Vec<f64> =
            faces.map(|face| angle_distortion(mesh.corners(face), chart.corners(face))).collect();
        let angle_mean = angles.iter().sum::<f64>() / angles.len() as f64;
        areas.sort_unstable_by(f64::total_cmp);
        angles.sort_unstable_by(f64::total_cmp);
        Self {
            area_min: quantile(&areas, 0.0),
            area_p1: quantile(&areas, 0.01),
            area_median: quantile(&areas, 0.5),
            area_p99: quantile(&areas, 0.99),
            area_max: quantile(&areas, 1.0),
            angle_mean,
            angle_p99: quantile(&angles, 0.99),
        }
    }

    /// Whether 98 of 100 faces have an area ratio within the bounds, one in a hundred left out at either end.
    pub fn is_within(&self, least: f64, most: f64) -> bool {
        self.area_p1 >= least && self.area_p99 <= most
    }
}

/// Value at a share of a sorted list, between its neighbours; not a number for an empty list.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    let fraction = place - place.floor();
    sorted[low] + (if fraction > 0.0 { (sorted[high] - sorted[low]) * fraction } else { 0.0 })
}

/// Ratio of the singular values of the linear map between two flat triangles.
fn angle_distortion(from: [DVec3; 3], to: [DVec3; 3]) -> f64 {
    let flat = |[a, b, c]: [DVec3; 3]| {
        let (first, second) = (b - a, c - a);
        let length = first.length();
        let x = second.dot(first) / length;
        (length, x, first.cross(second).length() / length)
    };
    let ((l0, x0, h0), (l1, x1, h1)) = (flat(from), flat(to));
    // Both triangles with their first edge along x: the map is upper triangular.
    let (xx, yy) = (l1 / l0, h1 / h0);
    let xy = (x1 - xx * x0) / h0;
    let shear = (xx * xx + yy * yy + xy * xy) / (2.0 * xx * yy);
    shear + (shear * shear - 1.0).max(0.0).sqrt()
}
