//! Painting disks into reaction maps, and bringing back what was under them.
//!
//! Each step, tiles in which something changed are marked; [`restore`] brings the permanent effects back there and
//! [`paint`] draws all active sprites over them, clipped to the marked tiles. A texel outside the marked tiles keeps what
//! it has, so both together leave what painting the whole map would (Neyret, Heiss and Senegas 2002, section 4.2.1).
//!
//! Colour and gloss move by the stroke's opacity towards the stroke's own, each byte rounded to the nearest. The result
//! has the same bits on every processor and for any number of threads.

mod brush;
mod maps;
mod portable;
#[cfg(target_arch = "x86_64")]
mod vectors;

pub use maps::{PermanentMap, ReactionMap};

use super::footprint::Footprint;
use super::texels::{MapSize, TILE_PX, TileMask};
use crate::organ::surface::NEUTRAL_GLOSS;
use bevy::reflect::Reflect;
use brush::{Brush, PROFILE_STEPS, Rows, TABLE_LEN, opacity_bits};
use rayon::prelude::*;

/// Texels of work below which waking other threads takes longer than it saves.
const PARALLEL_AREA_PX: u64 = 1 << 16;

/// Opacity of a disk by the distance from its middle, in 1024 steps of the squared share of the radius.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
pub struct Profile {
    /// Opacities in fifteen bits; from the radius on they are zero.
    table: Box<[i32; TABLE_LEN]>,
}

impl Profile {
    /// Takes opacities (0 to 1) at shares of the radius (0 to 1). Those beyond are clamped; what is no number is
    /// transparent.
    pub fn new(opacity: impl Fn(f32) -> f32) -> Self {
        let mut table = Box::new([0; TABLE_LEN]);
        for (k, entry) in table.iter_mut().take(PROFILE_STEPS).enumerate() {
            let r_squared = (k as f32 + 0.5) / PROFILE_STEPS as f32;
            *entry = i32::from(opacity_bits(opacity(r_squared.sqrt())));
        }
        Self { table }
    }
}

impl Default for Profile {
    /// Falls off as `1 - r^2`.
    fn default() -> Self {
        Self::new(|r| 1.0 - r * r)
    }
}

/// One disk to paint.
#[derive(Clone, Copy, Debug)]
pub struct Stroke<'a> {
    /// Texels that it covers.
    pub footprint: &'a Footprint,
    /// Radius on the surface, metres. It may be less than the footprint's; a greater one counts as the footprint's.
    pub radius_m: f32,
    /// Opacity by the distance from the middle.
    pub profile: &'a Profile,
    /// Colour, sRGB-encoded.
    pub colour: [u8; 3],
    /// Gloss that it moves the map's towards: 128 dry, 255 wet, 0 burnt.
    pub gloss: u8,
    /// Factor on the profile's opacity, 0 to 1.
    pub opacity: f32,
}

/// How rows of texels are blended. All ways leave the same bits.
type Blend = fn(&mut Rows, &Brush, &[(u32, u32)]);

#[cfg(target_arch = "x86_64")]
const BLEND: Blend = vectors::paint;
#[cfg(not(target_arch = "x86_64"))]
const BLEND: Blend = portable::paint;

/// Brings the permanent effects back in the marked tiles. Maps of different sizes are left as they are.
pub fn restore(map: &mut ReactionMap, permanent: &PermanentMap, mask: &TileMask) {
    if map.size() != permanent.size() {
        return;
    }
    let width = map.size().width_px as usize;
    let (columns, rows) = map.size().tiles();
    let (colour, gloss) = map.planes_mut();
    // A mask of a greater map marks what is not there.
    for (column, row) in mask.marked().filter(|&(column, row)| column < columns && row < rows) {
        let rect = TileMask::tile_rect(column, row);
        let side = TILE_PX as usize;
        for y in 0..side {
            let start = (rect.y as usize + y) * width + rect.x as usize;
            let (colour, gloss) = (&mut colour[start..start + side], &mut gloss[start..start + side]);
            match permanent.tile(column, row) {
                Some(tile) => {
                    colour.copy_from_slice(&tile.colour[y * side..(y + 1) * side]);
                    gloss.copy_from_slice(&tile.gloss[y * side..(y + 1) * side]);
                }
                None => {
                    colour.fill([0; 4]);
                    gloss.fill(NEUTRAL_GLOSS);
                }
            }
        }
    }
}

