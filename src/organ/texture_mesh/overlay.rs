//! The texture triangulation laid over the geometric mesh: every piece belongs to one triangle of each.
//!
//! Faces and texture triangles are cones over directions, hence convex; the piece that two of them share is a convex
//! polygon whose corners are vertices of the one inside the other, and crossings of edges. Which of these exist follows
//! from exact signs ([`GridDirections`]), so neighbouring pieces always agree, and no corner is made twice.

use super::{
    super::{
        mesh::NO_FACE,
        sphere::{SphereMesh, SurfacePoint},
    },
    TextureMeshError,
    predicates::GridDirections,
};
use bevy::reflect::Reflect;
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use serde::{Deserialize, Serialize};

/// A secondary vertex: a fixed combination of one to three primary vertices.
///
/// Unused places repeat the first primary vertex with weight zero. The weights sum to one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct OverlayVertex {
    /// Primary vertices: corners of one face.
    pub primary: [u32; 3],
    /// Weight of each, in `[0, 1]`.
    pub weights: [f32; 3],
}

/// The piece of a geometric face inside a texture triangle: a convex polygon of overlay vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    pub texture_triangle: u32,
    pub face: u32,
    pub vertices: [u32; 6],
    pub len: usize,
}

impl Cell {
    pub fn polygon(&self) -> &[u32] {
        &self.vertices[..self.len]
    }
}

/// All pieces, and the vertices they share.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cells {
    /// Geometric vertices first, then texture vertices, then crossings.
    pub vertices: Vec<OverlayVertex>,
    /// Direction of each overlay vertex, in grid steps for primary and texture vertices; any positive scale.
    pub directions: Vec<DVec3>,
    /// Ordered by texture triangle, then face.
    pub cells: Vec<Cell>,
    /// Primary vertices of the geometric faces.
    pub faces: Vec<[u32; 3]>,
    pub geometric_vertices: usize,
    pub texture_vertices: usize,
    /// The ends of the texture edge that each crossing lies on.
    pub crossed_edges: Vec<[u32; 2]>,
    /// Where each texture vertex lies on the surface; face [`NO_FACE`] where it lies off an open surface.
    pub texture_points: Vec<SurfacePoint>,
}

/// How often three directions may fall on one great circle before giving up.
const NUDGES: u64 = 16;

/// Lays a texture triangulation over a chart. Both must be positive; the texture triangulation must cover all faces.
pub(super) fn overlay(chart: &SphereMesh, texture: &SphereMesh) -> Result<Cells, TextureMeshError> {
    let geometry = GridDirections::new(&chart.directions)?;
    if !geometry.all_positive(chart) {
        return Err(TextureMeshError::InvalidChart);
    }
    let exact = GridDirections::new(&texture.directions)?;
    for attempt in 0..NUDGES {
        // Every coincidence involves a texture vertex, so moving those by a few steps resolves them all.
        let mut nudged = exact.clone();
        if attempt > 0 {
            let mut random = Pcg32::seed_from_u64(attempt);
            let reach = 1i32 << (2 * attempt).min(20);
            for direction in &mut nudged.0 {
                *direction +=
                    DVec3::from_array(std::array::from_fn(|_| f64::from(random.random_range(-reach..=reach))));
            }
        }
        if !nudged.all_positive(texture) {
            return Err(TextureMeshError::InvalidTexture);
        }
        let pair = Pair { chart, texture, geometry: &geometry.0, lattice: &nudged.0 };
        match pair.lay() {
            Ok(cells) => return Ok(cells),
            Err(Failure::Coincidence) => {}
            Err(Failure::Uncovered) => return Err(TextureMeshError::InvalidTexture),
        }
    }
    Err(TextureMeshError::InvalidTexture)
}

enum Failure {
    /// Three directions lie exactly on one great circle.
    Coincidence,
    /// A face's corner lies in no texture triangle.
    Uncovered,
}

