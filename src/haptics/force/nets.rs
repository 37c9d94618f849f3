//! The surface of voxels: one place in each cell that it passes, joined across the edges that it cuts.

use super::BoneBrick;
use glam::{UVec3, Vec3};

/// Halfway between empty and solid.
const LEVEL: f32 = 127.5;

/// Places in the world and triangles, counterclockwise seen from outside. At the sides of the box it is open.
pub(super) fn surface(brick: &BoneBrick) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let size = brick.size();
    let (mut places_m, mut triangles) = (Vec::new(), Vec::new());
    if size.min_element() < 2 {
        return (places_m, triangles);
    }
    let cells = size - 1;
    let cell_index = |cell: UVec3| ((cell.z * cells.y + cell.y) * cells.x + cell.x) as usize;
    let mut place_of = vec![u32::MAX; cells.as_u64vec3().element_product() as usize];
    let row = (size.x as usize, (size.x * size.y) as usize);
    let solid = brick.all_solid();
    let index = |voxel: UVec3| voxel.x as usize + voxel.y as usize * row.0 + voxel.z as usize * row.1;
    let corners = [0, 1, row.0, row.0 + 1].map(|at| [at, at + row.1]);
    let corners: [usize; 8] = std::array::from_fn(|corner| corners[corner & 3][corner >> 2]);
    for z in 0..cells.z {
        for y in 0..cells.y {
            for x in 0..cells.x {
                let cell = UVec3::new(x, y, z);
                let first = index(cell);
                if let Some(place) = crossing(cell, corners.map(|corner| solid[first + corner])) {
                    place_of[cell_index(cell)] = places_m.len() as u32;
                    places_m.push(brick.world_from_voxel().transform_point3(place.as_dvec3()).as_vec3());
                }
            }
        }
    }
    let is_mirrored = brick.world_from_voxel().matrix3.determinant() < 0.0;
    for z in 0..size.z {
        for y in 0..size.y {
            for x in 0..size.x {
                let voxel = UVec3::new(x, y, z);
                let first = index(voxel);
                let here = f32::from(solid[first]) > LEVEL;
                for axis in 0..3 {
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let other = voxel + UVec3::AXES[axis];
                    let is_within = other[axis] < size[axis]
                        && voxel[u] > 0
                        && voxel[v] > 0
                        && voxel[u] < size[u] - 1
                        && voxel[v] < size[v] - 1;
                    if !is_within || here == (f32::from(solid[first + [1, row.0, row.1][axis]]) > LEVEL) {
                        continue;
                    }
                    let around = [[1, 1], [0, 1], [0, 0], [1, 0]].map(|[less_u, less_v]| {
                        let cell = voxel - UVec3::AXES[u] * less_u - UVec3::AXES[v] * less_v;
                        place_of[cell_index(cell)]
                    });
                    let [a, b, c, d] =
                        if here != is_mirrored { around } else { [around[3], around[2], around[1], around[0]] };
                    triangles.push([a, b, c]);
                    triangles.push([a, c, d]);
                }
            }
        }
    }
    (places_m, triangles)
}

/// The mean of where the surface cuts the edges of a cell.
fn crossing(cell: UVec3, values: [u8; 8]) -> Option<Vec3> {
    let corner = |index: u32| UVec3::new(index & 1, index >> 1 & 1, index >> 2);
    let values = values.map(f32::from);
    let solid = values.iter().filter(|&&value| value > LEVEL).count();
    if solid == 0 || solid == 8 {
        return None;
    }
    let (mut sum, mut count) = (Vec3::ZERO, 0.0);
    for first in 0..8_u32 {
        for second in [1, 2, 4].map(|bit| first | bit).into_iter().filter(|&second| second != first) {
            let [from, to] = [values[first as usize], values[second as usize]];
            if (from > LEVEL) != (to > LEVEL) {
                let share = (LEVEL - from) / (to - from);
                sum += corner(first).as_vec3().lerp(corner(second).as_vec3(), share);
                count += 1.0;
            }
        }
    }
    Some(cell.as_vec3() + sum / count)
}
