//! Moving overlay vertices, one after the other, each down its own stretch energy.
//!
//! What moves: geometric vertices inside their tile, crossings along the tile's edge and along the geometric edge, and
//! texture vertices inside their face. The pieces never change their neighbours, and none flips on either side.

use super::{
    overlay::Cells,
    stretch::{Element, is_upright},
    tile_coords::{Freedom, TileMap, tile_corners, tile_weights},
};
use glam::{DVec2, DVec3};

/// Weight of even area against even shape.
const AREA_WEIGHT: f64 = 0.05;
/// Steps tried by each vertex in one sweep, each half the one before.
const LINE_SEARCH_STEPS: usize = 5;
/// First step on the surface, in texture edges; grows with success and shrinks with failure.
const FIRST_STEP: f64 = 0.05;

/// The overlay while its vertices move. Lengths are in texture edges.
pub(super) struct Relaxation {
    positions: Vec<DVec3>,
    elements: Vec<Option<Element>>,
    /// Unit normal of each sub-triangle's face.
    normals: Vec<DVec3>,
    /// Sub-triangles at each overlay vertex with the vertex's corner, and where each list begins.
    around: Vec<(u32, u8)>,
    starts: Vec<u32>,
    /// Overlay vertices of each sub-triangle.
    triangles: Vec<[u32; 3]>,
    rails: Vec<Rail>,
    /// Step on the surface of each vertex that has a rail.
    steps: Vec<f64>,
}

/// Where a vertex may go on the surface.
#[derive(Clone, Copy)]
enum Rail {
    Fixed,
    /// Along the geometric edge between two primary positions.
    Edge([DVec3; 2]),
    /// Anywhere in a face with these corners.
    Face([DVec3; 3]),
}

