//! How regular a texture mesh is and how evenly its tiles lie on the surface.

use super::{
    super::{mesh::NO_FACE, sphere::SphereMesh},
    tile_coords::{TileMap, tile_corners},
};
use bevy::reflect::Reflect;
use glam::{DMat2, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// What a texture mesh turned out like. Angles and edges are those of the texture triangles measured along the
/// surface; stretch is that of the map from an equilateral tile (with the asked edge length) to the surface, weighted
/// by area over the whole organ.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct TextureMeshReport {
    /// Texture triangles on the organ.
    pub triangles: u32,
    /// Mean over the texture triangles of their smallest angle, degrees (60 is perfect).
    pub min_angle_mean_deg: f32,
    /// Smallest angle that one in a hundred texture triangles undercuts, degrees.
    pub min_angle_p1_deg: f32,
    /// Smallest angle of all, degrees.
    pub min_angle_worst_deg: f32,
    /// Mean edge length along the surface, metres.
    pub edge_length_mean_m: f32,
    /// Standard deviation of the edge lengths, metres.
    pub edge_length_std_m: f32,
    /// Shortest edge, metres.
    pub edge_length_min_m: f32,
    /// Longest edge, metres.
    pub edge_length_max_m: f32,
    /// How many texture vertices have 0, 1, ... edges; the last place counts eleven and more. Only vertices away
    /// from a border.
    pub valence_counts: [u32; 12],
    /// Mean ratio of the larger to the smaller singular value of the map from tile to surface.
    pub anisotropy_mean: f32,
    /// Anisotropy that one hundredth of the surface exceeds.
    pub anisotropy_p99: f32,
    /// Largest anisotropy of sub-triangles that are large enough to be seen.
    pub anisotropy_max: f32,
    /// Area on the surface per area of tile that one hundredth of the surface undercuts.
    pub area_scale_p1: f32,
    /// Area on the surface per area of tile that one hundredth of the surface exceeds.
    pub area_scale_p99: f32,
    /// Overlay vertices, geometric ones included.
    pub overlay_vertices: u32,
    /// Sub-triangles to draw.
    pub overlay_triangles: u32,
}

/// Sub-triangles below this share of a tile's area are left out of the largest anisotropy: rounding shapes them.
const SMALLEST_SEEN: f64 = 1e-6;

impl TextureMeshReport {
    /// Measures a finished overlay. `corner_positions_m` are those of the map's corners.
    pub(super) fn measure(
        texture: &SphereMesh,
        map: &TileMap,
        corner_positions_m: &[DVec3],
        overlay_vertices: usize,
        edge_length_m: f64,
    ) -> Self {
        let mut report = Self {
            overlay_vertices: overlay_vertices as u32,
            overlay_triangles: map.sub_triangles.len() as u32,
            ..Self::default()
        };
        report.measure_triangles(texture, &side_lengths_m(texture, map, corner_positions_m, edge_length_m));
        report.measure_stretch(map, corner_positions_m, edge_length_m);
        report
    }

    /// Angles, edges and valences from the side lengths of the texture triangles.
    fn measure_triangles(&mut self, texture: &SphereMesh, lengths_m: &[[f64; 3]]) {
        let mut angles: Vec<f64> = Vec::with_capacity(lengths_m.len());
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0u32);
        let (mut shortest, mut longest) = (f64::INFINITY, 0.0f64);
        let mut valences = vec![0usize; texture.directions.len()];
        let mut on_border = vec![false; texture.directions.len()];
        for (face, (triangle, lengths)) in texture.triangles.iter().zip(lengths_m).enumerate() {
            let cosine = |k: usize| {
                let (opposite, p, q) = (lengths[k], lengths[(k + 1) % 3], lengths[(k + 2) % 3]);
                ((p * p + q * q - opposite * opposite) / (2.0 * p * q).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0)
            };
            angles.push((0..3).map(|k| cosine(k).acos()).fold(f64::INFINITY, f64::min).to_degrees());
            for side in 0..3 {
                let (a, b) = (triangle[side] as usize, triangle[(side + 1) % 3] as usize);
                valences[a] += 1;
                let border = texture.neighbours[face][side] == NO_FACE;
                on_border[a] |= border;
                on_border[b] |= border;
                if a < b || border {
                    sum += lengths[side];
                    square += lengths[side] * lengths[side];
                    count += 1;
                    shortest = shortest.min(lengths[side]);
                    longest = longest.max(lengths[side]);
                }
            }
        }
        angles.sort_unstable_by(f64::total_cmp);
        let mean = sum / f64::from(count.max(1));
        self.triangles = texture.triangles.len() as u32;
        self.min_angle_mean_deg = (angles.iter().sum::<f64>() / angles.len().max(1) as f64) as f32;
        self.min_angle_p1_deg = angles.get(angles.len() / 100).copied().unwrap_or(0.0) as f32;
        self.min_angle_worst_deg = angles.first().copied().unwrap_or(0.0) as f32;
        self.edge_length_mean_m = mean as f32;
        self.edge_length_std_m = (square / f64::from(count.max(1)) - mean * mean).max(0.0).sqrt() as f32;
        self.edge_length_min_m = shortest as f32;
        self.edge_length_max_m = longest as f32;
        for (valence, _) in valences.iter().zip(&on_border).filter(|(valence, border)| **valence > 0 && !**border) {
            self.valence_counts[(*valence).min(11)] += 1;
        }
    }

    /// Stretch of the map from the tiles to the surface.
    fn measure_stretch(&mut self, map: &TileMap, corner_positions_m: &[DVec3], edge_length_m: f64) {
        let tile_area = 0.5 * 0.75f64.sqrt();
        let mut stretches: Vec<(f64, f64, f64)> = Vec::with_capacity(map.sub_triangles.len());
        for triangle in &map.sub_triangles {
            let corners = triangle.map(|c| corner_positions_m[c as usize] / edge_length_m);
            let places = triangle.map(|c| place(map.corners[c as usize].tile_barycentric));
            if let Some((large, small, area)) = singular_values(places, corners) {
                stretches.push((large / small, large * small, area));
            }
        }
        let total: f64 = stretches.iter().map(|s| s.2).sum();
        let quantile = |sorted: &[(f64, f64)], share: f64| {
            let mut below = 0.0;
            sorted
                .iter()
                .find(|(_, area)| {
                    below += area;
                    below >= share * total
                })
                .map_or(0.0, |(value, _)| *value) as f32
        };
        let mut anisotropies: Vec<(f64, f64)> = stretches.iter().map(|s| (s.0, s.2)).collect();
        anisotropies.sort_unstable_by(|x, y| x.0.total_cmp(&y.0));
        let mut scales: Vec<(f64, f64)> = stretches.iter().map(|s| (s.1, s.2)).collect();
        scales.sort_unstable_by(|x, y| x.0.total_cmp(&y.0));
        self.anisotropy_mean =
            (anisotropies.iter().map(|(a, area)| a * area).sum::<f64>() / total.max(f64::MIN_POSITIVE)) as f32;
        self.anisotropy_p99 = quantile(&anisotropies, 0.99);
        self.anisotropy_max =
            anisotropies.iter().filter(|s| s.1 > SMALLEST_SEEN * tile_area).map(|s| s.0).fold(0.0, f64::max) as f32;
        self.area_scale_p1 = quantile(&scales, 0.01);
        self.area_scale_p99 = quantile(&scales, 0.99);
    }
}

