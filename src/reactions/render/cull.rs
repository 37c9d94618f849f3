//! Which skin triangles show anything of a reaction map: the others are not drawn.
//!
//! Most of an organ shows nothing most of the time. Each triangle knows which tiles of the map it lies on; those on tiles
//! in which nothing can be seen are left out of the layer's index buffer, which changes only when such tiles do.

use crate::organ::render::CornerVertex;
use crate::reactions::texels::{MapSize, TILE_PX, TileMask};
use std::f32::consts::PI;

/// The tiles under each triangle of an organ.
pub(super) struct TriangleTiles {
    /// First column, last column (both may lie beyond the map and wrap), first row, last row.
    ranges: Vec<[i32; 4]>,
    columns: i32,
}

impl TriangleTiles {
    /// For an organ's corners and indices, and a map of this size.
    pub fn new(corners: &[CornerVertex], indices: &[u32], is_planar: bool, size: MapSize) -> Self {
        let (columns, rows) = size.tiles();
        let ranges = indices.chunks_exact(3).map(|triangle| {
            let places = [triangle[0], triangle[1], triangle[2]].map(|index| corners[index as usize].chart_direction);
            let [left, right, top, bottom] = if is_planar { planar(places) } else { spherical(places) };
            // The texels beside are read as well, between texels.
            let column = |u: f32, px: f32| ((u * size.width_px as f32 + px) / TILE_PX as f32).floor() as i32;
            let row = |v: f32, px: f32| ((v * size.height_px as f32 + px) / TILE_PX as f32).floor() as i32;
            let last_row = rows as i32 - 1;
            let (first, last) = (row(top, -1.0).clamp(0, last_row), row(bottom, 1.0).clamp(0, last_row));
            [column(left, -1.0), column(right, 1.0), first, last]
        });
        Self { ranges: ranges.collect(), columns: columns as i32 }
    }

    /// The indices of the triangles that lie on marked tiles.
    pub fn visible(&self, indices: &[u32], seen: &TileMask) -> Vec<u32> {
        let is_seen = |&[left, right, top, bottom]: &[i32; 4]| {
            let width = (right - left + 1).min(self.columns);
            (top..=bottom).any(|row| {
                (left..left + width).any(|column| seen.is_marked(column.rem_euclid(self.columns) as u32, row as u32))
            })
        };
        let seen = indices.chunks_exact(3).zip(&self.ranges).filter(|(_, range)| is_seen(range));
        seen.flat_map(|(triangle, _)| triangle).copied().collect()
    }
}

/// Texture coordinates around a triangle on a planar chart: left, right, top, bottom.
fn planar(places: [[f32; 3]; 3]) -> [f32; 4] {
    let bound = |k: usize, pick: fn(f32, f32) -> f32| places.iter().map(|place| place[k]).reduce(pick).unwrap_or(0.0);
    [bound(0, f32::min), bound(0, f32::max), bound(1, f32::min), bound(1, f32::max)]
}

/// The same for directions on a sphere, with room for edges that bulge. `right` lies beyond 1 over the date line.
fn spherical(places: [[f32; 3]; 3]) -> [f32; 4] {
    let u = places.map(|[x, _, z]| x.atan2(z) / (2.0 * PI));
    let v = places.map(|[x, y, z]| x.hypot(z).atan2(y) / PI);
    // Turns that bring the others next to the first.
    let near = u.map(|turn| turn - (turn - u[0]).round());
    let (left, right) = (near[0].min(near[1]).min(near[2]), near[0].max(near[1]).max(near[2]));
    let (top, bottom) = (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]));
    // A great circle leaves the box of its ends by less than its length squared; near a pole longitude says little.
    let bulge = 2.0 * (bottom - top).max(right - left).powi(2) + 0.05 * (bottom - top);
    let (top, bottom) = (top - bulge, bottom + bulge);
    let reach = right - left;
    if reach > 0.25 || top < 0.02 || bottom > 0.98 {
        return [0.0, 1.0, if top < 0.1 { 0.0 } else { top }, if bottom > 0.9 { 1.0 } else { bottom }];
    }
    [left - 0.05 * reach, right + 0.05 * reach, top, bottom]
}
