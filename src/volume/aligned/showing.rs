//! Which polygons can show something.

use super::polygons::{PatchPolygons, PatchRects};
use super::stack::SliceStack;
use crate::volume::blocks::{BLOCK_SIDE, BlockDistances};
use bevy::reflect::Reflect;
use glam::{DAffine3, UVec3, Vec3, Vec3A};
use rayon::prelude::*;
use std::ops::Range;

/// The blocks that may show something, a bit for each, so that a box of them is asked for quickly.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct ShowingBlocks {
    blocks: UVec3,
    words_per_row: usize,
    words: Vec<u64>,
}

impl ShowingBlocks {
    /// The blocks at a distance of 0.
    pub fn new(distances: &BlockDistances) -> Self {
        let blocks = distances.blocks();
        let words_per_row = (blocks.x as usize).div_ceil(64);
        let words = distances
            .distances()
            .chunks(blocks.x as usize)
            .flat_map(|row| row.chunks(64))
            .map(|part| {
                part.iter().enumerate().fold(0, |word, (bit, &distance)| word | u64::from(distance == 0) << bit)
            })
            .collect();
        Self { blocks, words_per_row, words }
    }

    /// Whether samples between two voxel coordinates may show something.
    pub fn is_any_between(&self, low_voxel: Vec3A, high_voxel: Vec3A) -> bool {
        let side = 1.0 / BLOCK_SIDE as f32;
        let (low, high) = ((low_voxel + 0.5) * side, (high_voxel + 0.5) * side);
        let last = self.blocks.as_ivec3() - 1;
        if low.cmpgt(self.blocks.as_vec3a()).any() || high.cmplt(Vec3A::ZERO).any() || !(low + high).is_finite() {
            return false;
        }
        // What is below 0 is cut off towards 0.
        let low = low.as_ivec3().clamp(glam::IVec3::ZERO, last);
        let high = high.as_ivec3().clamp(glam::IVec3::ZERO, last);
        let (first_word, last_word) = (low.x as usize / 64, high.x as usize / 64);
        let first_mask = u64::MAX << (low.x % 64);
        let last_mask = u64::MAX >> (63 - high.x % 64);
        for z in low.z as usize..=high.z as usize {
            for y in low.y as usize..=high.y as usize {
                let row = (z * self.blocks.y as usize + y) * self.words_per_row;
                for word in first_word..=last_word {
                    let mut bits = self.words[row + word];
                    if word == first_word {
                        bits &= first_mask;
                    }
                    if word == last_word {
                        bits &= last_mask;
                    }
                    if bits != 0 {
                        return true;
                    }
                }
            }
        }
        false
    }
}

/// Bits of a polygon's number that hold its rectangle; those above hold its slice.
pub(crate) const RECT_BITS: u32 = 20;

/// The polygons of a stack that may show something, slices near the eye first, as `slice << 20 | rectangle`; and which of them
/// belong to each slice. Numbers of rectangles that have more bits are left out.
///
/// The texture coordinates within a rectangle lie between those of its corners: between these the blocks are asked for.
pub fn visible_polygons(
    polygons: &PatchPolygons,
    translations: &[Vec3],
    stack: &SliceStack,
    voxel_from_box: DAffine3,
    showing: &ShowingBlocks,
) -> (Vec<u32>, Vec<Range<u32>>) {
    let frames = polygons.frames();
    let (matrix, origin) = (voxel_from_box.matrix3.as_mat3(), voxel_from_box.translation.as_vec3());
    let layers = &polygons.layers[stack.axis];
    let count = layers.len() - 2;
    let slices: Vec<Vec<u32>> = (0..stack.count)
        .into_par_iter()
        .with_min_len(8)
        .map(|n| {
            let along = stack.position(n);
            let layer = (along * count as f32).floor().clamp(-1.0, count as f32) + 1.0;
            let mut found = Vec::new();
            let mut boxed = |own: &PatchRects, rects: Range<u32>| {
                let frames = &frames[own.frames as usize];
                let face = |face: [u32; 4]| face.map(|vertex| translations[vertex as usize]);
                let (front, back) = (face(frames.front), face(frames.back));
                let share = ((along - frames.low_uva.z) / frames.side).clamp(0.0, 1.0);
                let moved: [Vec3A; 4] = std::array::from_fn(|n| Vec3A::from(matrix * front[n].lerp(back[n], share)));
                let axes = [(stack.axis + 1) % 3, (stack.axis + 2) % 3, stack.axis];
                let columns = axes.map(|axis| Vec3A::from(matrix.col(axis)));
                let start = Vec3A::from(origin) + columns[2] * along;
                for rect in rects {
                    let at = &polygons.rects()[rect as usize];
                    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
                    for corner in 0..4 {
                        let u = if corner & 1 == 0 { at.low.x } else { at.high.x };
                        let v = if corner & 2 == 0 { at.low.y } else { at.high.y };
                        let x = ((u - frames.low_uva.x) / frames.side).clamp(0.0, 1.0);
                        let y = ((v - frames.low_uva.y) / frames.side).clamp(0.0, 1.0);
                        let t = moved[0].lerp(moved[1], x).lerp(moved[2].lerp(moved[3], x), y);
                        let rest = start + columns[0] * u + columns[1] * v + t;
                        (low, high) = (low.min(rest), high.max(rest));
                    }
                    // A little more than rounding may take away.
                    if showing.is_any_between(low - 0.01, high + 0.01) && rect >> RECT_BITS == 0 {
                        found.push(n << RECT_BITS | rect);
                    }
                }
            };
            for own in layers[layer as usize].iter().filter(|own| own.from <= along && along < own.to) {
                boxed(own, own.rects.clone());
            }
            found
        })
        .collect();
    let mut all = Vec::with_capacity(slices.iter().map(Vec::len).sum());
    let mut ranges = Vec::with_capacity(slices.len());
    for slice in slices {
        let first = all.len() as u32;
        all.extend(slice);
        ranges.push(first..all.len() as u32);
    }
    (all, ranges)
}
