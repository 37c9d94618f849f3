//! Straightening a chart so that the texture triangles' edges are straight on the surface.
//!
//! A texture edge is a great-circle arc, and an arc is only as straight on the surface as the chart is true there. So
//! the texture mesh uses a chart of its own: the organ's chart, in which the geometric vertices are moved over the fixed
//! texture triangulation until the map from the tiles to the surface is as true as can be, across the edges of the
//! tiles too (in the spirit of Khodakovsky, Litke and Schroeder 2003, "Globally smooth parameterizations with low
//! distortion"). Places next to a vertex are compared in the plane into which the tiles between them unfold.

use super::{
    super::sphere::SphereMesh,
    stretch::{Element, MIPS_ONLY},
    tile_coords::{tile_corners, tile_weights},
    walk::{side_of, way_out},
};
use glam::{DVec2, DVec3};

/// No face gets thinner than this (determinant over the square of its longest chord) unless it was before.
const LEAST_FATNESS: f64 = 0.05;
/// A vertex stays where it is if an edge at it is longer than this many texture edges: what unfolds then is no longer
/// what lies between.
const LONGEST_EDGE: f64 = 0.75;

/// A chart being straightened.
pub(super) struct Straightener<'a> {
    chart: &'a mut SphereMesh,
    positions_m: &'a [DVec3],
    /// Faces around each vertex, and where each list begins.
    faces: Vec<u32>,
    starts: Vec<u32>,
}

