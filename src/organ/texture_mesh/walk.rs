//! Walking on the geometric surface: along great-circle arcs of its chart, and straight ahead.

use super::super::{
    mesh::NO_FACE,
    sphere::{SphereMesh, SurfacePoint},
};
use glam::{DVec2, DVec3};

/// The geometric surface in double precision together with its chart.
pub(super) struct ChartedSurface<'a> {
    pub positions_m: &'a [DVec3],
    pub chart: &'a SphereMesh,
}

/// What a walk along an arc found out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arc {
    /// Length of the arc's path on the surface, metres.
    pub length_m: f64,
    /// From the start to the end after the faces between are unfolded into the plane of the start face, metres. Its
    /// length is the geodesic distance where no curvature lies between the arc and the straight line.
    pub displacement_m: DVec3,
}

impl ChartedSurface<'_> {
    pub fn corners_m(&self, face: u32) -> [DVec3; 3] {
        self.chart.triangles[face as usize].map(|vertex| self.positions_m[vertex as usize])
    }

    pub fn position_m(&self, point: SurfacePoint) -> DVec3 {
        let [a, b, c] = self.corners_m(point.face);
        a * point.barycentric.x + b * point.barycentric.y + c * point.barycentric.z
    }

    pub fn normal(&self, face: u32) -> DVec3 {
        let [a, b, c] = self.corners_m(face);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// Follows the great-circle arc from a place to a direction less than half a turn away.
    pub fn walk(&self, from: SurfacePoint, from_direction: DVec3, to_direction: DVec3) -> Arc {
        let chart = self.chart;
        let left = from_direction.cross(to_direction);
        let side = |vertex: u32| left.dot(chart.directions[vertex as usize]);
        let start = self.position_m(from);
        let [p0, p1, p2] = self.corners_m(from.face);
        let axis_x = (p1 - p0).normalize_or_zero();
        let axis_y = (p1 - p0).cross(p2 - p0).cross(axis_x).normalize_or_zero();
        let flatten = |p: DVec3| DVec2::new((p - start).dot(axis_x), (p - start).dot(axis_y));

        let mut face = from.face;
        let mut flat = [flatten(p0), flatten(p1), flatten(p2)];
        let mut length_m = 0.0;
        let mut last = start;
        let mut entered_by: Option<usize> = None;
        for _ in 0..chart.triangles.len() {
            let triangle = chart.triangles[face as usize];
            let sides = triangle.map(side);
            // Going out, the arc has the edge's first corner on its right and the second on its left.
            let exit = match entered_by {
                Some(entry) => {
                    let apex = (entry + 2) % 3;
                    if sides[apex] < 0.0 { apex } else { (entry + 1) % 3 }
                }
                None => match (0..3).find(|&k| sides[k] < 0.0 && sides[(k + 1) % 3] >= 0.0) {
                    Some(k) => k,
                    None => break,
                },
            };
            let (a, b) = (triangle[exit], triangle[(exit + 1) % 3]);
            let next = chart.neighbours[face as usize][exit];
            if next == NO_FACE || chart.is_left_of(a, b, to_direction) {
                break;
            }
            let (side_a, side_b) = (sides[exit], sides[(exit + 1) % 3]);
            let share_b = if side_b > side_a { (-side_a / (side_b - side_a)).clamp(0.0, 1.0) } else { 0.5 };
            let crossing = self.positions_m[a as usize].lerp(self.positions_m[b as usize], share_b);
            length_m += crossing.distance(last);
            last = crossing;

            let entry = side_of(chart, next, b);
            let apex = self.positions_m[chart.triangles[next as usize][(entry + 2) % 3] as usize];
            let (pa, pb) = (self.positions_m[a as usize], self.positions_m[b as usize]);
            let edge = (pb - pa).normalize_or_zero();
            let along = (apex - pa).dot(edge);
            let height = (apex - pa - edge * along).length();
            let (fa, fb) = (flat[exit], flat[(exit + 1) % 3]);
            let flat_edge = (fb - fa).normalize_or_zero();
            let flat_apex = fa + flat_edge * along + DVec2::new(flat_edge.y, -flat_edge.x) * height;
            flat[entry] = fb;
            flat[(entry + 1) % 3] = fa;
            flat[(entry + 2) % 3] = flat_apex;
            face = next;
            entered_by = Some(entry);
        }
        let weights = chart.barycentric(face, to_direction);
        let corners = self.corners_m(face);
        let end = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
        let flat_end = flat[0] * weights.x + flat[1] * weights.y + flat[2] * weights.z;
        Arc { length_m: length_m + end.distance(last), displacement_m: axis_x * flat_end.x + axis_y * flat_end.y }
    }

    /// Goes straight ahead on the surface: along a vector in the plane of the start's face, turning with the surface
    /// at every edge. Ends early at a border.
    pub fn go(&self, from: SurfacePoint, along_m: DVec3) -> SurfacePoint {
        self.go_on(from, along_m).0
    }

    /// Like [`ChartedSurface::go`]; also returns the vector with which to go on in the same direction.
    pub fn go_on(&self, from: SurfacePoint, along_m: DVec3) -> (SurfacePoint, DVec3) {
        let length_m = along_m.length();
        let mut heading = along_m;
        let mut face = from.face;
        let mut weights = from.barycentric;
        let mut rest = along_m;
        let mut entered_by = usize::MAX;
        for _ in 0..self.chart.triangles.len() {
            let corners = self.corners_m(face);
            let scaled_normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let square = scaled_normal.length_squared();
            if square <= 0.0 {
                break;
            }
            // How fast the weight of each corner changes along the way.
            let rate = DVec3::from_array(std::array::from_fn(|k| {
                scaled_normal.cross(corners[(k + 2) % 3] - corners[(k + 1) % 3]).dot(rest) / square
            }));
            let (share, exit) = way_out(weights, rate, entered_by);
            weights += rate * share;
            let Some(exit) = exit else { break };
            let next = self.chart.neighbours[face as usize][exit];
            if next == NO_FACE {
                break;
            }
            let share_b = weights[(exit + 1) % 3].max(0.0);
            let share_a = weights[exit].max(0.0);
            let total = (share_a + share_b).max(f64::MIN_POSITIVE);
            let entry = side_of(self.chart, next, self.chart.triangles[face as usize][(exit + 1) % 3]);
            let edge = (corners[(exit + 1) % 3] - corners[exit]).normalize_or_zero();
            let next_corners = self.corners_m(next);
            let inward = next_corners[(entry + 2) % 3] - corners[exit];
            let inward = (inward - edge * inward.dot(edge)).normalize_or_zero();
            let left = rest * (1.0 - share);
            let outward = edge.cross(scaled_normal).normalize_or_zero();
            rest = edge * left.dot(edge) + inward * left.dot(outward);
            heading = edge * heading.dot(edge) + inward * heading.dot(outward);
            weights = DVec3::ZERO;
            weights[entry] = share_b / total;
            weights[(entry + 1) % 3] = share_a / total;
            face = next;
            entered_by = entry;
        }
        let inside = weights.max(DVec3::ZERO);
        let end = SurfacePoint { face, barycentric: inside / inside.element_sum().max(f64::MIN_POSITIVE) };
        (end, heading.normalize_or_zero() * length_m)
    }
}