/// Paints strokes one over another, in their order, in the marked tiles. Strokes whose footprint belongs to a map of
/// another size are left out.
pub fn paint(map: &mut ReactionMap, mask: &TileMask, strokes: &[Stroke]) {
    paint_with(BLEND, map, mask, strokes);
}

impl PermanentMap {
    /// Paints a stroke that stays.
    pub fn bake(&mut self, stroke: &Stroke) {
        let Some(brush) = Brush::new(stroke, self.size()) else { return };
        for &rect in stroke.footprint.rects() {
            self.draw_on(rect, |tile_rect, tile| {
                let mut rows = Rows {
                    colour: &mut tile.colour,
                    gloss: &mut tile.gloss,
                    stride: TILE_PX as usize,
                    x: tile_rect.x,
                    y: tile_rect.y,
                };
                // Where the footprint is two rectangles, each draws its own part of a tile that both touch.
                let part = tile_rect.intersection(rect);
                BLEND(&mut rows, &brush, &[(part.x - tile_rect.x, part.right() - tile_rect.x)]);
            });
        }
    }
}

fn paint_with(blend: Blend, map: &mut ReactionMap, mask: &TileMask, strokes: &[Stroke]) {
    let size = map.size();
    let brushes: Vec<Brush> = strokes.iter().filter_map(|stroke| Brush::new(stroke, size)).collect();
    if brushes.is_empty() || mask.is_empty() {
        return;
    }
    let allowed = allowed_columns(size, mask);
    let area: u64 = brushes.iter().map(|brush| brush.area).sum();
    let width = size.width_px as usize;
    let band_area = width * TILE_PX as usize;
    let (colour, gloss) = map.planes_mut();
    if area < PARALLEL_AREA_PX || rayon::current_num_threads() == 1 {
        for brush in &brushes {
            let (top, bottom) = brush.rows;
            for band in top / TILE_PX..bottom.div_ceil(TILE_PX) {
                let texels = band as usize * band_area..(band as usize + 1) * band_area;
                let (colour, gloss) = (&mut colour[texels.clone()], &mut gloss[texels]);
                let mut rows = Rows { colour, gloss, stride: width, x: 0, y: band * TILE_PX };
                blend(&mut rows, brush, &allowed[band as usize]);
            }
        }
        return;
    }
    let bands = colour.par_chunks_mut(band_area).zip(gloss.par_chunks_mut(band_area));
    bands.zip(&brushes_by_band(size, &brushes)).zip(&allowed).enumerate().for_each(
        |(band, (((colour, gloss), listed), allowed))| {
            let mut rows = Rows { colour, gloss, stride: width, x: 0, y: band as u32 * TILE_PX };
            for &index in listed {
                blend(&mut rows, &brushes[index as usize], allowed);
            }
        },
    );
}

/// Ranges of columns of the marked tiles, for each row of tiles.
fn allowed_columns(size: MapSize, mask: &TileMask) -> Vec<Vec<(u32, u32)>> {
    let (columns, rows) = size.tiles();
    let ranges_of = |row: u32| {
        let mut ranges: Vec<(u32, u32)> = Vec::new();
        for column in (0..columns).filter(|&column| mask.is_marked(column, row)) {
            let (start, end) = (column * TILE_PX, (column + 1) * TILE_PX);
            match ranges.last_mut() {
                Some(last) if last.1 == start => last.1 = end,
                _ => ranges.push((start, end)),
            }
        }
        ranges
    };
    (0..rows).map(ranges_of).collect()
}

/// Which brushes touch each row of tiles, in order.
fn brushes_by_band(size: MapSize, brushes: &[Brush]) -> Vec<Vec<u32>> {
    let mut listed = vec![Vec::new(); size.tiles().1 as usize];
    for (index, brush) in (0..).zip(brushes) {
        let (top, bottom) = brush.rows;
        for list in &mut listed[(top / TILE_PX) as usize..bottom.div_ceil(TILE_PX) as usize] {
            list.push(index);
        }
    }
    listed
}

#[cfg(test)]
mod tests;
