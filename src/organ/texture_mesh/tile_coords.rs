//! Where every overlay vertex lies in its tile, chosen so that the tile is stretched as evenly as possible.
//!
//! A texture triangle's corners go to the tile's corners and its edges to the tile's edges; a crossing has one position
//! for both tiles of its edge, so neighbours agree to the last bit. Everything starts from the weights of the spherical
//! triangle, which never flip, and is then relaxed.

use super::{super::sphere::SphereMesh, overlay::Cells, tile_relax::Relaxation};
use bevy::reflect::Reflect;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A vertex for drawing: an overlay vertex as one texture triangle sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct OverlayCorner {
    /// The overlay vertex, which has the position.
    pub vertex: u32,
    /// The texture triangle, which chooses the tile.
    pub texture_triangle: u32,
    /// Weights of the tile's three corners, in the order of the texture triangle's vertices. They sum to one, and
    /// both sides of a texture edge have the same two weights on it.
    pub tile_barycentric: [f32; 3],
}

/// Sub-triangles with their corners in tiles.
#[derive(Clone, Debug)]
pub(super) struct TileMap {
    pub corners: Vec<OverlayCorner>,
    /// Positions of the corners in the plane of a tile with edges of length one.
    pub in_tile: Vec<DVec2>,
    /// Three corners per sub-triangle, ordered by texture triangle.
    pub sub_triangles: Vec<[u32; 3]>,
    /// Face of each sub-triangle.
    pub faces: Vec<u32>,
}

/// The tile's corners in its plane.
pub(super) fn tile_corners() -> [DVec2; 3] {
    [DVec2::ZERO, DVec2::X, DVec2::new(0.5, 0.75f64.sqrt())]
}

/// Weights of a place in the tile.
pub(super) fn tile_weights(place: DVec2) -> DVec3 {
    let y = place.y / 0.75f64.sqrt();
    let x = place.x - 0.5 * y;
    DVec3::new(1.0 - x - y, x, y)
}

/// How an overlay vertex may move in its tiles.
#[derive(Clone, Copy)]
pub(super) enum Freedom {
    Fixed,
    /// Anywhere in the tile of this corner.
    Inside(u32),
    /// Along an edge: one corner on each side (the second absent on a border), each with the edge's two ends, and the
    /// share of the way from the first end.
    Along {
        corners: [u32; 2],
        ends: [[usize; 2]; 2],
        share: f64,
    },
}

/// Cuts the cells into triangles and gives every corner its place in the tile.
///
/// Crossings and texture vertices also move on the surface, within their edge or face, so `cells.vertices` changes.
pub(super) fn map_tiles(
    cells: &mut Cells,
    texture: &SphereMesh,
    positions_m: &[DVec3],
    edge_length_m: f64,
    sweeps: u32,
) -> TileMap {
    let positions: Vec<DVec3> = cells.vertices.iter().map(|v| v.position_m(positions_m) / edge_length_m).collect();
    let (mut map, mut freedoms) = start(cells, texture, &positions);
    let moved =
        Relaxation::new(cells, &map, positions, positions_m, edge_length_m).run(&mut map, &mut freedoms, sweeps);
    for (vertex, weights) in moved {
        cells.vertices[vertex as usize].weights = weights.map(|w| w as f32);
        let texture_vertex = (vertex as usize).wrapping_sub(cells.geometric_vertices);
        if let Some(point) = cells.texture_points.get_mut(texture_vertex) {
            point.barycentric = DVec3::from_array(weights);
        }
    }
    for (corner, place) in map.corners.iter_mut().zip(&map.in_tile) {
        corner.tile_barycentric = tile_weights(*place).as_vec3().to_array();
    }
    // On corners and edges the weights are written out, so that both sides of an edge have the same bits.
    for freedom in &freedoms {
        if let Freedom::Along { corners, ends, share } = *freedom {
            for (corner, [from, to]) in corners.into_iter().zip(ends) {
                if corner != u32::MAX {
                    let weights = &mut map.corners[corner as usize].tile_barycentric;
                    *weights = [0.0; 3];
                    weights[from] = (1.0 - share) as f32;
                    weights[to] = share as f32;
                }
            }
        }
    }
    for corner in &mut map.corners {
        let texture_vertex = (corner.vertex as usize).wrapping_sub(cells.geometric_vertices);
        if texture_vertex < cells.texture_vertices {
            let triangle = texture.triangles[corner.texture_triangle as usize];
            corner.tile_barycentric = triangle.map(|v| if v as usize == texture_vertex { 1.0 } else { 0.0 });
        }
    }
    map
}

