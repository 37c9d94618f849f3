//! Which vertices become one.

use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// For each vertex the first vertex at its place.
///
/// A vertex joins the nearest earlier one that stands for itself and is within the tolerance, so chains of close
/// vertices never collapse over more than it. The maps are only looked up in, never iterated. Vertices that no face
/// uses stay out of it: the tolerance comes from the others, and they may lie anywhere.
pub(super) fn weld_points(positions: &[Vec3], is_used: &[bool], tolerance: f64) -> Vec<u32> {
    let bits = |position: Vec3| (position + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut first_at: HashMap<[u32; 3], u32> = HashMap::new();
    // Cells of twice the tolerance: whatever is in reach lies in the eight cells round the nearest cell corner.
    let cell_size = 2.0 * tolerance;
    let mut newest_in_cell: HashMap<[i64; 3], u32> = HashMap::new();
    let mut older_in_cell = vec![u32::MAX; positions.len()];
    let mut kept = Vec::with_capacity(positions.len());
    for (vertex, &position) in positions.iter().enumerate() {
        let vertex = vertex as u32;
        if !is_used[vertex as usize] {
            kept.push(vertex);
            continue;
        }
        if let Some(&same) = first_at.get(&bits(position)) {
            kept.push(same);
            continue;
        }
        let place = position.as_dvec3() / cell_size;
        let corner = place.round();
        let mut nearest = (tolerance, vertex);
        for cell in 0..8u8 {
            let offset = DVec3::new(f64::from(cell & 1), f64::from(cell >> 1 & 1), f64::from(cell >> 2));
            let mut other = newest_in_cell.get(&(corner - offset).as_i64vec3().to_array()).copied().unwrap_or(u32::MAX);
            while other != u32::MAX {
                let distance = positions[other as usize].as_dvec3().distance(position.as_dvec3());
                if distance < nearest.0 || (distance == nearest.0 && other < nearest.1) {
                    nearest = (distance, other);
                }
                other = older_in_cell[other as usize];
            }
        }
        if nearest.1 == vertex {
            let newest = newest_in_cell.entry(place.floor().as_i64vec3().to_array()).or_insert(u32::MAX);
            older_in_cell[vertex as usize] = std::mem::replace(newest, vertex);
        }
        first_at.insert(bits(position), nearest.1);
        kept.push(nearest.1);
    }
    kept
}

/// For each vertex the first one at its place with the very same texture coordinates.
pub(super) fn weld_seams(point_of: &[u32], uvs: &[Vec2]) -> Vec<u32> {
    let mut first_at: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
    let key = |(&point, &uv): (&u32, &Vec2)| (point, (uv + Vec2::ZERO).to_array().map(f32::to_bits));
    let keys = point_of.iter().zip(uvs).map(key);
    keys.enumerate().map(|(vertex, key)| *first_at.entry(key).or_insert(vertex as u32)).collect()
}
