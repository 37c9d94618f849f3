//! The first vertices of a texture mesh: evenly spread over the surface, connected as Delaunay in the chart.

use super::{super::sphere::SurfacePoint, triangulation::Triangulation, walk::ChartedSurface};
use glam::{DVec3, IVec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::collections::HashMap;

/// Darts thrown for every vertex that fits; more fill the surface more evenly.
const DARTS_PER_VERTEX: usize = 8;
/// Least distance between first vertices, in edge lengths: what a dense dart throw with this radius leaves is about as
/// many vertices as a regular triangulation has.
const RADIUS_PER_EDGE: f64 = 0.8;

/// Throws darts uniformly over the surface and keeps those at least a radius from the ones before (on the same side
/// of the organ), then triangulates them.
pub(super) fn sample(surface: &ChartedSurface, edge_length_m: f64, vertices: usize, seed: u64) -> Triangulation {
    let chart = surface.chart;
    let axes = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let mut face = 0;
    let corners = axes.map(|axis| {
        let found = chart.locate(face, axis);
        face = found.face;
        SurfacePoint { face, barycentric: inside(found.barycentric) }
    });
    let mut triangulation =
        Triangulation::octahedron(corners, corners.map(|point| chart.direction(point)), edge_length_m);

    let mut summed_area = Vec::with_capacity(chart.triangles.len());
    let mut area = 0.0;
    for face in 0..chart.triangles.len() as u32 {
        let [a, b, c] = surface.corners_m(face);
        area += 0.5 * (b - a).cross(c - a).length();
        summed_area.push(area);
    }
    let mut random = Pcg32::seed_from_u64(seed);
    let mut taken = Taken::new(RADIUS_PER_EDGE * edge_length_m);
    for corner in corners {
        taken.insert(surface.position_m(corner), surface.normal(corner.face));
    }
    let mut near = 0;
    let darts = DARTS_PER_VERTEX * vertices;
    for dart in 0..darts {
        // The golden ratio's multiples fill [0, 1) evenly in every prefix, so no region waits long for its darts.
        let at = (dart as f64 * 0.618_033_988_749_894_9).fract() * area;
        let face = summed_area.partition_point(|&sum| sum <= at).min(summed_area.len() - 1) as u32;
        let (mut s, mut t): (f64, f64) = (random.random(), random.random());
        if s + t > 1.0 {
            (s, t) = (1.0 - s, 1.0 - t);
        }
        let point = SurfacePoint { face, barycentric: inside(DVec3::new(1.0 - s - t, s, t)) };
        let (position, normal) = (surface.position_m(point), surface.normal(face));
        if !taken.is_free(position, normal) {
            continue;
        }
        let direction = chart.direction(point);
        if let Some(triangle) = triangulation.locate(near, direction) {
            near = triangle;
            if triangulation.insert(triangle, point, direction) {
                taken.insert(position, normal);
            }
        }
    }
    triangulation
}

/// Keeps a place off the edges and corners of its face, where it would belong to several faces.
fn inside(weights: DVec3) -> DVec3 {
    let weights = weights.max(DVec3::splat(1e-6));
    weights / weights.element_sum()
}

/// Places already taken, in a grid. Looked up by cell only, never iterated over.
struct Taken {
    radius_m: f64,
    cells: HashMap<IVec3, Vec<(DVec3, DVec3)>>,
}

impl Taken {
    fn new(radius_m: f64) -> Self {
        Self { radius_m, cells: HashMap::new() }
    }

    fn cell(&self, position: DVec3) -> IVec3 {
        (position / self.radius_m).floor().as_ivec3()
    }

    fn insert(&mut self, position: DVec3, normal: DVec3) {
        let cell = self.cell(position);
        self.cells.entry(cell).or_default().push((position, normal));
    }

    /// Whether nobody whose surface faces the same way is nearer than the radius.
    fn is_free(&self, position: DVec3, normal: DVec3) -> bool {
        let cell = self.cell(position);
        (-1..=1).all(|x| {
            (-1..=1).all(|y| {
                (-1..=1).all(|z| {
                    self.cells.get(&(cell + IVec3::new(x, y, z))).is_none_or(|others| {
                        others.iter().all(|(p, n)| {
                            p.distance_squared(position) >= self.radius_m * self.radius_m || n.dot(normal) < 0.0
                        })
                    })
                })
            })
        })
    }
}