struct Pair<'a> {
    chart: &'a SphereMesh,
    texture: &'a SphereMesh,
    geometry: &'a [DVec3],
    lattice: &'a [DVec3],
}

/// A corner of a cell before the crossings are numbered.
#[derive(Clone, Copy)]
enum Corner {
    Geometric(u32),
    Texture(u32),
    /// The texture edge and the geometric edge that cross.
    Crossing(u64),
}

impl Pair<'_> {
    fn side(&self, a: DVec3, b: DVec3, c: DVec3) -> Result<bool, Failure> {
        match GridDirections::orientation(a, b, c) {
            0 => Err(Failure::Coincidence),
            sign => Ok(sign > 0),
        }
    }

    /// The texture triangle over a direction, by walking.
    fn locate(&self, start: u32, direction: DVec3) -> Result<u32, Failure> {
        let mut face = start;
        for turn in 0..2 * self.texture.triangles.len() + 8 {
            let corners = self.texture.triangles[face as usize].map(|v| self.lattice[v as usize]);
            let mut way_out = None;
            let mut blocked = false;
            for k in (0..3).map(|k| (k + turn) % 3) {
                if !self.side(corners[k], corners[(k + 1) % 3], direction)? {
                    blocked = true;
                    let next = self.texture.neighbours[face as usize][k];
                    if next != NO_FACE {
                        way_out = Some(next);
                        break;
                    }
                }
            }
            match way_out {
                Some(next) => face = next,
                None if blocked => return Err(Failure::Uncovered),
                None => return Ok(face),
            }
        }
        Err(Failure::Uncovered)
    }

    fn lay(&self) -> Result<Cells, Failure> {
        let geometric_edges = edge_numbers(&self.chart.neighbours);
        let texture_edges = edge_numbers(&self.texture.neighbours);
        let mut cells: Vec<(u32, u32, Vec<Corner>)> = Vec::new();
        let mut texture_points =
            vec![SurfacePoint { face: NO_FACE, barycentric: DVec3::ZERO }; self.texture.directions.len()];
        let mut seen = vec![u32::MAX; self.texture.triangles.len()];
        let mut open = Vec::new();
        let mut near = 0;
        for face in 0..self.chart.triangles.len() as u32 {
            near = self.locate(near, self.geometry[self.chart.triangles[face as usize][0] as usize])?;
            open.push(near);
            seen[near as usize] = face;
            while let Some(triangle) = open.pop() {
                let (polygon, crossed) = self.clip(face, triangle, &geometric_edges, &texture_edges)?;
                for &corner in &polygon {
                    if let Corner::Texture(vertex) = corner {
                        texture_points[vertex as usize].face = face;
                    }
                }
                for (next, _) in self.texture.neighbours[triangle as usize].into_iter().zip(crossed).filter(|n| n.1) {
                    if next == NO_FACE {
                        return Err(Failure::Uncovered);
                    }
                    if seen[next as usize] != face {
                        seen[next as usize] = face;
                        open.push(next);
                    }
                }
                if polygon.len() >= 3 {
                    cells.push((triangle, face, polygon));
                }
            }
        }
        cells.sort_unstable_by_key(|&(triangle, face, _)| (triangle, face));
        for (vertex, point) in texture_points.iter_mut().enumerate() {
            if point.face != NO_FACE {
                point.barycentric = self.weights(point.face, self.lattice[vertex]);
            }
        }
        Ok(self.number(&cells, texture_points))
    }

    /// Weights of a direction on a face that contains it.
    fn weights(&self, face: u32, direction: DVec3) -> DVec3 {
        let [a, b, c] = self.chart.triangles[face as usize].map(|v| self.geometry[v as usize]);
        // Differences first: the cross products of nearly equal directions would cancel.
        let weights = DVec3::new(
            (b - direction).cross(c - direction).dot(direction),
            (c - direction).cross(a - direction).dot(direction),
            (a - direction).cross(b - direction).dot(direction),
        )
        .max(DVec3::ZERO);
        weights / weights.element_sum().max(f64::MIN_POSITIVE)
    }

    /// The polygon that a face and a texture triangle share, counter-clockwise, and which of the texture triangle's
    /// sides the face reaches across.
    fn clip(
        &self,
        face: u32,
        triangle: u32,
        geometric_edges: &[[u32; 3]],
        texture_edges: &[[u32; 3]],
    ) -> Result<(Vec<Corner>, [bool; 3]), Failure> {
        let g_ids = self.chart.triangles[face as usize];
        let t_ids = self.texture.triangles[triangle as usize];
        let g = g_ids.map(|v| self.geometry[v as usize]);
        let t = t_ids.map(|v| self.lattice[v as usize]);
        // g_in[k][i]: corner i of the face is on the inner side of the texture triangle's side k; t_in likewise.
        let mut g_in = [[false; 3]; 3];
        let mut t_in = [[false; 3]; 3];
        for k in 0..3 {
            for i in 0..3 {
                g_in[k][i] = self.side(t[k], t[(k + 1) % 3], g[i])?;
                t_in[k][i] = self.side(g[k], g[(k + 1) % 3], t[i])?;
            }
        }
        let g_inside: [bool; 3] = std::array::from_fn(|i| (0..3).all(|k| g_in[k][i]));
        let t_inside: [bool; 3] = std::array::from_fn(|i| (0..3).all(|k| t_in[k][i]));
        let crossing = |i: usize, k: usize| {
            Corner::Crossing(
                u64::from(texture_edges[triangle as usize][k]) << 32 | u64::from(geometric_edges[face as usize][i]),
            )
        };

        let mut polygon = Vec::with_capacity(6);
        // The side of the texture triangle along which the boundary runs since the face's last way out.
        let mut out_by: Option<usize> = None;
        let mut first_in: Option<usize> = None;
        let mut crossed = [false; 3];
        let follow = |polygon: &mut Vec<Corner>, from: usize, to: usize| {
            let mut k = from;
            while k != to {
                k = (k + 1) % 3;
                polygon.push(Corner::Texture(t_ids[k]));
            }
        };
        for i in 0..3 {
            let j = (i + 1) % 3;
            // Inward: from outside side k to its inner side. The arcs meet, rather than an arc and the other's
            // antipode, if the texture side's ends lie on the proper sides of the face's edge.
            let way_in = (0..3).find(|&k| !g_in[k][i] && g_in[k][j] && t_in[i][k] && !t_in[i][(k + 1) % 3]);
            let way_out = (0..3).find(|&k| g_in[k][i] && !g_in[k][j] && !t_in[i][k] && t_in[i][(k + 1) % 3]);
            if let Some(k) = way_in {
                crossed[k] = true;
                match out_by.take() {
                    Some(out) => follow(&mut polygon, out, k),
                    None => first_in = Some(k),
                }
                polygon.push(crossing(i, k));
            } else if g_inside[i] {
                polygon.push(Corner::Geometric(g_ids[i]));
            }
            if let Some(k) = way_out {
                crossed[k] = true;
                polygon.push(crossing(i, k));
                out_by = Some(k);
            }
        }
        if let (Some(out), Some(into)) = (out_by, first_in) {
            follow(&mut polygon, out, into);
        }
        if polygon.is_empty() && t_inside.iter().all(|&inside| inside) {
            polygon.extend(t_ids.map(Corner::Texture));
        }
        for k in 0..3 {
            // Around a texture vertex inside the face, the face reaches into every triangle.
            crossed[k] |= t_inside[k] || t_inside[(k + 1) % 3];
        }
        Ok((polygon, crossed))
    }

    /// Numbers the crossings and finds every vertex's weights.
    fn number(&self, cells: &[(u32, u32, Vec<Corner>)], texture_points: Vec<SurfacePoint>) -> Cells {
        let mut crossings: Vec<u64> = cells
            .iter()
            .flat_map(|(_, _, polygon)| polygon)
            .filter_map(|corner| match corner {
                Corner::Crossing(key) => Some(*key),
                _ => None,
            })
            .collect();
        crossings.sort_unstable();
        crossings.dedup();
        let geometric_vertices = self.geometry.len();
        let texture_vertices = self.lattice.len();
        let texture_ends = edge_ends(self.texture);
        let geometric_ends = edge_ends(self.chart);

        let mut vertices = Vec::with_capacity(geometric_vertices + texture_vertices + crossings.len());
        let mut directions = Vec::with_capacity(vertices.capacity());
        for (vertex, &direction) in self.geometry.iter().enumerate() {
            vertices.push(OverlayVertex { primary: [vertex as u32; 3], weights: [1.0, 0.0, 0.0] });
            directions.push(direction);
        }
        for (point, &direction) in texture_points.iter().zip(self.lattice) {
            vertices.push(match self.chart.triangles.get(point.face as usize) {
                Some(&primary) => OverlayVertex { primary, weights: point.barycentric.as_vec3().to_array() },
                None => OverlayVertex::default(),
            });
            directions.push(direction);
        }
        let crossed_edges: Vec<[u32; 2]> = crossings.iter().map(|key| texture_ends[(key >> 32) as usize]).collect();
        for (&key, edge) in crossings.iter().zip(&crossed_edges) {
            let [a, b] = edge.map(|v| self.lattice[v as usize]);
            let ends = geometric_ends[key as u32 as usize];
            let [p, q] = ends.map(|v| self.geometry[v as usize]);
            let plane = (b - a).cross(a);
            let (from_p, from_q) = (plane.dot(p - a).abs(), plane.dot(q - a).abs());
            let share_q = from_p / (from_p + from_q).max(f64::MIN_POSITIVE);
            directions.push(p.lerp(q, share_q));
            vertices.push(OverlayVertex {
                primary: [ends[0], ends[1], ends[0]],
                weights: [(1.0 - share_q) as f32, share_q as f32, 0.0],
            });
        }
        let number_of = |corner: &Corner| match corner {
            Corner::Geometric(vertex) => *vertex,
            Corner::Texture(vertex) => geometric_vertices as u32 + vertex,
            Corner::Crossing(key) => {
                (geometric_vertices + texture_vertices + crossings.partition_point(|k| k < key)) as u32
            }
        };
        let cells = cells
            .iter()
            .map(|(texture_triangle, face, polygon)| {
                let mut vertices = [0; 6];
                let len = polygon.len().min(6);
                for (vertex, corner) in vertices.iter_mut().zip(polygon) {
                    *vertex = number_of(corner);
                }
                Cell { texture_triangle: *texture_triangle, face: *face, vertices, len }
            })
            .collect();
        Cells {
            vertices,
            directions,
            cells,
            faces: self.chart.triangles.clone(),
            geometric_vertices,
            texture_vertices,
            crossed_edges,
            texture_points,
        }
    }
}

/// A number for every edge, the same from both sides: three times its first face plus the side there.
fn edge_numbers(neighbours: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut numbers = vec![[u32::MAX; 3]; neighbours.len()];
    for face in 0..neighbours.len() {
        for side in 0..3 {
            let other = neighbours[face][side];
            numbers[face][side] = (3 * face + side) as u32;
            if other != NO_FACE && (other as usize) < face {
                // Two faces may share two edges only on a two-faced mesh, which no chart has.
                if let Some(k) = neighbours[other as usize].iter().position(|&n| n as usize == face) {
                    numbers[face][side] = 3 * other + k as u32;
                }
            }
        }
    }
    numbers
}

/// Ends of the edges that [`edge_numbers`] numbers.
fn edge_ends(mesh: &SphereMesh) -> Vec<[u32; 2]> {
    mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect()
}