/// The side of a face that begins at a vertex.
pub(super) fn side_of(mesh: &SphereMesh, face: u32, first: u32) -> usize {
    mesh.triangles[face as usize].iter().position(|&v| v == first).unwrap_or(0)
}

/// How much of a step through a triangle is taken before it leaves, and the side it leaves by; all of it and no side
/// where it ends inside. `rate` is what the whole step adds to the weights of the corners.
///
/// The side that was just entered through cannot be the way out, whatever rounding says.
pub(super) fn way_out(weights: DVec3, rate: DVec3, entered_by: usize) -> (f64, Option<usize>) {
    let mut share = 1.0;
    let mut exit = None;
    for corner in 0..3 {
        let opposite = (corner + 1) % 3;
        if rate[corner] < 0.0 && opposite != entered_by {
            let until = (weights[corner] / -rate[corner]).max(0.0);
            if until < share {
                share = until;
                exit = Some(opposite);
            }
        }
    }
    (share, exit)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// An octahedron refined a few times, as the unit sphere.
    pub fn sphere(levels: u32) -> SphereMesh {
        let mut directions = vec![DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let mut triangles: Vec<[u32; 3]> = (0..4).flat_map(|k| [[k, (k + 1) % 4, 4], [(k + 1) % 4, k, 5]]).collect();
        for _ in 0..levels {
            let mut middles = BTreeMap::new();
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let mut middle = |i: u32, j: u32| {
                        *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                            directions.push((directions[i as usize] + directions[j as usize]).normalize());
                            directions.len() as u32 - 1
                        })
                    };
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
        }
        SphereMesh::new(directions, triangles)
    }

    #[test]
    fn on_an_octahedron_arcs_and_straight_walks_are_known() {
        let chart = sphere(0);
        let positions_m = chart.directions.clone();
        let surface = ChartedSurface { positions_m: &positions_m, chart: &chart };
        let centre = SurfacePoint { face: 0, barycentric: DVec3::splat(1.0 / 3.0) };
        let from = chart.direction(centre);
        for across in chart.neighbours[0] {
            let target = SurfacePoint { face: across, barycentric: DVec3::splat(1.0 / 3.0) };
            let arc = surface.walk(centre, from, chart.direction(target));
            // From centre to centre over the middle of an edge: twice the inscribed circle's radius.
            let expected = 2.0 * (1.0f64 / 6.0).sqrt();
            assert!((arc.length_m - expected).abs() < 1e-12, "{}", arc.length_m);
            assert!((arc.displacement_m.length() - expected).abs() < 1e-12);
            let end = surface.go(centre, arc.displacement_m);
            assert_eq!(end.face, across);
            assert!(end.barycentric.distance(target.barycentric) < 1e-12);
        }
        // Within the face nothing is crossed.
        let near = SurfacePoint { face: 0, barycentric: DVec3::new(0.5, 0.3, 0.2) };
        let arc = surface.walk(centre, from, chart.direction(near));
        assert!((arc.length_m - surface.position_m(near).distance(surface.position_m(centre))).abs() < 1e-12);
    }

    #[test]
    fn walking_straight_leads_along_a_great_circle_and_back() {
        let chart = sphere(5);
        let positions_m = chart.directions.clone();
        let surface = ChartedSurface { positions_m: &positions_m, chart: &chart };
        let start = chart.locate(0, DVec3::new(0.3, 0.5, 0.7).normalize());
        let from = surface.position_m(start);
        let along = surface.normal(start.face).cross(DVec3::Z).normalize();
        let (quarter, on) = surface.go_on(start, along * std::f64::consts::FRAC_PI_2);
        let off = surface.position_m(quarter).normalize().distance(along);
        // The facets are 0.05 wide, and each turns the way a little.
        assert!(off < 0.05, "{off}");
        assert!(on.normalize().distance(-from.normalize()) < 0.05);
        let (home, _) = surface.go_on(quarter, on * 3.0);
        assert!(surface.position_m(home).distance(from) < 0.15);
    }
}