/// Lengths of the sides of the texture triangles along the surface. Of a side that leaves an open organ only a part
/// lies on it; the part's length is extended to the whole.
fn side_lengths_m(
    texture: &SphereMesh,
    map: &TileMap,
    corner_positions_m: &[DVec3],
    edge_length_m: f64,
) -> Vec<[f64; 3]> {
    // Length found of each side, and the share of the tile's side that this covers.
    let mut found = vec![[(0.0, 0.0); 3]; texture.triangles.len()];
    for triangle in &map.sub_triangles {
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let ends = [triangle[from] as usize, triangle[to] as usize];
            let [p, q] = ends.map(|c| map.corners[c].tile_barycentric);
            // A side runs where the weight of the corner across from it vanishes.
            if let Some(apex) = (0..3).find(|&k| p[k] == 0.0 && q[k] == 0.0) {
                let side = (apex + 1) % 3;
                let (length, share) = &mut found[map.corners[ends[0]].texture_triangle as usize][side];
                *length += corner_positions_m[ends[0]].distance(corner_positions_m[ends[1]]);
                *share += f64::from((p[side] - q[side]).abs());
            }
        }
    }
    found
        .iter()
        .map(|sides| sides.map(|(length, share)| if share > 0.0 { length / share } else { edge_length_m }))
        .collect()
}

/// A place in the tile from its weights.
fn place(weights: [f32; 3]) -> DVec2 {
    let tile = tile_corners();
    (0..3).map(|k| tile[k] * f64::from(weights[k])).sum()
}

/// Larger and smaller singular value of the affine map from a triangle in the tile to one in space, and the area of the
/// latter; `None` where either has no area. A flipped triangle counts with a smaller value of almost nothing.
fn singular_values(places: [DVec2; 3], [a, b, c]: [DVec3; 3]) -> Option<(f64, f64, f64)> {
    let x = (b - a).normalize_or_zero();
    let normal = (b - a).cross(c - a);
    let y = normal.cross(x).normalize_or_zero();
    let twice_area = normal.length();
    let tile_edges = DMat2::from_cols(places[1] - places[0], places[2] - places[0]);
    if twice_area <= 0.0 || tile_edges.determinant() == 0.0 {
        return None;
    }
    let edges = DMat2::from_cols(DVec2::new((b - a).dot(x), 0.0), DVec2::new((c - a).dot(x), (c - a).dot(y)));
    let map = edges * tile_edges.inverse();
    let square = map.x_axis.length_squared() + map.y_axis.length_squared();
    let determinant = map.determinant();
    let sum = (square + 2.0 * determinant.abs()).sqrt();
    let difference = (square - 2.0 * determinant.abs()).max(0.0).sqrt();
    let (large, small) = (0.5 * (sum + difference), 0.5 * (sum - difference));
    let small = if determinant > 0.0 { small } else { 0.0 };
    Some((large, small.max(large * 1e-9), 0.5 * twice_area))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretch_of_known_maps() {
        let tile = tile_corners();
        let stretched = tile.map(|p| DVec3::new(3.0 * p.x, 0.5 * p.y, 0.0));
        let (large, small, area) = singular_values(tile, stretched).unwrap();
        assert!((large - 3.0).abs() < 1e-12 && (small - 0.5).abs() < 1e-12);
        assert!((area - 1.5 * 0.5 * 0.75f64.sqrt()).abs() < 1e-12);
        // A turned and scaled tile has no anisotropy, wherever it lies in space.
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -2.0);
        let turned = tile.map(|p| turn * (p.extend(0.0) * 0.02) + DVec3::new(5.0, 1.0, 2.0));
        let (large, small, _) = singular_values(tile, turned).unwrap();
        assert!((large - 0.02).abs() < 1e-12 && (small - 0.02).abs() < 1e-12);
        // A mirrored triangle is as bad as can be.
        let (large, small, _) = singular_values([tile[0], tile[2], tile[1]], turned).unwrap();
        assert!(large / small > 1e6);
    }
}