impl Relaxation {
    pub fn new(cells: &Cells, map: &TileMap, positions: Vec<DVec3>, positions_m: &[DVec3], edge_length_m: f64) -> Self {
        let triangles: Vec<[u32; 3]> =
            map.sub_triangles.iter().map(|t| t.map(|corner| map.corners[corner as usize].vertex)).collect();
        let mut starts = vec![0u32; cells.vertices.len() + 1];
        for &vertex in triangles.iter().flatten() {
            starts[vertex as usize + 1] += 1;
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        let mut fill = starts.clone();
        let mut around = vec![(0, 0); triangles.len() * 3];
        for (index, triangle) in triangles.iter().enumerate() {
            for (k, &vertex) in triangle.iter().enumerate() {
                around[fill[vertex as usize] as usize] = (index as u32, k as u8);
                fill[vertex as usize] += 1;
            }
        }
        let primary = |vertex: u32| positions_m[vertex as usize] / edge_length_m;
        let first_crossing = cells.geometric_vertices + cells.texture_vertices;
        let rails = cells
            .vertices
            .iter()
            .enumerate()
            .map(|(index, vertex)| {
                if index < cells.geometric_vertices || starts[index] == starts[index + 1] {
                    Rail::Fixed
                } else if index < first_crossing {
                    Rail::Face(vertex.primary.map(primary))
                } else {
                    Rail::Edge([primary(vertex.primary[0]), primary(vertex.primary[1])])
                }
            })
            .collect();
        let normals = map
            .faces
            .iter()
            .map(|&face| {
                let [a, b, c] = cells.faces[face as usize].map(primary);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        let elements = triangles
            .iter()
            .zip(&map.sub_triangles)
            .map(|(triangle, corners)| {
                let places = corners.map(|c| map.in_tile[c as usize]);
                Element::new(triangle.map(|v| positions[v as usize])).filter(|e| e.determinant(places) > 0.0)
            })
            .collect();
        let steps = vec![FIRST_STEP; positions.len()];
        Self { positions, elements, normals, around, starts, triangles, rails, steps }
    }

    fn star(&self, vertex: usize) -> std::ops::Range<usize> {
        self.starts[vertex] as usize..self.starts[vertex + 1] as usize
    }

    /// Runs all sweeps; returns the new weights of the vertices that moved on the surface.
    pub fn run(mut self, map: &mut TileMap, freedoms: &mut [Freedom], sweeps: u32) -> Vec<(u32, [f64; 3])> {
        for _ in 0..sweeps {
            for (vertex, freedom) in freedoms.iter_mut().enumerate() {
                self.move_in_tile(vertex, map, freedom);
                self.move_on_surface(vertex, map);
            }
        }
        if sweeps == 0 {
            return Vec::new();
        }
        self.rails
            .iter()
            .enumerate()
            .filter_map(|(vertex, rail)| {
                let position = self.positions[vertex];
                match *rail {
                    Rail::Fixed => None,
                    Rail::Edge([a, b]) => {
                        let share = ((position - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                        Some((vertex as u32, [1.0 - share, share, 0.0]))
                    }
                    Rail::Face([a, b, c]) => {
                        let normal = (b - a).cross(c - a);
                        let weights = DVec3::new(
                            (b - position).cross(c - position).dot(normal),
                            (c - position).cross(a - position).dot(normal),
                            (a - position).cross(b - position).dot(normal),
                        )
                        .max(DVec3::ZERO);
                        Some((vertex as u32, (weights / weights.element_sum().max(f64::MIN_POSITIVE)).to_array()))
                    }
                }
            })
            .collect()
    }

    /// Energy of the sub-triangles at a vertex.
    fn energy(&self, vertex: usize, map: &TileMap) -> f64 {
        self.around[self.star(vertex)]
            .iter()
            .filter_map(|&(t, _)| {
                let places = map.sub_triangles[t as usize].map(|c| map.in_tile[c as usize]);
                self.elements[t as usize].as_ref().map(|element| element.energy(places, AREA_WEIGHT))
            })
            .sum()
    }

    /// Energy as it would be with the vertex elsewhere on the surface; infinite where a sub-triangle would flip.
    fn energy_on_surface(&self, vertex: usize, position: DVec3, map: &TileMap) -> f64 {
        let mut sum = 0.0;
        for &(t, k) in &self.around[self.star(vertex)] {
            let t = t as usize;
            let mut corners = self.triangles[t].map(|v| self.positions[v as usize]);
            corners[k as usize] = position;
            if !is_upright(corners, self.normals[t]) {
                return f64::INFINITY;
            }
            if let Some(element) = Element::new(corners) {
                sum += element.energy(map.sub_triangles[t].map(|c| map.in_tile[c as usize]), AREA_WEIGHT);
            }
        }
        sum
    }

    fn move_in_tile(&self, vertex: usize, map: &mut TileMap, freedom: &mut Freedom) {
        let tile = tile_corners();
        match freedom {
            Freedom::Fixed => {}
            Freedom::Inside(corner) => {
                let corner = *corner as usize;
                let old = map.in_tile[corner];
                let before = self.energy(vertex, map);
                let (mut slope, mut stiffness) = (DVec2::ZERO, 0.0);
                for &(t, k) in &self.around[self.star(vertex)] {
                    if let Some(element) = &self.elements[t as usize] {
                        let places = map.sub_triangles[t as usize].map(|c| map.in_tile[c as usize]);
                        let (s, h) = element.slope(places, k as usize, AREA_WEIGHT);
                        slope += s;
                        stiffness += h;
                    }
                }
                let mut step = -slope / stiffness.max(f64::MIN_POSITIVE);
                for _ in 0..LINE_SEARCH_STEPS {
                    map.in_tile[corner] = old + step;
                    if tile_weights(old + step).min_element() > 0.0 && self.energy(vertex, map) < before {
                        return;
                    }
                    step *= 0.5;
                }
                map.in_tile[corner] = old;
            }
            Freedom::Along { corners, ends, share } => {
                let old = *share;
                let before = self.energy(vertex, map);
                let (mut along, mut stiffness) = (0.0, 0.0);
                for &(t, k) in &self.around[self.star(vertex)] {
                    if let Some(element) = &self.elements[t as usize] {
                        let sub_triangle = map.sub_triangles[t as usize];
                        let places = sub_triangle.map(|c| map.in_tile[c as usize]);
                        let (s, h) = element.slope(places, k as usize, AREA_WEIGHT);
                        let side = usize::from(sub_triangle[k as usize] != corners[0]);
                        along += s.dot(tile[ends[side][1]] - tile[ends[side][0]]);
                        stiffness += h;
                    }
                }
                let mut step = -along / stiffness.max(f64::MIN_POSITIVE);
                for trial in 0..=LINE_SEARCH_STEPS {
                    let new = if trial < LINE_SEARCH_STEPS { old + step } else { old };
                    for (&corner, &[from, to]) in corners.iter().zip(ends.iter()) {
                        if corner != u32::MAX {
                            map.in_tile[corner as usize] = tile[from].lerp(tile[to], new);
                        }
                    }
                    if new > 0.0 && new < 1.0 && self.energy(vertex, map) < before {
                        *share = new;
                        return;
                    }
                    step *= 0.5;
                }
            }
        }
    }

    fn move_on_surface(&mut self, vertex: usize, map: &TileMap) {
        let axes = match self.rails[vertex] {
            Rail::Fixed => return,
            Rail::Edge([a, b]) => [(b - a).normalize_or_zero(), DVec3::ZERO],
            Rail::Face([a, b, c]) => {
                let x = (b - a).normalize_or_zero();
                [x, (b - a).cross(c - a).cross(x).normalize_or_zero()]
            }
        };
        let old = self.positions[vertex];
        let mut best = (self.energy(vertex, map), old);
        let step = self.steps[vertex];
        for axis in axes.into_iter().filter(|axis| *axis != DVec3::ZERO) {
            for way in [step, -step] {
                let trial = best.1 + axis * way;
                let energy = self.energy_on_surface(vertex, trial, map);
                if energy < best.0 {
                    best = (energy, trial);
                    break;
                }
            }
        }
        if best.1 == old {
            self.steps[vertex] = 0.5 * step;
            return;
        }
        self.steps[vertex] = 1.5 * step;
        self.positions[vertex] = best.1;
        for index in self.star(vertex) {
            let t = self.around[index].0 as usize;
            self.elements[t] = Element::new(self.triangles[t].map(|v| self.positions[v as usize]));
        }
    }
}
