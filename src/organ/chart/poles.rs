//! Which places of the organ become the poles of the chart, and where the date line runs.

use super::report::PoleReport;
use crate::organ::mesh::SurfaceMesh;
use crate::organ::sphere::{SphereMesh, SurfacePoint};
use bevy::reflect::Reflect;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Where the poles of a chart go. They are opposite each other on the sphere, so one choice settles both.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub enum Poles {
    /// Where the organ is least likely to be touched: on the places that face away most from where instruments and
    /// scope come from. Both poles count, the worse of the two decides. The date line, too, runs over places that
    /// face away as far as it can.
    Auto {
        /// Direction in the organ's space from the organ towards scope and instruments; need not be of unit length.
        approach: DVec3,
    },
    /// The north pole goes as far as it can along this direction of the organ's space, the south pole as far as it
    /// can the other way.
    Axis(DVec3),
    /// Both poles go as far as they can from this point of the organ's space, metres; the worse of the two decides.
    AwayFrom(DVec3),
}

impl Default for Poles {
    /// The patient lies on the back with the front of the body up (+Y), and instruments come from there.
    fn default() -> Self {
        Self::Auto { approach: DVec3::Y }
    }
}

/// Axes that are tried.
const AXES: usize = 1024;
/// Turns about the axis that are tried for the date line.
const TURNS: usize = 48;
/// Places at which the date line is judged.
const MERIDIAN_STEPS: usize = 24;
/// Power of the cosine that weighs the faces round a pole (half weight at about 12 degrees).
const CAP_POWER: i32 = 32;

/// Normals and places of the faces as the chart shows them.
struct Judge<'a> {
    mesh: &'a SurfaceMesh,
    chart: &'a SphereMesh,
    /// Middle of each face on the sphere, and its area vector (outward, area on the organ) in square metres.
    faces: Vec<(DVec3, DVec3)>,
    poles: Poles,
}

impl Judge<'_> {
    fn position(&self, point: SurfacePoint) -> DVec3 {
        let [a, b, c] = self.mesh.corners(point.face);
        let w = point.barycentric;
        a * w.x + b * w.y + c * w.z
    }

    /// Mean unit normals of the organ round a direction and round the opposite one.
    fn cap_normals(&self, axis: DVec3) -> [DVec3; 2] {
        let mut sums = [DVec3::ZERO; 2];
        for &(middle, area) in &self.faces {
            let cosine = axis.dot(middle);
            sums[usize::from(cosine < 0.0)] += area * cosine.powi(CAP_POWER);
        }
        sums.map(DVec3::normalize_or_zero)
    }

    /// The higher, the better these two places are as poles.
    fn score(&self, axis: DVec3, places: [SurfacePoint; 2]) -> f64 {
        match self.poles {
            Poles::Auto { approach } => {
                let [north, south] = self.cap_normals(axis).map(|normal| -normal.dot(approach));
                // The better one breaks ties between axes whose worse ends are alike.
                north.min(south) + 0.01 * north.max(south)
            }
            Poles::Axis(axis) => (self.position(places[0]) - self.position(places[1])).dot(axis),
            Poles::AwayFrom(point_m) => {
                let [north, south] = places.map(|place| self.position(place).distance(point_m));
                north.min(south)
            }
        }
    }

    /// The higher, the better the date line may pass here.
    fn seam_score(&self, place: SurfacePoint) -> f64 {
        match self.poles {
            Poles::Auto { approach } => {
                let [a, b, c] = self.mesh.corners(place.face);
                -(b - a).cross(c - a).normalize_or_zero().dot(approach)
            }
            Poles::Axis(_) => 0.0,
            Poles::AwayFrom(point_m) => self.position(place).distance(point_m),
        }
    }
}

/// Rotates a chart so that its poles (+Y and -Y) and its date line (the meridian of +Z) lie as asked for.
pub(super) fn aim(mesh: &SurfaceMesh, chart: SphereMesh, poles: Poles) -> (SphereMesh, [PoleReport; 2]) {
    let faces = (0..mesh.triangles.len() as u32)
        .map(|face| {
            let middle = chart.corners(face).iter().sum::<DVec3>().normalize_or_zero();
            let [a, b, c] = mesh.corners(face);
            (middle, 0.5 * (b - a).cross(c - a))
        })
        .collect();
    let judge = Judge { mesh, chart: &chart, faces, poles };
    let mut places = [SurfacePoint::default(); 2];
    let (mut best, mut best_score) = (DVec3::Y, f64::NEG_INFINITY);
    for axis in (0..AXES).map(|k| fibonacci(k, AXES)) {
        places = [chart.locate(places[0].face, axis), chart.locate(places[1].face, -axis)];
        let score = judge.score(axis, places);
        if score > best_score {
            (best, best_score) = (axis, score);
        }
    }
    let seam = best_seam(&judge, best, places[0].face);
    let rotation = DMat3::from_cols(best.cross(seam), best, seam).transpose();
    let normals = judge.cap_normals(best);
    let reports = [best, -best].map(|axis| {
        let point = chart.locate(places[0].face, axis);
        PoleReport { point, position_m: judge.position(point), normal: DVec3::ZERO }
    });
    let reports = [0, 1].map(|k| PoleReport { normal: normals[k], ..reports[k] });
    let SphereMesh { directions, triangles, neighbours } = chart;
    let directions = directions.into_iter().map(|direction| (rotation * direction).normalize()).collect();
    (SphereMesh { directions, triangles, neighbours }, reports)
}

/// The direction square to the axis whose meridian suits the date line best.
fn best_seam(judge: &Judge, axis: DVec3, mut face: u32) -> DVec3 {
    let (first, second) = axis.any_orthonormal_pair();
    let (mut best, mut best_score) = (first, f64::NEG_INFINITY);
    for turn in 0..TURNS {
        let (sin, cos) = (2.0 * PI * turn as f64 / TURNS as f64).sin_cos();
        let seam = cos * first + sin * second;
        let score: f64 = (0..MERIDIAN_STEPS)
            .map(|step| {
                let (sin, cos) = (PI * (step as f64 + 0.5) / MERIDIAN_STEPS as f64).sin_cos();
                let place = judge.chart.locate(face, cos * axis + sin * seam);
                face = place.face;
                judge.seam_score(place)
            })
            .sum();
        if score > best_score {
            (best, best_score) = (seam, score);
        }
    }
    best
}

/// Evenly spread directions (a Fibonacci spiral).
fn fibonacci(k: usize, count: usize) -> DVec3 {
    let y = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
    let (sin, cos) = (k as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
    let radius = (1.0 - y * y).max(0.0).sqrt();
    DVec3::new(radius * cos, y, radius * sin)
}