/// Corners, sub-triangles and the start of the relaxation: weights of the spherical triangles.
fn start(cells: &Cells, texture: &SphereMesh, positions: &[DVec3]) -> (TileMap, Vec<Freedom>) {
    let first_texture = cells.geometric_vertices;
    let first_crossing = first_texture + cells.texture_vertices;
    let tile = tile_corners();
    let mut freedoms = vec![Freedom::Fixed; cells.vertices.len()];
    let mut corner_of = vec![(u32::MAX, 0u32); cells.vertices.len()];
    let mut map = TileMap { corners: Vec::new(), in_tile: Vec::new(), sub_triangles: Vec::new(), faces: Vec::new() };
    for cell in &cells.cells {
        let triangle = texture.triangles[cell.texture_triangle as usize];
        let [a, b, c] = triangle.map(|v| cells.directions[first_texture + v as usize]);
        let mut polygon = [0u32; 6];
        for (slot, &vertex) in polygon.iter_mut().zip(cell.polygon()) {
            if corner_of[vertex as usize].0 != cell.texture_triangle {
                let corner = map.corners.len() as u32;
                corner_of[vertex as usize] = (cell.texture_triangle, corner);
                let d = cells.directions[vertex as usize];
                let mut weights =
                    DVec3::new((b - d).cross(c - d).dot(d), (c - d).cross(a - d).dot(d), (a - d).cross(b - d).dot(d))
                        .max(DVec3::ZERO);
                if vertex as usize >= first_crossing {
                    let edge = cells.crossed_edges[vertex as usize - first_crossing];
                    let apex = (0..3).find(|&k| !edge.contains(&triangle[k])).unwrap_or(0);
                    weights[apex] = 0.0;
                    let mut ends = [(apex + 1) % 3, (apex + 2) % 3];
                    if triangle[ends[0]] > triangle[ends[1]] {
                        ends.swap(0, 1);
                    }
                    match &mut freedoms[vertex as usize] {
                        Freedom::Along { corners, ends: both, share } => {
                            corners[1] = corner;
                            both[1] = ends;
                            weights[ends[0]] = 1.0 - *share;
                            weights[ends[1]] = *share;
                        }
                        freedom => {
                            let share = weights[ends[1]] / weights.element_sum().max(f64::MIN_POSITIVE);
                            *freedom = Freedom::Along { corners: [corner, u32::MAX], ends: [ends; 2], share };
                        }
                    }
                } else if (vertex as usize) < first_texture {
                    freedoms[vertex as usize] = Freedom::Inside(corner);
                }
                weights /= weights.element_sum().max(f64::MIN_POSITIVE);
                map.in_tile.push(tile[0] * weights.x + tile[1] * weights.y + tile[2] * weights.z);
                map.corners.push(OverlayCorner {
                    vertex,
                    texture_triangle: cell.texture_triangle,
                    tile_barycentric: [0.0; 3],
                });
            }
            *slot = corner_of[vertex as usize].1;
        }
        let apex = best_fan(cell.polygon(), positions);
        for k in 1..cell.len - 1 {
            map.sub_triangles.push([apex, (apex + k) % cell.len, (apex + k + 1) % cell.len].map(|i| polygon[i]));
            map.faces.push(cell.face);
        }
    }
    (map, freedoms)
}

/// The corner of a convex polygon from which a fan has the largest smallest triangle (relative to its longest side).
fn best_fan(polygon: &[u32], positions: &[DVec3]) -> usize {
    let at = |i: usize| positions[polygon[i % polygon.len()] as usize];
    let worst = |apex: usize| {
        (1..polygon.len() - 1)
            .map(|k| {
                let (a, b, c) = (at(apex), at(apex + k), at(apex + k + 1));
                let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
                (b - a).cross(c - a).length() / longest.max(f64::MIN_POSITIVE)
            })
            .fold(f64::INFINITY, f64::min)
    };
    if polygon.len() <= 3 {
        return 0;
    }
    let scores: Vec<f64> = (0..polygon.len()).map(worst).collect();
    (0..polygon.len()).max_by(|&i, &j| scores[i].total_cmp(&scores[j]).then(j.cmp(&i))).unwrap_or(0)
}