impl<'a> Straightener<'a> {
    pub fn new(chart: &'a mut SphereMesh, positions_m: &'a [DVec3]) -> Self {
        let mut starts = vec![0u32; chart.directions.len() + 1];
        for &vertex in chart.triangles.iter().flatten() {
            starts[vertex as usize + 1] += 1;
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let mut fill = starts.clone();
        let mut faces = vec![0; chart.triangles.len() * 3];
        for (face, triangle) in chart.triangles.iter().enumerate() {
            for &vertex in triangle {
                faces[fill[vertex as usize] as usize] = face as u32;
                fill[vertex as usize] += 1;
            }
        }
        Self { chart, positions_m, faces, starts }
    }

    /// Moves every vertex a few times over the texture triangulation.
    pub fn straighten(&mut self, texture: &SphereMesh, edge_length_m: f64, sweeps: u32) {
        let mut triangle_of = vec![0u32; self.chart.directions.len()];
        let mut near = 0;
        for (vertex, triangle) in triangle_of.iter_mut().enumerate() {
            near = texture.locate(near, self.chart.directions[vertex]).face;
            *triangle = near;
        }
        let elements: Vec<Option<Element>> = self
            .chart
            .triangles
            .iter()
            .map(|t| Element::new(t.map(|v| self.positions_m[v as usize] / edge_length_m)))
            .collect();
        let movable: Vec<bool> = (0..self.chart.directions.len())
            .map(|vertex| {
                self.star(vertex).iter().all(|&face| {
                    let [a, b, c] = self.chart.triangles[face as usize].map(|v| self.positions_m[v as usize]);
                    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                    longest < LONGEST_EDGE * edge_length_m
                })
            })
            .collect();
        let mut places = Vec::new();
        for _ in 0..sweeps {
            for (vertex, &movable) in movable.iter().enumerate() {
                if movable {
                    self.move_vertex(vertex, texture, &mut triangle_of, &elements, &mut places);
                }
            }
        }
    }

    fn star(&self, vertex: usize) -> &[u32] {
        &self.faces[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    fn fatness(&self, face: u32) -> f64 {
        let [a, b, c] = self.chart.corners(face);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        a.dot((b - a).cross(c - a)) / longest.max(f64::MIN_POSITIVE)
    }

    fn move_vertex(
        &mut self,
        vertex: usize,
        texture: &SphereMesh,
        triangle_of: &mut [u32],
        elements: &[Option<Element>],
        places: &mut Vec<(u32, [DVec2; 3], usize)>,
    ) {
        let triangle = triangle_of[vertex];
        let direction = self.chart.directions[vertex];
        let here = place_in_tile(texture, triangle, direction);
        places.clear();
        for k in self.starts[vertex] as usize..self.starts[vertex + 1] as usize {
            let face = self.faces[k];
            let corners = self.chart.triangles[face as usize];
            let own = corners.iter().position(|&v| v as usize == vertex).unwrap_or(0);
            let mut unfolded = [here; 3];
            for i in [(own + 1) % 3, (own + 2) % 3] {
                unfolded[i] = unfold(texture, triangle, direction, self.chart.directions[corners[i] as usize]);
            }
            places.push((face, unfolded, own));
        }
        let energy_at = |place: DVec2| -> f64 {
            places
                .iter()
                .filter_map(|&(face, mut corners, own)| {
                    corners[own] = place;
                    elements[face as usize].as_ref().map(|e| e.energy(corners, MIPS_ONLY))
                })
                .sum()
        };
        let before = energy_at(here);
        if !before.is_finite() {
            // Unfolding went round an irregular vertex and says nothing about the shape.
            return;
        }
        let (mut slope, mut stiffness) = (DVec2::ZERO, 0.0);
        for &(face, corners, own) in places.iter() {
            if let Some(element) = &elements[face as usize] {
                let (s, h) = element.slope(corners, own, MIPS_ONLY);
                slope += s;
                stiffness += h;
            }
        }
        let mut step = -slope / f64::max(stiffness, f64::MIN_POSITIVE);
        let old_fatness: f64 = places.iter().map(|p| self.fatness(p.0)).fold(f64::INFINITY, f64::min);
        for _ in 0..4 {
            if energy_at(here + step) < before {
                let (new_triangle, new_direction) = go(texture, triangle, here, step);
                self.chart.directions[vertex] = new_direction;
                let fatness = places.iter().map(|p| self.fatness(p.0)).fold(f64::INFINITY, f64::min);
                if fatness > LEAST_FATNESS.min(old_fatness) && fatness > 0.0 {
                    triangle_of[vertex] = new_triangle;
                    return;
                }
                self.chart.directions[vertex] = direction;
            }
            step *= 0.5;
        }
    }
}

/// Place in the tile of a texture triangle that a direction projects to.
fn place_in_tile(texture: &SphereMesh, triangle: u32, direction: DVec3) -> DVec2 {
    let weights = texture.barycentric(triangle, direction);
    let tile = tile_corners();
    tile[0] * weights.x + tile[1] * weights.y + tile[2] * weights.z
}

/// Place of a direction in the plane of a triangle's tile, after the tiles along the arc to it are unfolded.
fn unfold(texture: &SphereMesh, start: u32, from: DVec3, to: DVec3) -> DVec2 {
    let left = from.cross(to);
    let mut triangle = start;
    let mut flat = tile_corners();
    let mut entered_by: Option<usize> = None;
    for _ in 0..64 {
        let ids = texture.triangles[triangle as usize];
        let sides = ids.map(|v| left.dot(texture.directions[v as usize]));
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
        let (a, b) = (ids[exit], ids[(exit + 1) % 3]);
        if texture.directions[a as usize].cross(texture.directions[b as usize]).dot(to) >= 0.0 {
            break;
        }
        let (fa, fb, fc) = (flat[exit], flat[(exit + 1) % 3], flat[(exit + 2) % 3]);
        triangle = texture.neighbours[triangle as usize][exit];
        let entry = side_of(texture, triangle, b);
        flat[entry] = fb;
        flat[(entry + 1) % 3] = fa;
        flat[(entry + 2) % 3] = fa + fb - fc;
        entered_by = Some(entry);
    }
    let weights = texture.barycentric(triangle, to);
    flat[0] * weights.x + flat[1] * weights.y + flat[2] * weights.z
}

/// Goes straight ahead over the tiles; where that ends: the triangle and the direction.
fn go(texture: &SphereMesh, start: u32, place: DVec2, along: DVec2) -> (u32, DVec3) {
    let mut triangle = start;
    let mut weights = tile_weights(place);
    // The change of the weights is linear in the step, and so is what unfolding into the next tile does to it.
    let mut rest = tile_weights(place + along) - weights;
    let mut entered_by = usize::MAX;
    for _ in 0..64 {
        let (share, exit) = way_out(weights, rest, entered_by);
        weights += rest * share;
        let Some(exit) = exit else { break };
        rest *= 1.0 - share;
        let next = texture.neighbours[triangle as usize][exit];
        let entry = side_of(texture, next, texture.triangles[triangle as usize][(exit + 1) % 3]);
        // c = a + b - c' for the apexes c, c' on the two sides of the edge a-b.
        let (wa, wb) = (weights[exit].max(0.0), weights[(exit + 1) % 3].max(0.0));
        let (ra, rb, rc) = (rest[exit], rest[(exit + 1) % 3], rest[(exit + 2) % 3]);
        weights = DVec3::ZERO;
        weights[entry] = wb;
        weights[(entry + 1) % 3] = wa;
        weights /= (wa + wb).max(f64::MIN_POSITIVE);
        rest[entry] = rb + rc;
        rest[(entry + 1) % 3] = ra + rc;
        rest[(entry + 2) % 3] = -rc;
        triangle = next;
        entered_by = entry;
    }
    let weights = weights.max(DVec3::ZERO);
    let [a, b, c] = texture.corners(triangle);
    (triangle, (a * weights.x + b * weights.y + c * weights.z).normalize())
}

#[cfg(test)]
mod tests {
    use super::{
        super::walk::{ChartedSurface, tests::sphere},
        *,
    };

    #[test]
    fn going_is_the_inverse_of_unfolding() {
        let texture = sphere(2);
        let from = DVec3::new(0.31, 0.52, 0.73).normalize();
        let start = texture.locate(0, from).face;
        let here = place_in_tile(&texture, start, from);
        for to in [DVec3::new(0.3, 0.55, 0.7), DVec3::new(0.5, 0.5, 0.7), DVec3::new(0.2, 0.4, 0.9)] {
            let place = unfold(&texture, start, from, to.normalize());
            let (triangle, direction) = go(&texture, start, here, place - here);
            assert!(direction.distance(to.normalize()) < 0.02, "{direction} for {to}");
            assert!(texture.contains(triangle, direction));
        }
    }

    #[test]
    fn bent_texture_edges_become_straight() {
        // A sphere's true chart, with every vertex pushed along the sphere by a wave shorter than a texture edge.
        let truth = sphere(5);
        let texture = sphere(1);
        let mut chart = truth.clone();
        for direction in &mut chart.directions {
            *direction = (*direction + DVec3::new(0.0, 0.03 * (16.0 * direction.x).sin(), 0.0)).normalize();
        }
        assert!(chart.is_positive());
        // How much longer the edges' paths are than straight ones.
        let excess = |chart: &SphereMesh| -> f64 {
            let surface = ChartedSurface { positions_m: &truth.directions, chart };
            let mut sum = 0.0;
            for triangle in &texture.triangles {
                let [from, to] = [triangle[0], triangle[1]].map(|v| texture.directions[v as usize]);
                let arc = surface.walk(chart.locate(0, from), from, to);
                sum += arc.length_m - arc.displacement_m.length();
            }
            sum
        };
        let before = excess(&chart);
        Straightener::new(&mut chart, &truth.directions).straighten(&texture, 0.7, 40);
        assert!(chart.is_positive());
        assert!(excess(&chart) < 0.3 * before, "{} of {before}", excess(&chart));
    }
}
